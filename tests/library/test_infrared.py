"""IR distances against the real simulator's angle rules, dense samples, and figures worked out by hand."""

from __future__ import annotations

import gzip
import math

import numpy as np
import pytest

from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.cone_arrays import many_cone_distances
from ciberrato.infrared.cone_scalar import single_cone_distances
from ciberrato.infrared.face_tables import LabTables
from ciberrato.infrared.model import (
    HALF_APERTURE,
    SENSOR_OFFSET,
    distances_at,
    ideal_reading,
    nearest_in_cone,
    other_robot_distance,
    round_reading,
    sensor_distances,
)
from ciberrato.infrared.on_face import distance_by_angles
from ciberrato.labs import names
from ciberrato.physics.kinematics import wrap_angle
from ciberrato.world.lab import Lab, Wall

SPACING = 0.002


def poses(walls: WallMap, rng: np.random.Generator, count: int):
    """Random poses, some of them beyond the border."""
    return (
        rng.uniform(-1.0, walls.width + 1.0, count),
        rng.uniform(-1.0, walls.height + 1.0, count),
        rng.uniform(-math.pi, math.pi, count),
    )


def by_angles(walls: WallMap, x, y, direction) -> np.ndarray:
    return np.array(
        [
            distance_by_angles(
                walls.nearby,
                px + SENSOR_OFFSET * math.cos(axis),
                py + SENSOR_OFFSET * math.sin(axis),
                wrap_angle(axis),
            )
            for px, py, axis in zip(*(np.asarray(v).tolist() for v in (x, y, direction)), strict=True)
        ]
    )


@pytest.mark.parametrize("name", names("lab"))
def test_rays_and_corners_agree_with_the_angle_rules(shipped, rng, name):
    walls = shipped(name)
    x, y, direction = poses(walls, rng, 300)
    np.testing.assert_allclose(
        sensor_distances(walls, x, y, direction), by_angles(walls, x, y, direction), rtol=1e-9
    )


def test_slanted_and_overlapping_walls_agree_with_the_angle_rules(clutter, rng):
    walls = WallMap.from_lab(clutter)
    x, y, direction = poses(walls, rng, 1000)
    np.testing.assert_allclose(
        sensor_distances(walls, x, y, direction), by_angles(walls, x, y, direction), rtol=1e-9
    )


@pytest.mark.parametrize("name", ["standard", "rooms", "diagonals"])
def test_on_a_lattice_rays_through_corners_and_along_faces_agree_with_the_angle_rules(shipped, rng, name):
    walls = shipped(name)
    x, y = rng.integers(1, 56, 600) / 2.0, rng.integers(1, 28, 600) / 2.0
    direction = wrap_angle(rng.integers(-12, 12, 600) * 15.0 * math.pi / 180.0)
    expected = by_angles(walls, x, y, direction)
    np.testing.assert_allclose(sensor_distances(walls, x, y, direction), expected, rtol=0, atol=1e-12)
    single = [
        distances_at(walls, px, py, [axis])[0]
        for px, py, axis in zip(x.tolist(), y.tolist(), direction.tolist(), strict=True)
    ]
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", names("lab"))
def test_one_robot_and_many_agree(shipped, rng, name):
    walls = shipped(name)
    x, y, heading = poses(walls, rng, 200)
    directions = heading[:, np.newaxis] + np.array([0.0, 1.0, -1.0, 3.0])
    many = sensor_distances(walls, x[:, np.newaxis], y[:, np.newaxis], directions)
    single = [
        distances_at(walls, *pose) for pose in zip(x.tolist(), y.tolist(), directions.tolist(), strict=True)
    ]
    np.testing.assert_allclose(single, many, rtol=1e-12)


def test_one_robot_sees_beyond_the_list_of_near_faces(monkeypatch, clutter, rng):
    monkeypatch.setattr("ciberrato.geometry.visible_faces.LONGEST", 4)
    walls = WallMap.from_lab(clutter)
    x, y, direction = poses(walls, rng, 100)
    single = [
        distances_at(walls, px, py, [axis])[0]
        for px, py, axis in zip(x.tolist(), y.tolist(), direction.tolist(), strict=True)
    ]
    np.testing.assert_allclose(single, sensor_distances(walls, x, y, direction), rtol=1e-12)


