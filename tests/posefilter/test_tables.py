from __future__ import annotations

import dataclasses
import math
import os
import tempfile
import threading
from statistics import NormalDist

import numpy as np
import pytest

from ciberrato.files.lab import read_lab
from ciberrato.geometry.tiles import wall_distances
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, reading_log_likelihood, sensor_distances
from ciberrato.infrared.sweep import tabulate_distances
from ciberrato.labs import find_lab
from ciberrato.localization.belief.lattice import build_lattice
from ciberrato.localization.tables.cache import cached_tables, read_tables, table_key, write_tables
from ciberrato.localization.tables.pose_tables import BINS, COARSE, FINE, build_tables, fine_resolution
from ciberrato.localization.tables.reading_codes import ReadingCodes, code_distances, encode
from ciberrato.localization.tables.worker import TableWorker
from ciberrato.world.lab import Lab, Wall


def test_distances_equal_those_of_the_sensor_model(small_lab):
    walls = WallMap.from_lab(small_lab)
    lattice = build_lattice(small_lab, 2.0 / 9.0)
    directions = np.deg2rad(np.arange(0.0, 360.0, 7.5) + 0.3)
    table = tabulate_distances(walls, lattice.representative, math.radians(0.3), 48)
    places = lattice.representative
    expected = sensor_distances(walls, places[:, 0], places[:, 1], directions[:, np.newaxis])
    assert table == pytest.approx(expected, abs=1e-9)


def _random_lab(seed):
    """Return a lab of turned boxes, triangles and L-shaped walls; some overlap or touch the border."""
    generator = np.random.default_rng(seed)
    shapes = (
        [(-1, -0.1), (1, -0.1), (1, 0.1), (-1, 0.1)],
        [(-0.6, -0.5), (0.7, -0.3), (0.1, 0.6)],
        [(0, 0), (1.2, 0), (1.2, 0.2), (0.2, 0.2), (0.2, 1.2), (0, 1.2)],
    )
    walls = []
    for number in range(12):
        angle, (x, y) = generator.uniform(0, 6.3), generator.uniform(0, (12, 8))
        corners = [
            (x + math.cos(angle) * a - math.sin(angle) * b, y + math.sin(angle) * a + math.cos(angle) * b)
            for a, b in shapes[number % 3]
        ]
        walls.append(Wall(height=4.0, corners=tuple(corners[:: 1 if number % 2 else -1])))
    return Lab(name="random", width=12.0, height=8.0, walls=tuple(walls))


@pytest.mark.parametrize("compiled", [False, True], ids=["numpy", "numba"])
@pytest.mark.parametrize("seed", [1, 2, 3, None])
def test_distances_among_walls_of_all_kinds_equal_those_of_the_sensor_model(seed, compiled):
    loops = None
    if compiled:
        pytest.importorskip("numba")
        from ciberrato.localization.belief import kernels as loops
    lab = read_lab(find_lab("diagonals")) if seed is None else _random_lab(seed)
    walls = WallMap.from_lab(lab)
    places = build_lattice(lab, 2.0 / 9.0).representative[:: 7 if seed is None else 1]
    first = 0.0 if seed is None else 0.0123 * seed
    table = tabulate_distances(walls, places, first, 72, loops=loops)
    directions = first + np.arange(72) * math.radians(5.0)
    expected = sensor_distances(walls, places[:, 0], places[:, 1], directions[:, np.newaxis])
    # An edge just grazed may count for one of the two and not for the other.
    assert np.mean(np.abs(table - expected) > 1e-9) < (0.002 if seed is None else 1e-9)
    plain = tabulate_distances(walls, places, first, 72)
    assert np.array_equal(table, plain)
    assert np.array_equal(
        tabulate_distances(walls, places, first, 72, loops=loops, convert=encode), encode(plain)
    )


