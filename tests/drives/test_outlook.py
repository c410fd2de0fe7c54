"""What legs tell of a sample of poses: against plain loops, and in a lab made for it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agent.drives.clearance import PoseSample
from agent.drives.outlook import expected_gain
from ciberrato.localization.tables.pose_tables import PoseTables, build_tables
from ciberrato.localization.tables.reading_codes import code_distances
from ciberrato.world.lab import Lab, Wall

ANGLES = (0.0, 60.0, -60.0, 180.0)


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def sample(*poses: tuple[float, float, float]) -> PoseSample:
    x, y, heading = np.array(poses).T
    return PoseSample(x=x, y=y, heading=heading)


@pytest.fixture(scope="module")
def lanes() -> PoseTables:
    """Two lanes, turned images of one another but for a block beside the left end of the upper one."""
    walls = (box(0.0, 1.95, 14.0, 2.05), box(2.5, 3.45, 3.0, 4.0))
    return build_tables(Lab(name="lanes", width=14.0, height=4.0, walls=walls), ANGLES, 2.0 / 9.0)


def one_by_one(
    tables: PoseTables, poses: list[tuple[float, float, float]], turn: float, length: float, noise: float
) -> float:
    """Compute the gain of a leg place by place and pair by pair."""
    lattice = tables.lattice
    evidence = np.zeros((len(poses), len(poses)))
    for number in range(1, int(length / 0.5 + 1e-9) + 1):
        seen = []
        for x, y, heading in poses:
            at = (
                x + 0.5 * number * math.cos(heading + turn),
                y + 0.5 * number * math.sin(heading + turn),
            )
            square = int(lattice.squares_at(np.array(at[0]), np.array(at[1])))
            readings = []
            for table, ahead in tables.sensors:
                around = tables.codes[table].shape[0] // 2
                direction = round((heading + turn) / (2.0 * math.pi) * around) % around + ahead
                code = tables.codes[table][direction, square] if square < lattice.size else None
                readings.append(0.0 if code is None else min(1.0 / code_distances()[code], 4.0))
            seen.append(readings)
        for i, mine in enumerate(seen):
            for j, others in enumerate(seen):
                apart = 0.0
                for one, other in zip(mine, others, strict=True):
                    apart += max(abs(one - other) - 0.15 * max(one, other) ** 2, 0.0) ** 2
                evidence[i, j] += 0.4 * 0.5 / 0.14 * min(0.5 * apart / noise**2, 5.0)
    return float(-np.mean(np.log(np.mean(np.exp(-evidence), axis=1))))


def test_the_gain_is_that_of_pairs_one_by_one(lanes: PoseTables) -> None:
    generator = np.random.default_rng(3)
    poses = [
        (x, y, heading)
        for x, y, heading in zip(
            generator.uniform(2.0, 12.0, 6),
            generator.choice([1.0, 3.0], 6),
            generator.uniform(-3.0, 3.0, 6),
            strict=True,
        )
    ]
    turns, lengths = np.array([0.0, -2.0, 1.3]), np.array([1.5, 0.5, 2.0])
    found = expected_gain(lanes, sample(*poses), turns, lengths, 0.1)
    expected = [
        one_by_one(lanes, poses, *leg, 0.1) for leg in zip(turns.tolist(), lengths.tolist(), strict=True)
    ]
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert min(expected) > 0.1


def test_only_the_leg_that_passes_the_block_tells_the_lanes_apart(lanes: PoseTables) -> None:
    images = sample((9.0, 1.0, 0.0), (5.0, 3.0, math.pi))
    there, back = expected_gain(lanes, images, np.array([0.0, math.pi]), np.array([3.0, 3.0]), 0.1)
    assert there > 0.5
    assert back == pytest.approx(0.0, abs=1e-6)
    assert there <= math.log(2.0) + 1e-6


def test_what_an_error_of_the_place_explains_tells_nothing(lanes: PoseTables) -> None:
    near = sample((9.0, 1.0, 0.0), (9.05, 1.02, 0.0))
    assert expected_gain(lanes, near, np.array([0.0]), np.array([3.0]), 0.1)[0] == pytest.approx(
        0.0, abs=0.02
    )
