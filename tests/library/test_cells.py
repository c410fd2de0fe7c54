"""Tables over the cells of a lab."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from ciberrato.files.lab import default_lab, read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import (
    cell_centres,
    cell_openings,
    cell_readings,
    ideal_reading,
    nearest_in_cone,
    round_reading,
    sensor_distances,
)
from ciberrato.labs import find_lab, names
from ciberrato.world.lab import Lab, Wall


def test_centres_from_the_bottom_left():
    centres = cell_centres(Lab(width=17.5, height=5.0))
    assert centres.shape == (2, 8, 2)
    np.testing.assert_array_equal(centres[0, 0], [1.0, 1.0])
    np.testing.assert_array_equal(centres[1, 7], [15.0, 3.0])


def test_readings_equal_the_recorded_ones(golden):
    """Every cell, four headings, six angles of each lab; the rows of `rooms` on a face included."""
    from benchmarks.conformance.files import numbers

    columns = ("x", "y", "dir_deg", "sensor_angle_deg", "distance")
    for name, rows in numbers(golden / "ir/own_cell_centres.csv.gz", columns, "lab"):
        lab = read_lab(find_lab(name.removeprefix("maps/")))
        angles = [0.0, 90.0, -90.0, 180.0, 60.0, -60.0]
        for heading in (0.0, 90.0, 180.0, -90.0):
            readings = cell_readings(lab, angles, math.radians(heading))
            for sensor, angle in enumerate(angles):
                recorded = rows[(rows[:, 2] == heading) & (rows[:, 3] == angle)]
                column, row = (recorded[:, :2].T // 2).astype(int)
                np.testing.assert_allclose(
                    readings[row, column, sensor], ideal_reading(recorded[:, 4]), rtol=1e-12, atol=0
                )


def test_ambiguity_of_the_standard_lab():
    """Published figures: 98 cells give 61 distinct rounded readings, and 42 cells have one of their own."""
    readings = round_reading(cell_readings(default_lab(), [0.0, 90.0, -90.0, 180.0])).reshape(98, 4)
    _, counts = np.unique(readings, axis=0, return_counts=True)
    assert len(counts) == 61
    assert (counts == 1).sum() == 42


def test_offsets_move_the_robot(rng):
    lab = read_lab(find_lab("maze"))
    offsets = rng.uniform(-0.2, 0.2, (5, 3))
    readings = cell_readings(lab, [0.0, 60.0, -60.0, 180.0], 0.3, offsets=offsets)
    assert readings.shape == (5, 7, 14, 4)
    walls = WallMap.from_lab(lab)
    for pose, (dx, dy, turn) in enumerate(offsets):
        distance = sensor_distances(walls, 7.0 + dx, 5.0 + dy, 0.3 + turn + math.radians(-60.0))
        assert readings[pose, 2, 3, 2] == pytest.approx(float(ideal_reading(distance)), rel=1e-14)
    np.testing.assert_array_equal(
        cell_readings(lab, [0.0], offsets=np.zeros((1, 3)))[0], cell_readings(lab, [0.0])
    )


def test_the_second_model():
    lab = read_lab(find_lab("diagonals"))
    centres = cell_centres(lab)
    expected = ideal_reading(
        nearest_in_cone(WallMap.from_lab(lab), centres[..., 0], centres[..., 1], math.pi / 3)
    )
    readings = cell_readings(lab, [60.0], model="cone")[..., 0]
    np.testing.assert_allclose(readings, expected, rtol=1e-12)
    assert (readings > cell_readings(lab, [60.0])[..., 0] + 0.01).any()


@pytest.mark.parametrize("name", ["standard", "corridors", "maze", "twins", "wide"])
def test_openings_as_the_row_patterns_draw_them(name):
    """A bar between two cells, or a dash above one, closes the way; this is read off the file's text."""
    path = find_lab(name)
    patterns = {
        int(row): pattern.ljust(99)
        for row, pattern in re.findall(
            r'<Row Pos="(\d+)" Pattern="([^"]*)"', path.read_text(encoding="utf-8")
        )
    }
    lab = read_lab(path)
    east, north = cell_openings(lab)
    assert east.shape == (lab.rows, lab.columns - 1)
    assert north.shape == (lab.rows - 1, lab.columns)
    for row in range(lab.rows):
        for column in range(lab.columns):
            if column < lab.columns - 1:
                assert east[row, column] == (patterns[2 * row][3 * column + 2] != "|")
            if row < lab.rows - 1:
                assert north[row, column] == (patterns[2 * row + 1][3 * column] != "-")


def test_openings_are_too_narrow_for_a_robot_where_a_wall_sticks_out():
    stub = Wall(corners=((1.9, 1.4), (2.1, 1.4), (2.1, 2.0), (1.9, 2.0)))
    open_way, closed_way = (
        cell_openings(Lab(width=4.0, height=4.0, walls=walls))[0] for walls in ((), (stub,))
    )
    np.testing.assert_array_equal(open_way, [[True], [True]])
    np.testing.assert_array_equal(closed_way, [[False], [True]])


def test_openings_of_every_lab_that_ships_are_those_of_a_robot_pushed_along():
    for name in names("lab"):
        lab = read_lab(find_lab(name))
        walls = WallMap.from_lab(lab)
        east, _ = cell_openings(lab)
        centres = cell_centres(lab)
        way = centres[:, :-1, 0, np.newaxis] + np.linspace(0.0, 2.0, 101)
        least = walls.distance(way, centres[:, :-1, 1, np.newaxis]).min(axis=-1)
        np.testing.assert_array_equal(east, least >= 0.5)


def test_a_lab_of_one_row_has_no_way_north():
    east, north = cell_openings(Lab(width=8.0, height=2.0))
    assert east.shape == (1, 3)
    assert north.shape == (0, 4)