def test_codes_begin_where_the_formula_says():
    generator = np.random.default_rng(5)
    distances = np.concatenate(
        [np.exp(generator.uniform(math.log(1e-3), math.log(100.0), 200_000)), code_distances()]
    )
    low, high = math.asinh(1.0 / 40.0), math.asinh(100.0)
    reading = np.minimum(1.0 / distances, 100.0)
    position = np.round((np.arcsinh(reading) - low) / (high - low) * 255, 7)
    assert np.array_equal(encode(distances), np.clip(np.floor(position + 0.5), 0, 255))
    # Around every step, to the last bit.
    coded = encode(np.sort(distances))
    assert (np.diff(coded.astype(int)) <= 0).all()
    assert encode(np.array([-0.0, -1.0, np.nan, np.inf, 1e300, 5e-324])).tolist() == [255] * 4 + [0, 255]


@pytest.mark.parametrize("seed", [1, 2])
def test_wall_distances_of_many_places_are_those_of_each(seed):
    walls = WallMap.from_lab(_random_lab(seed))
    places = np.random.default_rng(seed).uniform((-6, -6), (18, 14), (3000, 2))
    for tile in (0.5, 2.0, 40.0):
        assert np.array_equal(wall_distances(walls, places, tile), walls.distance(*places.T))
    assert wall_distances(walls, places[:0]).shape == (0,)


def test_points_in_polygons_are_the_same_many_at_once_and_one_at_a_time():
    walls = WallMap.from_lab(_random_lab(4))
    x, y = np.random.default_rng(4).uniform((0, 0), (12, 8), (2000, 2)).T
    inside = walls.point_in_polygons(x, y)
    assert 0 < inside.sum() < 2000
    assert inside.tolist() == [bool(walls.point_in_polygons(*place)) for place in zip(x, y, strict=True)]


def test_the_lattice_keeps_exactly_the_squares_with_free_poses(small_lab):
    lattice = build_lattice(small_lab, 0.1)
    walls = WallMap.from_lab(small_lab)
    assert walls.distance(*lattice.representative.T).min() >= 0.5 - 1e-6
    kept = {(round(x, 3), round(y, 3)) for x, y in zip(lattice.x, lattice.y, strict=True)}
    generator = np.random.default_rng(3)
    x, y = generator.uniform(0.5, 7.5, 3000), generator.uniform(0.5, 5.5, 3000)
    inside = walls.point_in_polygons(x, y)
    for px, py in zip(x[~inside], y[~inside], strict=True):
        if walls.distance(px, py) >= 0.5:
            node = (round(round((px - 1) / 0.1) * 0.1 + 1, 3), round(round((py - 1) / 0.1) * 0.1 + 1, 3))
            assert node in kept


def test_cell_centres_are_nodes_of_both_lattices(small_lab):
    for resolution in (2.0 / 9.0, 0.1):
        lattice = build_lattice(small_lab, resolution)
        for x, y in ((1.0, 1.0), (7.0, 5.0), (3.0, 3.0)):
            assert np.hypot(lattice.x - x, lattice.y - y).min() < 1e-9


def test_rows_that_look_alike_get_identical_tables():
    lab = read_lab(find_lab("twins"))
    tables = build_tables(lab, (0.0, 60.0, -60.0, 180.0), 2.0 / 9.0, steps=1)
    lattice = tables.lattice
    rows = [np.flatnonzero(np.abs(lattice.y - y) < 1.0 + 1e-9) for y in (3.0, 11.0)]
    assert len(rows[0]) == len(rows[1]) > 100
    assert np.array_equal(tables.codes[0][:, rows[0]], tables.codes[0][:, rows[1]])


