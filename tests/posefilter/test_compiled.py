"""With numba or without: the same numbers to the last bit."""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys

import numpy as np
import pytest

from ciberrato import machine_code
from ciberrato.errors import UsageError
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.face_tables import LabTables
from ciberrato.labs import find_lab
from ciberrato.localization.belief import compiled
from ciberrato.localization.belief.lattice import distances_to_walls, nearest_walls
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.belief.reweight import multiply
from ciberrato.localization.evidence.symmetry import find_turns
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.refinement.cones import cone_distances
from ciberrato.localization.tables.pose_tables import build_tables
from ciberrato.localization.tables.reading_codes import encode
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)


@pytest.fixture(scope="module")
def loops():
    pytest.importorskip("numba")
    assert compiled.load()
    module = compiled.kernels()
    compiled.use(None)
    yield module
    compiled.use(None)


def with_and_without(loops, work):
    results = []
    for module in (None, loops):
        compiled.use(module)
        try:
            results.append(work())
        finally:
            compiled.use(None)
    return results


def assert_same_belief(one, other):
    assert (one.dense is None) == (other.dense is None)
    if one.dense is None:
        for name in ("bin", "square", "weight"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name
        assert one.weight.dtype == other.weight.dtype == np.float32
    else:
        assert np.array_equal(one.dense, other.dense)
    assert np.array_equal(one.offset, other.offset)
    assert one.given_up == other.given_up


@pytest.mark.parametrize("sparse", [False, True])
def test_every_operation_gives_the_same_numbers(loops, coarse_tables, sparse):
    def work():
        generator = np.random.default_rng(4)
        belief = PoseBelief(coarse_tables.lattice, prune=1e-4 if sparse else 1e-9)
        belief.dense[:, :-1] *= generator.random((72, coarse_tables.lattice.size), np.float32) ** 3
        if sparse:
            belief.dense[generator.random(belief.dense.shape) < 0.95] = 0.0
            belief.prune()
        assert (belief.dense is None) == sparse
        moved = 0
        for step in range(40):
            table = [np.exp(generator.normal(0.0, 0.3, 256)).astype(np.float32) for _ in range(4)]
            factors = [(coarse_tables.view(k, belief.heading_offset), table[k]) for k in range(4)]
            by_bin = None if step % 2 else np.linspace(0.7, 1.3, 72, dtype=np.float32)
            before = belief.offset.copy()
            belief.drive(generator.normal(0.0, 0.1), stay_if_blocked=step % 3 == 0)
            moved += int((np.abs(belief.offset - before) > 0.1).any())
            belief.turn(generator.normal(0.0, 0.1))
            belief.diffuse_place(0.002, vertical=step % 2 == 0)
            belief.diffuse_heading(0.0005)
            multiply(belief, factors, by_bin)
            belief.normalize()
            belief.prune()
        assert moved > 20
        return belief

    one, other = with_and_without(loops, work)
    assert_same_belief(one, other)


@pytest.mark.parametrize("name", ["diagonals", "maze"])
def test_distances_are_the_same(loops, name):
    walls = WallMap.from_lab(read_lab(find_lab(name)))
    generator = np.random.default_rng(2)
    x, y = generator.uniform(-1.0, walls.width + 1.0, 4000), generator.uniform(-3.0, walls.height + 3.0, 4000)
    x[:200] = np.round(x[:200])  # on faces, some of them
    direction = generator.uniform(-math.pi, math.pi, 4000)
    direction[:400] = np.round(direction[:400] / (math.pi / 2.0)) * (math.pi / 2.0)
    axes = (direction, np.cos(direction), np.sin(direction))
    one, other = with_and_without(loops, lambda: cone_distances(LabTables(walls), x, y, *axes))
    assert np.array_equal(one, other)
    assert np.isfinite(one).sum() > 2000


def drive(lab, coarse, fine, start, cycles):
    """Drive about in a simulation; give the estimates and the filter at the end."""
    parameters = Parameters(sim_time=0)
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    world = Simulation(lab, grid, parameters, 5)
    robot = world.register(RobotRegistration(name="g", sensor_angles=tuple(enumerate(ANGLES))))
    pose_filter = staged_filter(lab, coarse, fine, parameters)
    measures, command, estimates = world.launch()[robot], None, []
    for cycle in range(cycles):
        pose_filter.observe(measures, command)
        estimates.append(pose_filter.estimate())
        command = (-0.05, 0.05) if cycle % 30 < 18 else (0.1, 0.09)
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    return estimates, pose_filter


def test_a_whole_run_comes_out_the_same(loops, small_lab, coarse_tables, fine_tables):
    (one, first), (other, second) = with_and_without(
        loops, lambda: drive(small_lab, coarse_tables, fine_tables, (1.0, 4.2, 77.0), 110)
    )
    assert one == other
    assert first.is_fine
    assert one[-1].certain
    assert_same_belief(first.belief, second.belief)
    compiled_here = [value for value in vars(loops).values() if hasattr(value, "signatures")]
    functions = [value for value in compiled_here if value.py_func.__module__ == loops.__name__]
    assert len(functions) == compiled.LOOPS
    # What `warming` has compiled is all that a run needs: the loop never waits for a compiler.
    assert [len(function.signatures) for function in functions] == compiled.LOOPS * [1]


def test_states_that_look_alike_keep_equal_weights(loops):

    def beam(y):
        return Wall(height=4.0, corners=((0.0, y), (6.0, y), (6.0, y + 0.2), (0.0, y + 0.2)))

    def post(y):
        return Wall(height=4.0, corners=((2.9, y), (3.1, y), (3.1, y + 2.0), (2.9, y + 2.0)))

    # Two equal rooms, one above the other.
    walls = (beam(1.9), beam(5.9), beam(9.9), post(2.0), post(6.0))
    lab = Lab(width=6.0, height=12.0, walls=walls)
    tables = build_tables(lab, ANGLES, 2.0 / 9.0)
    compiled.use(loops)
    try:
        _, pose_filter = drive(lab, tables, None, (1.3, 3.1, 20.0), 60)
    finally:
        compiled.use(None)
    belief, lattice = pose_filter.belief, tables.lattice
    bins, squares, weights = belief.listed()
    whole = np.zeros((72, lattice.ny, lattice.nx))
    site = lattice.site[squares]
    whole[bins, site // lattice.nx, site % lattice.nx] = weights
    row = int(np.unique(lattice.site[np.abs(lattice.y - 3.0) < 1e-6] // lattice.nx)[0])
    below, above = whole[:, row - 8 : row + 18], whole[:, row + 10 : row + 36]
    assert pose_filter.estimate().probability < 0.51
    assert below.max() > 1e-3
    assert np.array_equal(below[:, :18], above[:, :18])


def test_the_environment_decides(monkeypatch):
    monkeypatch.setenv(machine_code.VARIABLE, "off")
    assert not compiled.load()
    assert compiled.kernels() is None
    monkeypatch.setenv(machine_code.VARIABLE, "perhaps")
    with pytest.raises(UsageError, match="perhaps"):
        compiled.load()
    monkeypatch.setenv(machine_code.VARIABLE, "on")
    for module in (compiled, machine_code):
        monkeypatch.setattr(module, "available", lambda: False)
    with pytest.raises(UsageError, match="numba"):
        compiled.load()
    monkeypatch.setenv(machine_code.VARIABLE, "auto")
    assert not compiled.load()


def test_a_numba_that_does_not_work_is_done_without(monkeypatch):
    import ciberrato.localization.belief

    for module in (compiled, machine_code):
        monkeypatch.setattr(module, "available", lambda: True)
    monkeypatch.setattr(compiled, "_active", None)
    monkeypatch.setitem(sys.modules, "ciberrato.localization.belief.kernels", None)  # importing it fails
    monkeypatch.delattr(ciberrato.localization.belief, "kernels", raising=False)
    assert not compiled.load()
    assert compiled.kernels() is None
    monkeypatch.setenv(machine_code.VARIABLE, "on")
    with pytest.raises(UsageError, match="on"):
        compiled.load()


def test_machine_code_is_at_hand_once_it_is_in_the_cache(loops, monkeypatch, tmp_path):
    assert compiled.at_hand()
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
    (tmp_path / "kernels.py").write_text("")
    assert not compiled.at_hand()  # another source, and nothing made of it
    monkeypatch.undo()
    monkeypatch.setenv(machine_code.VARIABLE, "off")
    assert not compiled.at_hand()


def test_processes_that_compile_at_the_same_time_keep_their_machine_code_apart(tmp_path):
    """With the numbers that numba gives its files, the third would run machine code for whole numbers."""
    pytest.importorskip("numba")
    path = tmp_path / "doubling.py"
    path.write_text(
        "from ciberrato.machine_code import kept\n@kept\ndef double(number):\n    return number + number\n"
    )

    def load():
        spec = importlib.util.spec_from_file_location("doubling", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.double, module.double._cache._cache_file

    (one, file), (other, others_file), (third, _) = load(), load(), load()
    save_index, save_data = others_file._save_index, file._save_data
    put_off = []
    file._save_data = lambda *words: put_off.append(words)

    def save_index_later(overloads):
        assert one(1) == 2
        save_index(overloads)

    others_file._save_index = save_index_later
    assert other(0.25) == 0.5
    save_data(*put_off[0])
    assert third(0.25) == 0.5
    assert third.stats.cache_hits  # the index is the other's
    assert load()[0](1) == 2


def test_without_being_asked_nothing_is_imported():
    code = "import ciberrato.localization.filtering.staged_filter, sys; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    pytest.importorskip("numba")
    run = subprocess.run(
        [sys.executable, "-m", "ciberrato.localization.belief.compiled"],
        env=os.environ | {compiled.VARIABLE: "auto"},
        check=False,
    )
    assert run.returncode == 0


@pytest.mark.parametrize("name", ["rooms", "diagonals"])
def test_lattices_and_tables_are_the_same(loops, name):
    lab = read_lab(find_lab(name))
    one, other = with_and_without(loops, lambda: build_tables(lab, (0.0, 61.0), 2.0 / 9.0))
    for field in ("x", "y", "representative", "clearance", "cell", "site", "index"):
        assert np.array_equal(getattr(one.lattice, field), getattr(other.lattice, field))
    assert all(np.array_equal(*pair) for pair in zip(one.codes, other.codes, strict=True))
    places = one.lattice.representative
    one, other = with_and_without(loops, lambda: find_turns(lab, WallMap.from_lab(lab), places, 0.1))
    assert one == other


def test_nearest_walls_of_scattered_places_are_the_same(loops):
    walls = WallMap.from_lab(read_lab(find_lab("diagonals")))
    generator = np.random.default_rng(6)
    places = generator.uniform((-2.0, -2.0), (walls.width + 2.0, walls.height + 2.0), (2000, 2))
    places[:500] = np.round(places[:500])  # on walls, and as near to one as to another
    one, other = with_and_without(loops, lambda: distances_to_walls(walls, places))
    assert np.array_equal(one, other)
    assert np.array_equal(one, walls.distance(*places.T))
    for one, other in zip(*with_and_without(loops, lambda: nearest_walls(walls, places)), strict=True):
        assert np.array_equal(one, other)


def test_codes_of_distances_are_the_same(loops):
    distances = np.random.default_rng(7).exponential(3.0, (40, 50))
    distances[0, :8] = [0.0, -0.0, -1.0, np.nan, np.inf, 1e300, 5e-324, 40.0]
    one, other = with_and_without(loops, lambda: encode(distances))
    assert np.array_equal(one, other)
    assert len(np.unique(one)) > 100
