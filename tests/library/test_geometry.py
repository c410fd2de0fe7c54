"""WallMap against slow, independent reckoning: dense samples of the walls, and exact fractions."""

from __future__ import annotations

import copy
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ciberrato.files.lab import default_lab, read_lab
from ciberrato.geometry.face_index import FaceIndex, least
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_lab, names
from ciberrato.world.lab import Lab, Wall

SPACING = 0.002


def sampled_walls(lab: Lab) -> np.ndarray:
    """Points along all walls higher than 0, `SPACING` apart or less."""
    points = []
    for wall in (lab.border, *lab.walls):
        if wall.height > 0.0:
            corners = np.array(wall.corners)
            for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                count = int(np.hypot(*(end - start)) / SPACING) + 2
                points.append(start + np.linspace(0.0, 1.0, count)[:, np.newaxis] * (end - start))
    return np.concatenate(points)


@pytest.fixture(scope="module")
def walls(clutter) -> WallMap:
    return WallMap.from_lab(clutter)


def test_faces_of_the_standard_lab():
    walls = WallMap.from_lab(default_lab())
    assert len(walls.length) == 55 * 4
    np.testing.assert_array_equal(walls.start + walls.edge, walls.end)
    np.testing.assert_allclose(walls.direction * walls.length[:, np.newaxis], walls.edge, rtol=1e-15)
    assert walls.length.sum() == pytest.approx(
        sum(
            np.hypot(*(np.array(wall.corners) - np.roll(wall.corners, 1, axis=0)).T).sum()
            for wall in (default_lab().border, *default_lab().walls)
        )
    )


def test_lines_do_not_count_but_hide_beacons_of_height_zero():
    lab = read_lab(find_lab("lines"))
    assert len(WallMap.from_lab(lab).length) == 4
    assert len(WallMap.from_lab(lab, at_least=0.0).length) == 4 * (len(lab.walls) + 1)
    assert len(WallMap.from_lab(lab, at_least=4.5).length) == 0


def test_walls_as_high_as_the_beacon_hide_it():
    walls = (Wall(height=2.0, corners=((1.0, 1.0), (2.0, 1.0), (1.0, 2.0))),)
    lab = Lab(walls=walls)
    assert [len(WallMap.from_lab(lab, at_least=height).length) for height in (1.9, 2.0, 2.1)] == [7, 7, 4]


def test_distance_to_dense_samples(clutter, walls, rng):
    x, y = rng.uniform(-2.0, 14.0, 60), rng.uniform(-2.0, 11.0, 60)
    points = sampled_walls(clutter)
    nearest = np.hypot(points[:, 0] - x[:, np.newaxis], points[:, 1] - y[:, np.newaxis]).min(axis=1)
    distance = walls.distance(x, y)
    assert (distance <= np.minimum(nearest, clutter.width) + 1e-12).all()
    assert (distance >= nearest - SPACING).all()


def test_distance_broadcasts_and_takes_numbers(walls):
    grid = walls.distance(np.arange(3.0), np.arange(4.0)[:, np.newaxis])
    assert grid.shape == (4, 3)
    assert walls.distance(1.0, 2.0).shape == ()
    assert float(walls.distance(1.0, 2.0)) == grid[2, 1]
    assert walls.distance(np.zeros(0), np.zeros(0)).shape == (0,)


def test_distance_is_at_most_the_width_of_the_lab():
    assert float(WallMap.from_lab(Lab(width=4.0, height=4.0)).distance(100.0, 0.0)) == 4.0


def test_touches_is_distance_below_the_radius_to_the_last_bit(walls, rng):
    x, y = rng.uniform(-1.0, 13.0, 400), rng.uniform(-1.0, 10.0, 400)
    distance = walls.distance(x, y)
    for radius in (0.1, 0.5, 3.0):
        touches = [walls.touches(*point, radius) for point in zip(x.tolist(), y.tolist(), strict=True)]
        np.testing.assert_array_equal(touches, distance < radius)
    # The very distance is free, the next larger number is not.
    for point, exact in zip(zip(x.tolist(), y.tolist(), strict=True), distance.tolist(), strict=True):
        assert not walls.touches(*point, exact)
        assert walls.touches(*point, float(np.nextafter(exact, 99.0)))


def test_touches_beyond_the_list_of_near_faces(monkeypatch, clutter, rng):
    monkeypatch.setattr("ciberrato.geometry.nearest_faces._MAX_FACES", 5)
    walls = WallMap.from_lab(clutter)
    x, y = rng.uniform(0.0, 12.0, 50), rng.uniform(0.0, 9.0, 50)
    touches = [walls.touches(*point, 2.5) for point in zip(x.tolist(), y.tolist(), strict=True)]
    np.testing.assert_array_equal(touches, walls.distance(x, y) < 2.5)