def test_neighbours_are_the_squares_beside(fine_tables):
    lattice = fine_tables.lattice
    for dx, dy in ((1, 0), (0, -1), (2, 2)):
        other = lattice.neighbours(dx, dy)
        free = other < lattice.size
        assert lattice.x[other[free]] == pytest.approx(lattice.x[free] + dx * 0.1)
        assert lattice.y[other[free]] == pytest.approx(lattice.y[free] + dy * 0.1)
        places = {(round(x, 3), round(y, 3)) for x, y in zip(lattice.x, lattice.y, strict=True)}
        for x, y in zip(lattice.x[~free], lattice.y[~free], strict=True):
            assert (round(x + dx * 0.1, 3), round(y + dy * 0.1, 3)) not in places


def test_views_give_the_code_of_each_sensor_at_the_nearest_direction(small_lab, fine_tables):
    lattice, walls = fine_tables.lattice, WallMap.from_lab(small_lab)
    offset = math.radians(-3.6)  # -2.5 is the nearest direction
    square = int(np.hypot(lattice.x - 3.0, lattice.y - 1.0).argmin())
    for sensor, angle in enumerate((0.0, 60.0, -60.0, 180.0)):
        for row in (0, 17, 71):
            direction = math.radians(5.0 * row - 2.5 + angle)
            distance = sensor_distances(walls, 3.0, 1.0, direction)
            code = fine_tables.view(sensor, offset)[row, square]
            assert code == encode(np.asarray(distance))
    assert fine_tables.view(0, offset).shape == (BINS, lattice.size)


def test_sensors_between_the_directions_get_tables_of_their_own(small_lab):
    walls = WallMap.from_lab(small_lab)
    tables = build_tables(small_lab, (0.0, 61.0, -61.0, 180.0), 2.0 / 9.0, steps=1)
    assert len(tables.codes) == 3
    square = int(np.hypot(tables.lattice.x - 3.0, tables.lattice.y - 1.0).argmin())
    for sensor, angle in ((1, 61.0), (2, -61.0)):
        distance = sensor_distances(walls, 3.0, 1.0, math.radians(30.0 + angle))
        assert tables.view(sensor, 0.0)[6, square] == encode(np.asarray(distance))


def test_codes_are_as_fine_as_readings_are_noisy():
    distances = code_distances()
    assert np.array_equal(encode(distances), np.arange(256))
    readings = 1.0 / distances
    near_one = np.abs(readings - 1.0).argmin()
    assert np.diff(readings)[near_one] < 0.1 / 2
    assert encode(np.array([np.inf, 0.0, 1000.0])).tolist() == [255, 255, 0]


def test_the_likelihood_of_a_square_is_the_mean_over_its_distances():
    codes = ReadingCodes(noise=0.1, place=0.15, turn=0.05, outlier=1e-9)
    distance = code_distances()
    quantiles = np.array([NormalDist().inv_cdf((k + 0.5) / 400) for k in range(400)])[:, np.newaxis]
    for reading in (0.4, 2.0, 6.3):
        spread = np.sqrt((0.15**2 + (0.05 * distance) ** 2) / 12.0)
        samples = np.maximum(distance + spread * quantiles, 1e-3)
        mass = np.exp(reading_log_likelihood(reading, ideal_reading(samples), 0.1)).mean(axis=0)
        got = np.exp(codes.log_likelihood(reading))
        likely = mass > 0.2 * mass.max()  # the tails are for the outliers
        assert got[likely] == pytest.approx((mass / mass.max())[likely], rel=0.15, abs=0.02)


def test_no_reading_rules_a_state_out():
    codes = ReadingCodes(noise=0.1, place=0.15, turn=0.05, outlier=0.02)
    for reading in (-0.3, 0.0, 1.0, 57.0, 130.0):
        assert np.isfinite(codes.log_likelihood(reading)).all()


def test_tables_come_back_from_disk_as_they_were(small_lab, coarse_tables, tmp_path):
    path = tmp_path / "below" / "tables.npz"
    write_tables(path, coarse_tables)
    back = read_tables(path)
    assert back is not None
    assert np.array_equal(back.codes[0], coarse_tables.codes[0])
    assert back.sensors == coarse_tables.sensors
    for field in dataclasses.fields(coarse_tables.lattice):
        if field.compare and not field.name.startswith("_"):
            assert np.array_equal(
                getattr(back.lattice, field.name), getattr(coarse_tables.lattice, field.name)
            ), field.name