@pytest.mark.parametrize("candidates", [(20, 50), (5,), (500,)])
def test_tables_of_the_nearest_faces_only_see_as_far(monkeypatch, clutter, rng, candidates):
    """As in labs of very many faces."""
    monkeypatch.setattr("ciberrato.infrared.face_tables._MOST_FACES", 10)
    monkeypatch.setattr("ciberrato.geometry.visible_faces.CANDIDATES", candidates)
    x, y, direction = poses(WallMap.from_lab(clutter), rng, 300)
    axes = direction, np.cos(direction), np.sin(direction)
    expected = [
        single_cone_distances(WallMap.from_lab(clutter), *pose, 0.0)[0]
        for pose in zip(x.tolist(), y.tolist(), direction[:, np.newaxis].tolist(), strict=True)
    ]
    tables = LabTables(WallMap.from_lab(clutter))
    many = many_cone_distances(tables, x, y, *axes)
    np.testing.assert_allclose(many, expected, rtol=1e-12)
    rows = tables.rows_at(x, y)
    assert (tables.touched_count[rows[rows >= 0]] > 0).any()


def test_a_sensor_on_a_face_follows_the_angle_rules(shipped):
    """On the lattice of cell centres and half-way points, axis by axis, many sensors of `rooms` lie on a
    face."""
    walls = shipped("rooms")
    x, y, direction = (
        v.ravel()
        for v in np.meshgrid(
            np.arange(0.5, 28.0, 0.5), np.arange(0.5, 14.0, 0.5), np.arange(-2, 3) * (math.pi / 2)
        )
    )
    sensor_x, sensor_y = x + SENSOR_OFFSET * np.cos(direction), y + SENSOR_OFFSET * np.sin(direction)
    on_face = walls.distance(sensor_x, sensor_y) == 0.0
    assert on_face.sum() > 500
    x, y, direction = x[on_face], y[on_face], direction[on_face]
    expected = by_angles(walls, x, y, direction)
    np.testing.assert_array_equal(sensor_distances(walls, x, y, direction), expected)
    single = [
        distances_at(walls, px, py, [axis])[0]
        for px, py, axis in zip(x.tolist(), y.tolist(), direction.tolist(), strict=True)
    ]
    np.testing.assert_array_equal(single, expected)
    # Some look through the wall, which no geometry would have them do.
    assert 0.0 < (expected > 0.1).mean() < 1.0
    np.testing.assert_array_equal(nearest_in_cone(walls, x, y, direction), 0.0)


def samples(lab: Lab) -> np.ndarray:
    points = []
    for wall in (lab.border, *lab.walls):
        if wall.height > 0.0:
            corners = np.array(wall.corners)
            for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                count = int(np.hypot(*(end - start)) / SPACING) + 2
                points.append(start + np.linspace(0.0, 1.0, count)[:, np.newaxis] * (end - start))
    return np.concatenate(points)


def test_nearest_in_cone_is_the_nearest_of_dense_samples(clutter, rng):
    walls = WallMap.from_lab(clutter)
    points = samples(clutter)
    x, y, direction = poses(walls, rng, 150)
    nearest = nearest_in_cone(walls, x, y, direction)
    for px, py, axis, found in zip(x, y, direction, nearest, strict=True):
        dx = points[:, 0] - (px + SENSOR_OFFSET * math.cos(axis))
        dy = points[:, 1] - (py + SENSOR_OFFSET * math.sin(axis))
        away = np.hypot(dx, dy)
        aside = np.abs(wrap_angle(np.arctan2(dy, dx) - axis))
        inside = away[aside <= HALF_APERTURE].min(initial=np.inf)
        # A cone a little wider holds a sample for every point of the true one.
        with np.errstate(divide="ignore"):
            wider = away[aside <= HALF_APERTURE + SPACING / away].min(initial=np.inf)
        assert wider - SPACING <= found <= inside + 1e-12