def test_memory_for_squares_is_bounded(monkeypatch, walls):
    monkeypatch.setattr("ciberrato.geometry.nearest_faces._MAX_SQUARES", 20)
    fresh = WallMap.from_lab(Lab(width=50.0, height=50.0))
    for x in range(50):
        assert fresh.touches(x + 0.5, 25.0, 0.6) == (x in (0, 49))
        assert len(fresh.nearby._squares) <= 20


@pytest.mark.parametrize("candidates", [(1, 10_000), (10, 30), (10_000,)])
def test_lists_of_a_square_are_those_of_many_squares_at_once(monkeypatch, clutter, candidates):
    """However many of the nearest faces are looked at first."""
    monkeypatch.setattr("ciberrato.geometry.visible_faces.CANDIDATES", candidates)
    monkeypatch.setattr("ciberrato.geometry.visible_faces.LONGEST", 3)
    views = WallMap.from_lab(clutter).views
    squares = np.indices((30, 24)).reshape(2, -1) - 2
    order, bounds, ahead = views.select(*squares)
    for number, square in enumerate(zip(*squares.tolist(), strict=True)):
        for sector, (faces, reach) in enumerate(views.add(square)):
            chosen = np.flatnonzero(ahead[number, sector])
            expected = [views.all_faces[face][1:] for face in order[number, chosen[:3]]]
            assert [face[1:] for face in faces] == expected[: len(faces)]
            # However few were looked at, what a list lacks is no nearer than it is said to reach.
            lacks = bounds[number, chosen[len(faces)]] if chosen.size > len(faces) else math.inf
            assert reach == pytest.approx(lacks, rel=1e-12) or (reach < lacks and candidates == (10, 30))
            assert len(faces) == len(expected) or candidates == (10, 30)


@given(st.lists(st.integers(0, 5), max_size=30), st.integers(1, 40))
def test_least_values_in_order(values, count):
    found = least(np.array(values, dtype=float), count)
    kept = [values[index] for index in found]
    assert kept == sorted(values)[:count]
    assert all(a != b or i < j for a, b, i, j in zip(kept, kept[1:], found, found[1:], strict=False))


@pytest.mark.parametrize("spread", [1.0, 30.0, 2000.0])
def test_nearest_faces_by_tiles_are_those_of_all(monkeypatch, spread, rng):
    """Short faces and long ones, clusters and empty plains; points beyond them all, too."""
    monkeypatch.setattr("ciberrato.geometry.face_index._FEW", 1000)
    start = np.concatenate((rng.uniform(0.0, 200.0, (2500, 2)), rng.normal(90.0, 1.0, (800, 2))))
    angles, length = rng.uniform(-math.pi, math.pi, len(start)), rng.exponential(0.7, len(start))
    length[:40] *= spread
    direction = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    end = start + length[:, np.newaxis] * direction
    index = FaceIndex(start, end, direction, length)
    looked_at = []
    for x, y in (*rng.uniform(-60.0, 260.0, (60, 2)), (90.0, 90.0), (1e6, -1e6)):
        offset = np.array((x, y)) - start
        along = np.clip((offset * direction).sum(axis=1), 0.0, length)
        gap = offset - along[:, np.newaxis] * direction
        expected = np.sort(np.hypot(gap[:, 0], gap[:, 1]))
        for count in (1, 257, 5000):
            faces, bounds = index.nearest(x, y, count, 0.25)
            assert bounds.tolist() == (expected[:count] - 0.25).tolist()
            assert (np.hypot(*gap[faces].T) - 0.25).tolist() == bounds.tolist()
            assert len({*faces.tolist()}) == min(count, len(start))
        looked_at.append(index._around(x, y, 3)[0].size)
    assert spread > 100.0 or np.median(looked_at) < 0.3 * len(start)


@pytest.mark.parametrize("few", [0, 5000], ids=["tiles", "all"])
def test_more_and_more_of_the_nearest_faces(monkeypatch, few, rng):
    monkeypatch.setattr("ciberrato.geometry.face_index._FEW", few)
    start = rng.uniform(0.0, 60.0, (3000, 2))
    direction, length = np.tile((0.6, 0.8), (3000, 1)), rng.exponential(0.7, 3000)
    index = FaceIndex(start, start + length[:, np.newaxis] * direction, direction, length)
    looks = []
    distances = index._distances
    monkeypatch.setattr(index, "_distances", lambda *place: looks.append(place) or distances(*place))
    found = list(index.growing(20.0, 30.0, (10, 256, 2048), 0.25))
    assert len(looks) == 1 if few else len(looks) >= 3
    for count, (faces, bounds) in zip((10, 256, 2048), found, strict=True):
        expected, limits = index.nearest(20.0, 30.0, count, 0.25)
        assert faces.tolist() == expected.tolist()
        assert bounds.tolist() == limits.tolist()
        assert faces.size == count


