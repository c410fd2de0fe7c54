"""A batch gives, world by world, what single simulations with the same seeds give, to the last bit."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace

import numpy as np
import pytest

from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_lab
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.batch import BatchReadings, BatchSimulation
from simulator_stub.batch import noise as batch_noise
from simulator_stub.simulation import Simulation

NUMBA = importlib.util.find_spec("numba") is not None
KERNELS = [
    pytest.param(False, id="numpy"),
    pytest.param(
        True,
        id="numba",
        marks=[pytest.mark.slow, pytest.mark.skipif(not NUMBA, reason="numba is not installed")],
    ),
]
ANGLES = (0.0, 90.0, -75.5, 180.0)


def free_starts(lab: Lab, count: int, rng: np.random.Generator) -> np.ndarray:
    walls = WallMap.from_lab(lab)
    starts: list[tuple[float, float, float]] = []
    while len(starts) < count:
        x, y = rng.uniform(0.5, lab.width - 0.5), rng.uniform(0.5, lab.height - 0.5)
        if walls.distance(x, y) >= 0.5:
            starts.append((x, y, rng.uniform(-180.0, 180.0)))
    return np.array(starts)


def lattice_starts(lab: Lab, count: int, rng: np.random.Generator) -> np.ndarray:
    """Poses from which rays run through corners and along faces."""
    column, row = rng.integers(lab.columns, size=count), rng.integers(lab.rows, size=count)
    return np.stack((1.0 + 2.0 * column, 1.0 + 2.0 * row, 90.0 * rng.integers(-1, 3, size=count)), axis=-1)


def single(lab: Lab, start: np.ndarray, parameters: Parameters, seed: int) -> Simulation:
    x, y, direction = (float(number) for number in start)
    grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction),))
    simulation = Simulation(lab, grid, parameters, seed)
    simulation.register(RobotRegistration(sensor_angles=tuple(enumerate(ANGLES))))
    return simulation


def world_of(readings: BatchReadings, world: int) -> tuple[object, ...]:
    assert readings.line is not None
    return (
        int(readings.time[world]),
        tuple(readings.infrared[world].tolist()),
        float(readings.compass[world]),
        int(readings.ground[world]),
        bool(readings.collision[world]),
        "".join("01"[element] for element in readings.line[world].astype(int)),
    )


def of_measures(measures: Measures) -> tuple[object, ...]:
    return (
        measures.time,
        measures.infrared,
        measures.compass,
        measures.ground,
        measures.collision,
        measures.line,
    )


def assert_same(
    lab: Lab, starts: np.ndarray, parameters: Parameters, *, compiled: bool, cycles: int, turn: bool = True
) -> BatchSimulation:
    """Drive a batch and single simulations side by side; everything must be equal."""
    count = len(starts)
    seeds = range(40, 40 + count)
    batch = BatchSimulation(lab, starts, parameters, seeds=seeds, sensor_angles=ANGLES, compiled=compiled)
    simulations = [single(lab, start, parameters, seed) for start, seed in zip(starts, seeds, strict=True)]
    for world, simulation in enumerate(simulations):
        assert world_of(batch.readings, world) == of_measures(simulation.launch()[1])
    rng = np.random.default_rng(8)
    for cycle in range(cycles):
        commands = None
        if cycle % 10 == 0:
            commands = rng.choice([-0.1, 0.05, 0.1, 0.15, 0.2], size=(count, 2))
            if not turn:
                commands[:, 1] = commands[:, 0]
        readings = batch.step(commands)
        poses = batch.poses()
        for world, simulation in enumerate(simulations):
            actions = (
                {}
                if commands is None
                else {1: Actions(left_motor=float(commands[world, 0]), right_motor=float(commands[world, 1]))}
            )
            measures = simulation.step(actions)[1]
            assert world_of(readings, world) == of_measures(measures), (cycle, world)
            assert poses[world].tolist() == simulation.poses()[0].tolist()
            assert batch.collisions[world] == simulation.robots[0].collisions
    return batch


NOISY = Parameters(sim_time=0)
LATE = replace(
    NOISY, sim_time=70, obstacle_latency=2, compass_latency=3, collision_latency=1, ground_latency=4
)


@pytest.mark.parametrize("compiled", KERNELS)
@pytest.mark.parametrize("name", ["maze", "lines", "rooms", "diagonals"])
def test_noise_walls_and_lines(name: str, compiled: bool) -> None:
    lab = read_lab(find_lab(name))
    batch = assert_same(
        lab, free_starts(lab, 5, np.random.default_rng(1)), NOISY, compiled=compiled, cycles=120
    )
    assert batch.collisions.sum() > 0


@pytest.mark.parametrize("compiled", KERNELS)
def test_latencies_and_the_end_of_time(compiled: bool) -> None:
    lab = read_lab(find_lab("rooms"))
    batch = assert_same(
        lab, free_starts(lab, 3, np.random.default_rng(2)), LATE, compiled=compiled, cycles=90
    )
    assert batch.is_over.all()
    assert batch.readings.over.all()
    assert (batch.time == 70).all()


@pytest.mark.parametrize("compiled", KERNELS)
@pytest.mark.parametrize("name", ["maze", "wide"])
def test_without_noise_on_a_lattice(name: str, compiled: bool, quiet: Parameters) -> None:
    lab = read_lab(find_lab(name))
    starts = lattice_starts(lab, 8, np.random.default_rng(3))
    assert_same(lab, starts, replace(quiet, sim_time=0), compiled=compiled, cycles=60, turn=False)


@pytest.mark.parametrize("compiled", KERNELS)
def test_places_that_the_tables_leave_open(compiled: bool, quiet: Parameters) -> None:
    # A round pillar of many faces, a robot far outside the lab, one that just touches a wall.
    pillar = tuple(
        (10.0 + math.cos(2 * math.pi * corner / 60), 5.0 + math.sin(2 * math.pi * corner / 60))
        for corner in range(60)
    )
    lab = Lab(
        width=20.0, height=10.0, walls=(Wall(corners=pillar),), targets=(Target(x=12, y=5, radius=1.5),)
    )
    starts = np.array(
        [(12.0, 5.0, 180.0), (-40.0, 5.0, 0.0), (0.5, 5.0, 180.0), (19.5, 9.5, 45.0), (13.0, 5.0, 720.0)]
    )
    batch = assert_same(lab, starts, replace(quiet, sim_time=0), compiled=compiled, cycles=80)
    assert (batch.collisions > 0).sum() >= 2


@pytest.mark.slow
@pytest.mark.skipif(not NUMBA, reason="numba is not installed")
@pytest.mark.parametrize("name", ["maze", "rooms"])
def test_a_single_simulation_in_machine_code_is_the_same(name: str, quiet: Parameters) -> None:
    lab = read_lab(find_lab(name))
    rng = np.random.default_rng(9)
    starts = np.concatenate((free_starts(lab, 2, rng), lattice_starts(lab, 4, rng), [(-40.0, 5.0, 0.0)]))
    for start in starts:
        x, y, direction = (float(number) for number in start)
        grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction), GridPosition(x=5, y=5)))
        runs = []
        for compiled in (False, True):
            simulation = Simulation(lab, grid, replace(quiet, sim_time=0), compiled=compiled)
            for _ in grid.positions:
                simulation.register(RobotRegistration())
            simulation.launch()
            drives = [Actions(left_motor=left, right_motor=0.1) for left in (0.1, 0.08, 0.11)]
            runs.append([simulation.step({1: drives[cycle // 15 % 3]}) for cycle in range(90)])
        assert runs[0] == runs[1]


@pytest.fixture
def maze() -> Lab:
    return read_lab(find_lab("maze"))


def drive(batch: BatchSimulation, cycles: int) -> list[np.ndarray]:
    return [
        np.concatenate((batch.step(np.full((batch.worlds, 2), 0.1)).infrared, batch.poses()), axis=1)
        for _ in range(cycles)
    ]


def test_how_many_numbers_are_drawn_at_a_time_does_not_matter(
    maze: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts = free_starts(maze, 3, np.random.default_rng(4))
    expected = drive(BatchSimulation(maze, starts, NOISY, seeds=range(3)), 40)
    monkeypatch.setattr(batch_noise, "_BLOCK_NUMBERS", 30)
    assert np.array_equal(drive(BatchSimulation(maze, starts, NOISY, seeds=range(3)), 40), expected)


def test_worlds_do_not_depend_on_one_another(maze: Lab) -> None:
    starts = free_starts(maze, 6, np.random.default_rng(5))
    together = drive(BatchSimulation(maze, starts, NOISY, seeds=range(6)), 30)
    alone = drive(BatchSimulation(maze, starts[4:5], NOISY, seeds=[4]), 30)
    assert np.array_equal([step[4:5] for step in together], alone)


def test_going_back_to_a_snapshot_gives_the_same_future(maze: Lab) -> None:
    parameters = replace(NOISY, obstacle_latency=2)
    batch = BatchSimulation(maze, free_starts(maze, 4, np.random.default_rng(6)), parameters, seeds=range(4))
    untouched = BatchSimulation(
        maze, free_starts(maze, 4, np.random.default_rng(6)), parameters, seeds=range(4)
    )
    before = batch.snapshot()
    first = drive(batch, 150)
    middle = batch.snapshot()
    second = drive(batch, 100)
    batch.restore(middle)
    assert np.array_equal(drive(batch, 100), second)
    batch.restore(before)
    assert (batch.time == 0).all()
    assert np.array_equal(drive(batch, 250), [*first, *second])
    assert np.array_equal(drive(untouched, 250), [*first, *second])


def test_without_a_line_sensor_the_rest_is_the_same(maze: Lab) -> None:
    starts = free_starts(maze, 3, np.random.default_rng(7))
    batch = BatchSimulation(maze, starts, NOISY, seeds=range(3), line_sensor=False)
    assert batch.readings.line is None
    with_line = BatchSimulation(maze, starts, NOISY, seeds=range(3))
    assert np.array_equal(drive(batch, 20), drive(with_line, 20))


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        (np.zeros((2, 3)), "shape"),
        (np.zeros((3, 2)), "shape"),
        (np.full((3, 3), np.inf), "finite"),
    ],
)
def test_starts_are_checked(maze: Lab, starts: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        BatchSimulation(maze, starts, seeds=range(3))


@pytest.mark.parametrize(
    ("commands", "message"), [(np.zeros(2), "shape"), (np.array([[0.1, np.nan]]), "number")]
)
def test_commands_are_checked(maze: Lab, commands: np.ndarray, message: str) -> None:
    batch = BatchSimulation(maze, [(1.0, 1.0, 0.0)], seeds=[1])
    with pytest.raises(ValueError, match=message):
        batch.step(commands)


def test_commands_beyond_the_limit_are_clamped(maze: Lab, quiet: Parameters) -> None:
    batch = BatchSimulation(maze, [(1.0, 1.0, 0.0)] * 2, quiet, seeds=[1, 2])
    batch.step(np.array([[0.15, 0.15], [math.inf, 7.0]]))
    assert np.array_equal(*batch.poses())


@pytest.mark.parametrize("compiled", KERNELS)
def test_readings_that_hang_on_rounding_and_headings_of_several_turns(
    compiled: bool, quiet: Parameters
) -> None:
    starts = np.array([(24.0, 2.0, 0.0), (24.0, 2.0, 720.0), (4.0, 12.0, 1080.0), (3.0, 2.0, -720.0)])
    lab = Lab(width=28.0, height=14.0)
    batch = assert_same(lab, starts, replace(quiet, sim_time=0), compiled=compiled, cycles=15)
    maze = read_lab(find_lab("maze"))
    starts = np.array([(17.0, 1.0, 720.0), (17.0, 1.0, 360.0), (1.0, 1.0, 1440.0)])
    for parameters in (replace(quiet, sim_time=0), NOISY):
        assert_same(maze, starts, parameters, compiled=compiled, cycles=15)
    batch = BatchSimulation(lab, [(24.0, 2.0, 0.0)], quiet, seeds=[1], compiled=compiled)
    assert batch.readings.infrared[0, 3] == 0.3