def test_symmetries_and_shares_of_codes_come_back_from_disk(tmp_path):
    square = Lab(width=12.0, height=12.0, walls=())
    first = cached_tables(square, (0.0,), 0.5, steps=1, folder=tmp_path)
    path = next(tmp_path.glob("*.npz"))
    back = read_tables(path)
    assert back is not None
    assert not back.complete(square)
    assert back.known_turns == first.symmetries(square)
    assert len(back.symmetries(square)) >= 2  # by 90 and 270 degrees
    counts = np.bincount(first.codes[0][:BINS].ravel(), minlength=256)
    assert np.array_equal(back.code_shares[0], counts / counts.sum())
    write_tables(path, dataclasses.replace(first, _turns=[], _shares=[]))  # as an older program left it
    again = cached_tables(square, (0.0,), 0.5, steps=1, folder=tmp_path)
    assert again.symmetries(square) == first.symmetries(square)
    assert not read_tables(path).complete(square)


def _another_lab(path, tables):
    write_tables(path.with_name("pose-tables-of-another-lab.npz"), tables)
    path.with_name("pose-tables-of-another-lab.npz").replace(path)


def _off_by_one(path, tables):
    index = tables.lattice.index + 1
    write_tables(path, dataclasses.replace(tables, lattice=dataclasses.replace(tables.lattice, index=index)))


def _too_short(path, tables):
    write_tables(path, dataclasses.replace(tables, codes=tuple(codes[:, :-1] for codes in tables.codes)))


def _other_numbers(path, tables):
    nodes = np.full_like(tables.lattice.x, np.nan)
    write_tables(path, dataclasses.replace(tables, lattice=dataclasses.replace(tables.lattice, x=nodes)))


def _one_byte(path, tables):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)


def _huge(path, tables):
    data = path.read_bytes()
    at = data.index(b"'shape': (")
    end = data.index(b"\n", at)
    shape = b"'shape': (99999999999,), }"
    path.write_bytes(data[:at] + shape + b" " * (end - at - len(shape)) + data[end:])


def _pickled(path, tables):
    np.savez(path, grid=np.array([{}], dtype=object))


def _folder(path, tables):
    path.unlink()
    (path / "full").mkdir(parents=True)


def _pipe(path, tables):
    path.unlink()
    os.mkfifo(path)


def _loop(path, tables):
    path.unlink()
    path.symlink_to(path.name)


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(lambda path, _: path.write_bytes(b""), id="empty"),
        pytest.param(lambda path, _: path.write_bytes(b"no archive"), id="text"),
        pytest.param(lambda path, _: path.write_bytes(b"PK\3\4" + bytes(200)), id="zeros"),
        pytest.param(lambda path, _: path.write_bytes(path.read_bytes()[:-300]), id="torn"),
        pytest.param(lambda path, _: path.write_bytes(b"\x93NUMPY" + bytes(100)), id="one array"),
        *(
            pytest.param(damage, id=damage.__name__.strip("_"))
            for damage in (
                *(_another_lab, _off_by_one, _too_short, _other_numbers, _one_byte),
                *(_huge, _pickled, _folder, _pipe, _loop),
            )
        ),
    ],
)
def test_a_damaged_file_is_computed_again(small_lab, tmp_path, damage):
    tables = cached_tables(small_lab, (0.0,), 0.5, steps=1, folder=tmp_path)
    path = next(tmp_path.glob("*.npz"))
    damage(path, tables)
    assert read_tables(path) is None
    again = cached_tables(small_lab, (0.0,), 0.5, steps=1, folder=tmp_path)
    assert np.array_equal(again.codes[0], tables.codes[0])
    assert read_tables(path) is not None
    assert [one.name for one in tmp_path.iterdir() if one.name.startswith(".")] == []