def exact_block(a, b, c, d) -> bool:
    """Whether segment a-b meets c-d before b, in exact arithmetic; parallel ones never."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = (tuple(map(Fraction, point)) for point in (a, b, c, d))
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    slope = ux * vy - uy * vx
    if slope == 0:
        return False
    along = ((cx - ax) * vy - (cy - ay) * vx) / slope
    across = ((cx - ax) * uy - (cy - ay) * ux) / slope
    return 0 <= along < 1 and 0 <= across <= 1


def test_blocked_agrees_with_exact_fractions(rng):
    """On a lattice of half units, where most lines of sight pass through corners or along faces."""
    polygons = [
        ((2, 2), (5, 2), (5, 3), (3, 3), (3, 5), (2, 5)),
        ((7, 3), (9, 5), (7, 7)),
        ((4, 6), (6, 6), (5, 7)),
    ]
    walls = WallMap.from_lab(
        Lab(
            width=10.0,
            height=8.0,
            walls=tuple(Wall(corners=tuple((float(x), float(y)) for x, y in p)) for p in polygons),
        )
    )
    faces = [*zip(walls.start.tolist(), walls.end.tolist(), strict=True)]
    ends = rng.integers(0, (21, 17, 21, 17), (800, 4)) / 2.0
    blocked = walls.blocked(*ends.T)
    for (ax, ay, bx, by), found in zip(ends.tolist(), blocked.tolist(), strict=True):
        assert found == any(exact_block((ax, ay), (bx, by), c, d) for c, d in faces), (ax, ay, bx, by)
    assert 0.2 < blocked.mean() < 0.9


def test_one_looks_up_to_a_wall_but_not_through_it():
    walls = WallMap.from_lab(
        Lab(width=10.0, height=8.0, walls=(Wall(corners=((4.0, 0.0), (5.0, 0.0), (5.0, 8.0), (4.0, 8.0))),))
    )
    assert not walls.blocked(1.0, 3.0, 4.0, 3.0)
    assert walls.blocked(1.0, 3.0, 4.001, 3.0)
    assert walls.blocked(4.0, 3.0, 7.0, 3.0)


def test_obstructs_agrees_with_a_disc_pushed_along(clutter, walls, rng):
    x0, y0 = rng.uniform(0.5, 11.5, 300), rng.uniform(0.5, 8.5, 300)
    x1, y1 = x0 + rng.uniform(-2.0, 2.0, 300), y0 + rng.uniform(-2.0, 2.0, 300)
    radius = 0.3
    step = np.linspace(0.0, 1.0, 1001)
    least = walls.distance(
        x0[:, np.newaxis] + step * (x1 - x0)[:, np.newaxis],
        y0[:, np.newaxis] + step * (y1 - y0)[:, np.newaxis],
    ).min(axis=1)
    clear = np.abs(least - radius) > 0.003
    np.testing.assert_array_equal(walls.obstructs(x0, y0, x1, y1, radius)[clear], (least < radius)[clear])
    assert clear.sum() > 250


def test_a_disc_may_graze_but_not_overlap():
    walls = WallMap.from_lab(Lab(width=10.0, height=8.0))
    assert not walls.obstructs(1.0, 0.5, 9.0, 0.5, 0.5)
    assert walls.obstructs(1.0, 0.5, 9.0, 0.499, 0.5)
    assert walls.obstructs(-1.0, 4.0, 1.0, 4.0, 0.5)
    assert not walls.obstructs(5.0, 4.0, 5.0, 4.0, 0.5)


def winding_number(polygon: np.ndarray, x: float, y: float) -> int:
    angles = np.arctan2(polygon[:, 1] - y, polygon[:, 0] - x)
    turns = np.roll(angles, -1) - angles
    return round(float((turns - 2 * np.pi * np.round(turns / (2 * np.pi))).sum() / (2 * np.pi)))


def test_point_in_polygons_agrees_with_winding_numbers(clutter, walls, rng):
    x, y = rng.uniform(-1.0, 13.0, 500), rng.uniform(-1.0, 10.0, 500)
    polygons = [np.array(wall.corners) for wall in clutter.walls]
    expected = [
        any(winding_number(polygon, *point) for polygon in polygons) for point in zip(x, y, strict=True)
    ]
    inside = walls.point_in_polygons(x, y)
    np.testing.assert_array_equal(inside, expected)
    assert inside.any()
    assert not inside.all()


def test_a_lab_without_walls_has_no_point_inside():
    assert not WallMap.from_lab(Lab()).point_in_polygons(8.0, 8.0)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda walls: pickle.loads(pickle.dumps(walls))])
def test_copies_work(again, walls):
    walls.touches(1.0, 1.0, 0.5)
    np.testing.assert_array_equal(again(walls).distance([1.0, 2.0], 3.0), walls.distance([1.0, 2.0], 3.0))


def test_every_lab_that_ships_has_an_open_middle(shipped):
    for name in names("lab"):
        walls = shipped(name)
        x, y = np.meshgrid(np.arange(1.0, walls.width, 2.0), np.arange(1.0, walls.height, 2.0))
        assert (walls.distance(x, y) > 0.5).mean() > 0.5
