"""With numba or without: the same numbers to the last bit."""

from __future__ import annotations

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
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.belief.reweight import multiply
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.refinement.cones import cone_distances
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
    from ciberrato.localization.tables.pose_tables import build_tables

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
