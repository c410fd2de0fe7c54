"""Shortest ways of a disc, against geometry done by hand and against walks on a fine grid."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest

from ciberrato.files.lab import read_lab
from ciberrato.geometry.shortest_paths import DiscPaths
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_lab
from ciberrato.world.lab import Lab, Wall

RADIUS = 0.5


def block(x0, y0, x1, y1, height=4.0):
    return Wall(height=height, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def length(lab, start, end):
    return DiscPaths(lab, RADIUS).paths_from(*start).length_to(*end)


def test_nothing_in_the_way():
    assert length(Lab(), (1, 1), (4, 5)) == pytest.approx(5.0, abs=1e-12)


def test_a_line_on_the_floor_is_not_in_the_way():
    assert length(Lab(walls=(block(2, 0, 3, 16, height=0.0),)), (1, 8), (4, 8)) == pytest.approx(3.0)


def test_over_one_corner():
    # Up to a circle about the corner (8, 8), round it, and down again: tangents of length sqrt(d^2 - r^2).
    lab = Lab(walls=(block(8, 0, 8.0001, 8),))
    ends = math.hypot(3, 4)
    tangent = math.sqrt(ends**2 - RADIUS**2)
    bend = 2 * (math.atan2(4, 3) + math.asin(RADIUS / ends))
    assert length(lab, (5, 4), (11, 4)) == pytest.approx(2 * tangent + RADIUS * bend, abs=2e-4)


def test_along_a_wall():
    # Both corners of a block are passed on the same side: the string lies along its top.
    lab = Lab(walls=(block(6, 0, 10, 8),))
    ends = math.hypot(3, 4)
    tangent = math.sqrt(ends**2 - RADIUS**2)
    bend = math.atan2(4, 3) + math.asin(RADIUS / ends)
    assert length(lab, (3, 4), (13, 4)) == pytest.approx(2 * tangent + 2 * RADIUS * bend + 4, abs=1e-9)


def test_between_two_corners_on_different_sides():
    # An S through the gap between two thin walls: an inner tangent of circles at (6, 10) and (10, 6).
    lab = Lab(walls=(block(5.9999, 0, 6, 10), block(10, 6, 10.0001, 16)))
    between = math.hypot(4, 4)
    inner = math.sqrt(between**2 - (2 * RADIUS) ** 2)
    down = math.radians(45) + math.asin(2 * RADIUS / between)
    outer = math.sqrt(math.hypot(3, 4) ** 2 - RADIUS**2)
    # The direction up to the first circle, from (3, 6), which is passed on the right.
    up = math.atan2(4, 3) + math.asin(RADIUS / 5)
    expected = 2 * outer + inner + 2 * RADIUS * (up + down)
    assert length(lab, (3, 6), (13, 10)) == pytest.approx(expected, abs=3e-4)


def test_no_way_through_a_gap_that_is_too_narrow():
    narrow = Lab(walls=(block(8, 0, 9, 8), block(8, 8.999, 9, 16)))
    wide = Lab(walls=(block(8, 0, 9, 8), block(8, 9.001, 9, 16)))
    assert length(narrow, (2, 8), (14, 8)) == math.inf
    assert length(wide, (2, 8.5), (14, 8.5)) == pytest.approx(12.0)


def test_the_way_is_as_long_there_as_back():
    lab = read_lab(find_lab("maze"))
    there, back = ((1.2, 1.1), (20.7, 11.3)), ((20.7, 11.3), (1.2, 1.1))
    assert length(lab, *there) == pytest.approx(length(lab, *back), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "start"), [("maze", (1.0, 1.0)), ("diagonals", (1.0, 1.0)), ("rooms", (3.0, 3.0))]
)
def test_no_walk_on_a_grid_is_shorter_and_the_best_is_little_longer(name, start):
    # A little slimmer than the robot: `rooms` has a gap of exactly its diameter, which a grid cannot find.
    radius = RADIUS - 0.03
    lab = read_lab(find_lab(name))
    paths = DiscPaths(lab, radius).paths_from(*start)
    walks = grid_walks(lab, start, radius)
    reached = 0
    for x, y in [(1.0 + 2 * column, 1.0 + 2 * row) for column in range(14) for row in range(7)]:
        walk = walks.get((round(x / GRID), round(y / GRID)), math.inf)
        ours = paths.length_to(x, y)
        if math.isinf(walk):
            assert math.isinf(ours)
        else:
            reached += 1
            assert ours <= walk + 1e-9
            # Sixteen directions are up to 2.8 % longer than straight, and each bend is a little wider.
            assert ours >= walk / 1.03 - 0.3
    assert reached >= 60


GRID = 0.1
STEPS = [(a, b) for a in range(-2, 3) for b in range(-2, 3) if math.gcd(a, b) == 1]


def grid_walks(lab, start, radius):
    """Lengths of the shortest walks over points 0.1 apart that are far enough from all walls."""
    columns, rows = round(lab.width / GRID), round(lab.height / GRID)
    walls = WallMap.from_lab(lab)
    distance = walls.distance(GRID * np.arange(columns + 1), GRID * np.arange(rows + 1)[:, np.newaxis])
    # A step is at most 0.23 long: with this much room its whole length is free.
    free = distance >= radius + 0.015
    found = {}
    waiting = [(0.0, (round(start[0] / GRID), round(start[1] / GRID)))]
    while waiting:
        length, node = heapq.heappop(waiting)
        if node in found:
            continue
        found[node] = length
        for dx, dy in STEPS:
            column, row = node[0] + dx, node[1] + dy
            if 0 <= column <= columns and 0 <= row <= rows and free[row, column]:
                heapq.heappush(waiting, (length + GRID * math.hypot(dx, dy), (column, row)))
    return found
