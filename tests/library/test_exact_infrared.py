"""IR readings that hang on the last bit of a distance: the real simulator's arithmetic and recordings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.conformance.files import numbers, read_named_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.exact import CLOSE, exact_distance, hang_on_rounding, hangs_on_rounding
from ciberrato.infrared.model import (
    SENSOR_OFFSET,
    distances_at,
    ideal_reading,
    round_reading,
    sensor_distances,
)
from ciberrato.world.lab import Lab
from tests.recordings import OWN

COLUMNS = ("x", "y", "dir_deg", "sensor_angle_deg", "distance")


def recorded(file: str):
    for name, rows in numbers(OWN / f"ir/{file}.csv.gz", COLUMNS, "lab"):
        lab = read_named_lab(name, None)
        assert lab is not None
        x, y, heading, angle, distance = rows.T
        yield WallMap.from_lab(lab), x, y, heading * math.pi / 180.0 + angle / 180.0 * math.pi, distance


@pytest.mark.parametrize(("file", "every"), [("own_cell_centres", 13), ("own_random_poses", 17)])
def test_recorded_distances_come_out_to_the_last_bit(file: str, every: int) -> None:
    count = 0
    for walls, x, y, direction, distance in recorded(file):
        for row in range(0, x.size, every):
            ours = exact_distance(walls, float(x[row]), float(y[row]), float(direction[row]), SENSOR_OFFSET)
            assert ours == distance[row]
            count += 1
    assert count > 700


def test_recorded_readings_at_ties_come_out_right_only_so() -> None:
    ties, wrong_otherwise = 0, 0
    for walls, x, y, direction, distance in recorded("own_cell_centres"):
        ours = sensor_distances(walls, x, y, direction)
        theirs = round_reading(ideal_reading(distance))
        near = hang_on_rounding(ours)
        assert (round_reading(ideal_reading(ours))[~near] == theirs[~near]).all()
        wrong_otherwise += int((round_reading(ideal_reading(ours)) != theirs).sum())
        for row in np.flatnonzero(near).tolist():
            place = float(x[row]), float(y[row]), float(direction[row])
            exact = exact_distance(walls, *place, SENSOR_OFFSET)
            assert round_reading(ideal_reading(exact)) == theirs[row]
            ties += 1
    assert (ties, wrong_otherwise) == (60, 40)


def test_a_ray_of_length_4_reads_as_0_3() -> None:
    """The border is two units below the sensor, and the ray along the cone's edge at 30 degrees to it."""
    walls = WallMap.from_lab(Lab(width=28.0, height=14.0))
    (fast,) = distances_at(walls, 24.0, 2.0, [math.pi])
    exact = exact_distance(walls, 24.0, 2.0, math.pi, SENSOR_OFFSET)
    assert fast == pytest.approx(4.0, abs=1e-12)
    assert exact == pytest.approx(4.0, abs=1e-12)
    assert hangs_on_rounding(fast)
    assert round_reading(ideal_reading(exact)) == 0.3


def test_ties_are_told_apart_from_everything_else() -> None:
    ties = np.array([1.0 / (0.05 + 0.1 * step) for step in range(1000)])
    beside = np.concatenate((ties * (1.0 + 1e-6), ties * (1.0 - 1e-6)))
    others = np.array([0.0, 1e-9, math.inf, *(1.0 / (0.1 * step) for step in range(1, 1000))])
    for distances, expected in ((ties, True), (beside, False), (others, False)):
        assert (hang_on_rounding(distances) == expected).all()
        assert [hangs_on_rounding(distance) for distance in distances.tolist()] == [expected] * distances.size
    # A step either way from a tie gives another reading; that of no other distance depends on CLOSE.
    for tie in ties.tolist():
        low, high = tie * (1.0 + CLOSE / 10), tie * (1.0 - CLOSE / 10)
        assert round_reading(ideal_reading(low)) != round_reading(ideal_reading(high))


@pytest.mark.parametrize("turns", [0, 1, -1])
def test_whole_turns_change_nothing_but_for_rounding(shipped, rng, turns: int) -> None:
    walls = shipped("maze")
    for x, y, direction in zip(
        rng.uniform(1, 27, 200), rng.uniform(1, 13, 200), rng.uniform(-math.pi, math.pi, 200), strict=True
    ):
        place = float(x), float(y), float(direction)
        plain = sensor_distances(walls, *place)
        turned = place[2] + turns * 2 * math.pi
        assert exact_distance(walls, *place[:2], turned, SENSOR_OFFSET) == pytest.approx(plain, rel=1e-9)


def test_beyond_three_half_turns_every_corner_counts(shipped) -> None:
    """By hand: the sensor of a robot at (17, 1) is at (16.5, 1), and the nearest corner at (16, 1.9)."""
    walls = shipped("maze")
    expected = math.hypot(0.5, 0.9)
    assert exact_distance(walls, 17.0, 1.0, 5 * math.pi, SENSOR_OFFSET) == pytest.approx(expected, abs=1e-9)
    assert distances_at(walls, 17.0, 1.0, [5 * math.pi]) == pytest.approx([expected], abs=1e-9)