@pytest.mark.parametrize("name", ["standard", "maze", "corridors", "twins", "wide", "open"])
def test_both_models_agree_where_walls_and_sensor_are_aligned(shipped, rng, name):
    walls = shipped(name)
    x, y, _ = poses(walls, rng, 400)
    direction = rng.integers(-2, 3, 400) * (math.pi / 2)
    sensor = sensor_distances(walls, x, y, direction)
    np.testing.assert_allclose(nearest_in_cone(walls, x, y, direction), sensor, rtol=1e-12)


def test_the_true_nearest_point_is_never_farther(shipped, rng):
    for name in names("lab"):
        walls = shipped(name)
        x, y, direction = poses(walls, rng, 500)
        nearest, sensor = (model(walls, x, y, direction) for model in (nearest_in_cone, sensor_distances))
        assert (nearest <= sensor + 1e-12).all()
        if name in ("diagonals", "rooms"):
            assert (nearest < sensor - 0.01).any()


def test_distances_worked_out_by_hand():
    lab = Lab(width=10.0, height=8.0, walls=(Wall(corners=((6.0, 3.0), (7.0, 3.0), (7.0, 5.0), (6.0, 5.0))),))
    walls = WallMap.from_lab(lab)
    # Ahead of a robot at (3, 4): the wall's face at x = 6, seen from x = 3.5.
    assert float(sensor_distances(walls, 3.0, 4.0, 0.0)) == pytest.approx(2.5, abs=1e-15)
    # To the left the border is at y = 8, seen from y = 4.5; nothing else is in the cone.
    assert float(sensor_distances(walls, 3.0, 4.0, math.pi / 2)) == pytest.approx(3.5, abs=1e-15)
    # At y = 6 the axis passes the wall, whose corner (6, 5) is at atan(1 / 2.5) < 30 degrees.
    assert float(sensor_distances(walls, 3.0, 6.0, 0.0)) == pytest.approx(math.hypot(2.5, 1.0), abs=1e-15)
    # Backwards, from (9, 4): the far face, and from just in front of it the corner behind is not in sight.
    assert float(sensor_distances(walls, 9.0, 4.0, math.pi)) == pytest.approx(1.5, abs=1e-15)


def test_a_hidden_corner_counts():
    """A corner just behind a thin wall is nearer than where the rays hit that wall."""
    front = Wall(corners=((6.0, 0.5), (6.01, 0.5), (6.01, 9.5), (6.0, 9.5)))
    behind = Wall(corners=((6.02, 5.0), (7.0, 4.5), (7.0, 5.5)))
    direction = math.radians(15.0)
    x, y = 5.0 - SENSOR_OFFSET * math.cos(direction), 5.0 - SENSOR_OFFSET * math.sin(direction)
    for walls, expected in (((front,), 1.0 / math.cos(direction)), ((front, behind), 1.02)):
        built = WallMap.from_lab(Lab(width=12.0, height=10.0, walls=walls))
        assert float(sensor_distances(built, x, y, direction)) == pytest.approx(expected)
        assert distances_at(built, x, y, [direction]) == pytest.approx([expected])
        assert float(nearest_in_cone(built, x, y, direction)) == pytest.approx(1.0)


def test_shapes_broadcast(shipped):
    walls = shipped("standard")
    result = sensor_distances(walls, np.ones((3, 1)), 1.0, np.zeros(5))
    assert result.shape == (3, 5)
    assert sensor_distances(walls, 1.0, 1.0, 0.0).shape == ()
    assert nearest_in_cone(walls, np.zeros((0, 4)), 1.0, 0.0).shape == (0, 4)


def test_many_sensors_are_worked_on_in_blocks(shipped, rng):
    walls = shipped("maze")
    x, y, direction = poses(walls, rng, 1500)
    together = sensor_distances(walls, x, y, direction)
    one_by_one = [
        float(sensor_distances(walls, *pose)) for pose in zip(x[::50], y[::50], direction[::50], strict=True)
    ]
    np.testing.assert_array_equal(together[::50], one_by_one)


