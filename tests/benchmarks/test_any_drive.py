"""The bound for any drive, against all drives of a tiny lab, equal rooms, and coins by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.any_drive import AnyDrive, coin_divergence, greatest_share, soonest_quantile
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, sensor_distances
from ciberrato.localization.tables.pose_tables import COARSE, build_tables
from ciberrato.world.lab import Lab, Target, Wall

ANGLES = (0.0, 60.0, -60.0, 180.0)
NOISE = 0.1


def box(x0, y0, x1, y1):
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


TINY = Lab(name="tiny", width=6.0, height=4.0, walls=(box(2.9, 2.6, 3.6, 4.0),))


@pytest.fixture(scope="module")
def bound():
    return AnyDrive(TINY, build_tables(TINY, ANGLES, COARSE), NOISE)


def best_of_all_drives(lab, start, rival, cycles):
    """Return the most evidence that any drive of these steps gathers, cycle by cycle.

    Every sequence of steps is tried, 5 to the power of the cycles, those that meet in a pose together: 0.15
    units ahead or back, 15 degrees to either side (which takes 0.87 cycles, counted as one), or none.
    """
    walls = WallMap.from_lab(lab)

    def rate(ahead, left, turn):
        seen = []
        for x, y, heading in (start, rival):
            cosine, sine = math.cos(heading), math.sin(heading)
            at = x + cosine * ahead - sine * left, y + sine * ahead + cosine * left
            if walls.distance(*at) < 0.5 or walls.point_in_polygons(*at):
                return None if not seen else 1e3
            directions = heading + turn + np.deg2rad(ANGLES)
            seen.append(ideal_reading(sensor_distances(walls, *at, directions)))
        return float(0.5 * (((seen[0] - seen[1]) / NOISE) ** 2).sum())

    step, known = math.radians(15.0), {}
    first = rate(0.0, 0.0, 0.0)
    best, found = {(0.0, 0.0, 0): first}, [first]
    for _ in range(cycles):
        after = {}
        for (ahead, left, turn), total in best.items():
            for move, turned in ((0.0, 0), (0.15, 0), (-0.15, 0), (0.0, 1), (0.0, -1)):
                facing = (turn + turned) % 24
                place = (
                    round(ahead + move * math.cos(facing * step), 6),
                    round(left + move * math.sin(facing * step), 6),
                    facing,
                )
                if place not in known:
                    known[place] = rate(place[0], place[1], facing * step)
                if known[place] is not None:
                    after[place] = max(after.get(place, 0.0), total + known[place])
        best = after
        found.append(max(best.values()))
    return np.array(found)


@pytest.mark.parametrize("start", [(1.0, 1.2, 0.4), (4.9, 2.7, -2.0)])
def test_no_drive_of_a_tiny_lab_beats_the_bound(bound, start):
    rivals = bound.rivals(start)[:2]
    assert len(rivals) == 2
    evidence = bound.evidence(start, 4, rivals)
    assert (np.diff(evidence, axis=1) >= 0.0).all()
    drives = np.array([best_of_all_drives(TINY, start, tuple(rival), 4) for rival in rivals])
    assert (drives <= evidence * (1.0 + 1e-9)).all()
    assert (drives[:, 1:] > 0.0).all()
    assert (greatest_share(drives) <= greatest_share(evidence) + 1e-9).all()


def test_equal_rooms_are_never_told_apart_and_a_target_is_as_soon_as_it_is_reached():
    walls = (box(4.9, 0.0, 5.1, 4.0), box(1.0, 2.9, 1.6, 4.0), box(8.4, 0.0, 9.0, 1.1))
    for targets, sooner in (((), False), ((Target(x=4.0, y=1.0, radius=0.9),), True)):
        lab = Lab(name="equal", width=10.0, height=4.0, walls=walls, targets=targets)
        bound = AnyDrive(lab, build_tables(lab, ANGLES, COARSE), NOISE)
        start = (1.1, 1.0, 0.0)
        (other,) = bound.equal(start)
        assert (*other[:2], abs(other[2])) == pytest.approx((8.9, 3.0, math.pi), abs=1e-3)
        share = greatest_share(bound.evidence(start, 40))
        reached = np.flatnonzero(share > 0.9)
        if sooner:
            # 2.9 units to the target's middle, 0.4 less to where the robot is inside: 16 cycles at full
            # speed; 0.31 units are allowed for the places in between.
            assert 12 <= reached[0] <= 16
        else:
            assert share.max() < 1e-6
            assert soonest_quantile(share[np.newaxis], 0.5) == math.inf
    with_compass = AnyDrive(lab, build_tables(lab, ANGLES, COARSE), NOISE, compass=True)
    assert len(with_compass.equal(start)) == 0


def test_what_evidence_allows_is_that_of_two_coins():
    assert coin_divergence(np.array([0.5]), np.array([0.25]))[0] == pytest.approx(
        0.5 * math.log(2.0) + 0.5 * math.log(0.5 / 0.75)
    )
    needed = 0.9 * math.log(99.0) + 0.1 * math.log(0.1 / (1.0 - 0.9 / 99.0))
    share = greatest_share(np.array([[0.0, needed - 1e-3, needed + 1e-3, 50.0]]))
    assert share[0] == pytest.approx(0.0, abs=1e-6)
    assert share[1] < 0.9 < share[2]
    assert share[3] == 1.0
    # Of two rivals alike as much evidence allows less, and one that is refuted changes nothing.
    alone, both, refuted = (
        greatest_share(np.array([[evidence] for evidence in rows]))[0]
        for rows in ((3.0,), (3.0, 3.0), (3.0, 400.0))
    )
    assert both < alone == pytest.approx(refuted)
    assert soonest_quantile(np.array([[0.0, 0.4, 1.0], [0.0, 0.8, 1.0]]), 0.6) == 1.0
