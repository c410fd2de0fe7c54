from __future__ import annotations

import math

import pytest

from ciberrato.geometry.walls import WallMap
from ciberrato.physics.collisions import resolve_collisions, settle
from ciberrato.world.lab import Lab

WALLS = WallMap.from_lab(Lab(width=20.0, height=10.0))


def moved(pose, speed):
    x, y, heading = pose
    return (x + speed * math.cos(heading), y + speed * math.sin(heading), heading)


def test_exactly_a_radius_from_the_wall_is_free():
    pose = (5.0, 5.0, 0.0)
    assert resolve_collisions(WALLS, [pose], [(0.5, 5.0, 0.0)], [0.1]) == ([False], [False])
    assert resolve_collisions(WALLS, [pose], [(0.4999, 5.0, 0.0)], [0.1]) == ([True], [False])


@pytest.mark.parametrize(
    ("heading", "speed", "at_fault"),
    [
        (0.0, 0.1, True),
        (0.0, -0.1, False),
        (math.pi, -0.1, True),
        (math.pi, 0.1, False),
        (0.0, 0.0, False),
        (1.5, 0.1, True),
        (1.6, 0.1, False),
    ],
)
def test_only_who_moves_towards_the_other_is_at_fault(heading, speed, at_fault):
    poses = [(5.0, 5.0, heading), (5.95, 5.0, 0.0)]
    wall, robot = resolve_collisions(WALLS, poses, [moved(poses[0], speed), poses[1]], [speed, 0.0])
    assert wall == [False, False]
    assert robot == [at_fault, False]


def test_both_are_at_fault_head_on():
    poses = [(5.0, 5.0, 0.0), (6.05, 5.0, math.pi)]
    wanted = [moved(pose, 0.1) for pose in poses]
    assert resolve_collisions(WALLS, poses, wanted, [0.1, 0.1])[1] == [True, True]


def test_touching_discs_do_not_collide():
    poses = [(5.0, 5.0, 0.0), (6.5, 5.0, 0.0)]
    wanted = [(5.5, 5.0, 0.0), (6.5, 5.0, 0.0)]
    assert resolve_collisions(WALLS, poses, wanted, [0.5, 0.0])[1] == [False, False]


def test_robots_on_one_spot_are_not_at_fault():
    poses = [(5.0, 5.0, 0.0), (5.0, 5.0, 1.0)]
    assert resolve_collisions(WALLS, poses, poses, [0.1, 0.1])[1] == [False, False]


def test_each_pair_counts():
    """Robot 0 catches up with 1, who flees, and 2 comes down on 0."""
    poses = [(5.0, 5.0, 0.0), (5.95, 5.0, 0.0), (5.0, 5.95, -math.pi / 2)]
    wanted = [moved(pose, speed) for pose, speed in zip(poses, (0.1, 0.1, 0.1), strict=True)]
    assert resolve_collisions(WALLS, poses, wanted, [0.1, 0.1, 0.1])[1] == [True, False, True]


def test_who_collides_stays_but_turns():
    assert settle((1.0, 2.0, 0.1), (1.1, 2.1, 0.3), True) == (1.0, 2.0, 0.3)
    assert settle((1.0, 2.0, 0.1), (1.1, 2.1, 0.3), False) == (1.1, 2.1, 0.3)