def test_nothing_in_sight_is_infinitely_far():
    walls = WallMap.from_lab(Lab(width=10.0, height=8.0))
    assert float(sensor_distances(walls, 12.0, 4.0, 0.0)) == math.inf
    assert distances_at(walls, 12.0, 4.0, [0.0]) == [math.inf]
    assert WallMap.from_lab(Lab(), at_least=99.0).start.shape == (0, 2)
    assert float(sensor_distances(WallMap.from_lab(Lab(), at_least=99.0), 1.0, 1.0, 0.0)) == math.inf


def test_other_robots_against_dense_samples_of_the_disc(rng):
    """The distance is that of the nearest point of the disc in the cone."""
    radius, angle = np.meshgrid(np.linspace(0.0, 0.5, 60), np.linspace(0.0, 2 * np.pi, 720))
    disc = np.column_stack(((radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()))
    seen = 0
    for _ in range(150):
        other_x, other_y = rng.uniform(-3.0, 3.0, 2)
        direction = float(rng.uniform(-math.pi, math.pi))
        dx = other_x + disc[:, 0] - SENSOR_OFFSET * math.cos(direction)
        dy = other_y + disc[:, 1] - SENSOR_OFFSET * math.sin(direction)
        away = np.hypot(dx, dy)
        aside = np.abs(wrap_angle(np.arctan2(dy, dx) - direction))
        sampled = away[aside <= HALF_APERTURE].min(initial=np.inf)
        found = other_robot_distance(0.0, 0.0, direction, other_x, other_y)
        inside = math.hypot(dx[0] - disc[0, 0], dy[0] - disc[0, 1]) <= 0.5
        if inside:
            assert found == 0.0
        elif math.isinf(sampled):
            # The samples may just miss a disc that the cone's edge grazes.
            assert found == math.inf or found > 0.1
        else:
            assert found == pytest.approx(sampled, abs=0.03)
            seen += 1
    assert seen > 20


def test_another_robot_worked_out_by_hand():
    assert other_robot_distance(0.0, 0.0, 0.0, 3.0, 0.0) == pytest.approx(2.0)
    assert other_robot_distance(0.0, 0.0, math.pi, 3.0, 0.0) == math.inf
    assert other_robot_distance(0.0, 0.0, 0.0, 0.6, 0.0) == 0.0
    # The disc's edge just touches the cone's: seen; a little farther aside: not.
    edge = HALF_APERTURE + math.asin(0.5 / 2.0)
    for beyond, seen in ((-1e-6, True), (1e-6, False)):
        x, y = 0.5 + 2.0 * math.cos(edge + beyond), 2.0 * math.sin(edge + beyond)
        assert math.isfinite(other_robot_distance(0.0, 0.0, 0.0, x, y)) == seen


@pytest.mark.parametrize(
    ("distance", "reading"),
    [(2.0, 0.5), (0.01, 100.0), (0.010001, 1 / 0.010001), (0.0, 100.0), (math.inf, 100.0), (50.0, 0.02)],
)
def test_ideal_reading(distance, reading):
    assert ideal_reading(distance) == reading
    np.testing.assert_array_equal(ideal_reading(np.array([distance])), [reading])


@pytest.mark.parametrize(
    ("value", "rounded"),
    [(0.05, 0.1), (0.0499, 0.0), (-0.05, 0.0), (-0.051, -0.1), (99.96, 100.0), (2.25, 2.3), (123.44, 123.4)],
)
def test_round_reading(value, rounded):
    assert round_reading(value) == rounded
    np.testing.assert_array_equal(round_reading(np.array([value])), [rounded])


def test_readings_of_a_robot_that_saw_another(golden):
    """Rounded outputs of the real simulator, text to text."""
    with gzip.open(golden / "ir/other_robots.csv.gz", "rt", encoding="utf-8") as lines:
        header = next(lines).strip().split(",")
        ideal, rounded = header.index("ideal_with_other"), header.index("ir_value_noise0")
        for line in lines:
            fields = line.split(",")
            assert round_reading(float(fields[ideal])) == float(fields[rounded])