def test_the_key_changes_with_what_the_tables_depend_on(small_lab):
    key = table_key(small_lab, (0.0, 90.0), 0.1, 2)
    assert key == table_key(dataclasses.replace(small_lab, name="other"), (0.0, 90.0), 0.1, 2)
    assert key != table_key(small_lab, (0.0, 91.0), 0.1, 2)
    assert key != table_key(small_lab, (0.0, 90.0), 0.2, 2)
    assert key != table_key(dataclasses.replace(small_lab, walls=small_lab.walls[1:]), (0.0, 90.0), 0.1, 2)


def test_the_worker_computes_in_another_process_and_keeps_the_tables(small_lab, tmp_path):
    seen = []
    worker = TableWorker(
        small_lab, (0.0,), coarse=0.5, fine=0.25, folder=tmp_path, progress=lambda *step: seen.append(step)
    )
    worker.start()
    assert worker.wait(300.0)
    assert worker.error is None
    assert worker.fine is not None
    expected = build_tables(small_lab, (0.0,), 0.25)
    assert np.array_equal(worker.fine.codes[0], expected.codes[0])
    assert [which for which, _ in seen] == sorted(which for which, _ in seen)
    assert seen[-1] == ("fine", 1.0)
    assert 0.0 < worker.seconds["coarse"] < worker.seconds["fine"]
    assert 10.0 < worker.megabytes < 2000.0
    assert len(list(tmp_path.glob("*.npz"))) == 2


def test_machine_code_is_loaded_for_tables_that_are_there_sooner_with_it(small_lab, monkeypatch):
    from ciberrato.localization.belief import compiled
    from ciberrato.localization.tables.build import _is_worth_loading

    large = dataclasses.replace(small_lab, width=60.0, height=30.0)
    for at_hand in (True, False):  # where it is still being compiled nothing waits for it
        monkeypatch.setattr(compiled, "at_hand", lambda at_hand=at_hand: at_hand)
        for wanted, expected in (("auto", [False, True]), ("off", [False, False]), ("on", [True, True])):
            monkeypatch.setattr(compiled, "choice", lambda wanted=wanted: wanted)
            assert [_is_worth_loading(lab) for lab in (small_lab, large)] == [
                at_hand and one for one in expected
            ]


def test_a_lab_too_large_for_the_fine_lattice_has_coarse_tables_only(small_lab, tmp_path, monkeypatch):
    assert fine_resolution(read_lab(find_lab("wide"))) == FINE
    assert fine_resolution(dataclasses.replace(small_lab, width=60.0, height=50.0)) == COARSE
    monkeypatch.setattr("ciberrato.localization.tables.pose_tables._LARGEST", 1.0)
    worker = TableWorker(small_lab, (0.0,), folder=tmp_path)
    worker.start()
    assert worker.wait(300.0)
    assert worker.error is None
    assert worker.coarse is not None
    assert worker.fine is None


@pytest.mark.parametrize("keeps", [True, False])
def test_a_worker_that_is_stopped_leaves_no_scratch_folder(small_lab, tmp_path, monkeypatch, keeps):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    cache = tmp_path / "cache"
    if not keeps:
        cache.write_text("a file where the folder would be", encoding="utf-8")
    begun = threading.Event()
    computed = []

    def progress(which, done):
        computed.append(done)
        begun.set()

    worker = TableWorker(
        small_lab, (0.0,), coarse=0.02, fine=0.01, folder=cache / "tables", progress=progress
    )
    worker.start()
    assert begun.wait(300.0)
    # What it computes in is there while it computes, and only where nothing can be kept.
    assert len(list(scratch.iterdir())) == (0 if keeps else 1)
    worker.stop()
    worker.join_processes()
    assert list(scratch.iterdir()) == []
    assert worker.coarse is None
    assert computed.count(1.0) <= 1
