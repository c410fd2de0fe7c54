"""Poses that are equal for a robot, against drives ray by ray."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ciberrato.checks.equal_places import equal_poses, equal_rooms
from ciberrato.checks.free_space import free_space
from ciberrato.checks.likeness import likeness_findings
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, sensor_distances
from ciberrato.world.lab import Lab, Target, Wall

ANGLES = np.deg2rad([0.0, 60.0, -60.0, 180.0])


def box(x0, y0, x1, y1):
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def turned(wall, width, height):
    return Wall(height=4.0, corners=tuple((width - x, height - y) for x, y in wall.corners))


PILLAR = box(1.9, 3.0, 2.6, 3.9)
BETWEEN = box(4.9, 0.0, 5.1, 6.0), box(10.9, 0.0, 11.1, 6.0)
TURNED = Lab(name="turned rooms", width=16.0, height=6.0, walls=(*BETWEEN, PILLAR, turned(PILLAR, 16.0, 6.0)))
SHIFTED = Lab(
    name="shifted rooms", width=16.0, height=6.0, walls=(*BETWEEN, PILLAR, box(13.0, 3.0, 13.7, 3.9))
)
OTHERWISE = Lab(
    name="other rooms", width=16.0, height=6.0, walls=(*BETWEEN, PILLAR, box(13.2, 2.1, 14.1, 2.9))
)


def poses_equal_to(lab, pose, **knows):
    space = free_space(lab)
    return equal_poses(space, equal_rooms(lab, space), pose, **knows)


def readings_on_a_drive(lab, pose, seed):
    """Return what is read in 200 places of a random drive, where there is room, relative to a pose."""
    walls, generator = WallMap.from_lab(lab), np.random.default_rng(seed)
    ahead, left, turn = generator.uniform((-6.0, -6.0, -3.1), (6.0, 6.0, 3.1), (200, 3)).T
    x = pose[0] + math.cos(pose[2]) * ahead - math.sin(pose[2]) * left
    y = pose[1] + math.sin(pose[2]) * ahead + math.cos(pose[2]) * left
    room = walls.distance(x, y) >= 0.5
    room &= ~walls.point_in_polygons(x, y) & (x > 0.0) & (x < lab.width) & (y > 0.0) & (y < lab.height)
    # Only the room that the pose is in: the walls between are at 4.9 to 5.1 and 10.9 to 11.1.
    room &= (x < 5.0) == (pose[0] < 5.0)
    room &= (x > 11.0) == (pose[0] > 11.0)
    directions = pose[2] + turn[:, np.newaxis] + ANGLES
    seen = ideal_reading(sensor_distances(walls, x[:, np.newaxis], y[:, np.newaxis], directions))
    return np.where(room[:, np.newaxis], seen, -1.0)


@pytest.mark.parametrize(("lab", "turn"), [(TURNED, math.pi), (SHIFTED, 0.0)])
def test_equal_rooms_are_equal_on_every_drive(lab, turn):
    pose = (1.2, 1.1, 0.3)
    (other,) = poses_equal_to(lab, pose)
    wanted = (16.0 - 1.2, 6.0 - 1.1, 0.3 - math.pi) if turn else (1.2 + 11.1, 1.1, 0.3)
    assert other == pytest.approx(wanted, abs=1e-6)
    here, there = (readings_on_a_drive(lab, each, 3) for each in (pose, other))
    assert (here[:, 0] > 0.0).sum() > 20
    np.testing.assert_allclose(here, there, atol=1e-6)
    (back,) = poses_equal_to(lab, other)
    assert back == pytest.approx(pose, abs=1e-6)
    assert len(poses_equal_to(lab, pose, compass=True)) == (turn == 0.0)


def test_a_pillar_elsewhere_makes_rooms_different():
    assert poses_equal_to(OTHERWISE, (1.2, 1.1, 0.3)) == []
    assert len(poses_equal_to(OTHERWISE, (8.0, 3.0, 0.3))) == 1  # the empty one between, turned by half
    assert poses_equal_to(OTHERWISE, (5.0, 3.0, 0.0)) == []  # in a wall


@pytest.mark.parametrize(("width", "height", "number"), [(6.0, 6.0, 3), (8.0, 6.0, 1)])
def test_a_room_can_be_equal_to_itself(width, height, number):
    lab = Lab(name="box", width=width, height=height, walls=())
    found = poses_equal_to(lab, (1.0, 2.0, 0.5))
    assert len(found) == number
    assert any(pose == pytest.approx((width - 1.0, height - 2.0, 0.5 - math.pi), abs=1e-9) for pose in found)
    marked = Lab(
        name="box", width=width, height=height, walls=(), targets=(Target(x=1.5, y=1.5, radius=1.5),)
    )
    assert poses_equal_to(marked, (1.0, 2.0, 0.5)) == []


def test_check_names_rooms_that_are_equal_turned_round():
    for lab, number in ((TURNED, 1), (SHIFTED, 0)):
        notes = likeness_findings(lab, free_space(lab), "my.xml", 1)
        rooms = [note for note in notes if note.kind == "turned rooms"]
        assert len(rooms) == number
        if rooms:
            assert "look the same turned by 180°" in str(rooms[0])
            assert "no robot can tell in which of them it is" in str(rooms[0])


def test_a_room_turned_by_a_third_is_found_though_the_lattice_is_not_turned():
    corners = [
        (10.0 + 8.0 * math.cos(k * math.pi / 3), 9.0 + 8.0 * math.sin(k * math.pi / 3)) for k in range(6)
    ]
    outer = [(10.0 + 8.6 * (x - 10.0) / 8.0, 9.0 + 8.6 * (y - 9.0) / 8.0) for x, y in corners]
    sides = tuple(
        Wall(height=4.0, corners=(corners[k], corners[k - 1], outer[k - 1], outer[k])) for k in range(6)
    )
    pillars = tuple(
        Wall(
            height=4.0,
            corners=tuple((x + 0.4 * math.cos(t + q), y + 0.4 * math.sin(t + q)) for q in (0, 2, 4)),
        )
        for t in (0.4, 0.4 + 2.0 * math.pi / 3.0, 0.4 + 4.0 * math.pi / 3.0)
        for x, y in [(10.0 + 3.0 * math.cos(t), 9.0 + 3.0 * math.sin(t))]
    )
    pose = (11.0, 12.0, 0.2)
    for walls, number in ((sides + pillars, 2), (sides + pillars[:2], 0)):
        lab = Lab(name="hexagon", width=20.0, height=18.0, walls=walls)
        space = free_space(lab)
        inner = [room for room in equal_rooms(lab, space) if abs(room.x - 10.0) + abs(room.y - 9.0) < 0.5]
        found = equal_poses(space, inner, pose)
        assert len(found) == number
        if found:
            assert math.hypot(inner[0].x - 10.0, inner[0].y - 9.0) < 1e-3
            readings = [readings_at(lab, each) for each in (pose, *found)]
            np.testing.assert_allclose(readings[1], readings[0], atol=0.01)
            np.testing.assert_allclose(readings[2], readings[0], atol=0.01)
            # A target is small, but the ground sensor tells in one of three equal places.
            marked = dataclasses.replace(lab, targets=(Target(x=10.0, y=11.0, radius=0.9),))
            assert not any(len(room.symmetries) > 1 for room in equal_rooms(marked, space) if room.kind == 0)


def readings_at(lab, pose):
    return ideal_reading(sensor_distances(WallMap.from_lab(lab), pose[0], pose[1], pose[2] + ANGLES))
