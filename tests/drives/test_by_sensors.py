"""Without tables the robot drives by its sensors alone, at once, and nothing is said of its pose."""

from __future__ import annotations

import types

import numpy as np
import pytest

from agent.drives.by_sensors import SensorDrive
from agent.drives.registry import make_drive
from agent.run.live_controller import LiveController
from ciberrato.files.lab import read_lab
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.labs import find_lab
from ciberrato.localization.live.moments import cell_probabilities
from ciberrato.localization.pose_filter import PoseFilter
from ciberrato.localization.tables.pose_tables import build_tables
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

PARAMETERS = Parameters(sim_time=0)


def begin(lab: Lab, start: tuple[float, float, float], angles: tuple[float, ...], seed: int = 1):
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    simulation = Simulation(lab, grid, PARAMETERS, seed=seed)
    robot = simulation.register(RobotRegistration(name="s", sensor_angles=tuple(enumerate(angles))))
    assert robot is not None
    return simulation, robot, simulation.launch()[robot]


@pytest.mark.parametrize("angles", [(0.0, 90.0, -90.0, 180.0), (0.0, 60.0, -60.0, 180.0)])
@pytest.mark.parametrize(
    ("lab", "start"),
    [
        ("standard", (9.0, 3.0, 10.0)),
        ("maze", (1.0, 1.0, 200.0)),
        ("corridors", (1.0, 1.0, 90.0)),
        ("open", (5.0, 5.0, 45.0)),
    ],
)
def test_it_moves_at_once_and_keeps_off_walls(lab: str, start: tuple[float, float, float], angles) -> None:
    simulation, robot, measures = begin(read_lab(find_lab(lab)), start, angles)
    drive = SensorDrive(angles, PARAMETERS.obstacle_noise)
    poses, bumps = [], 0
    for _ in range(200):
        left, right = drive.decide(measures).command
        measures = simulation.step({robot: Actions(left_motor=left, right_motor=right)})[robot]
        bumps += bool(measures.collision)
        poses.append(simulation.poses()[0].copy())
    places = np.array(poses)
    assert np.abs(places[9] - (*start[:2], np.radians(start[2]))).sum() > 0.1  # within ten cycles
    assert np.hypot(*np.diff(places[:, :2], axis=0).T).sum() > 3.0
    assert bumps <= 2


def test_it_stands_as_long_as_a_sensor_was_never_heard() -> None:
    drive = SensorDrive((0.0, 90.0, -90.0, 180.0), 0.1)
    deaf = Measures(time=0, infrared=(0.5, 0.5, None, 0.5))
    assert drive.decide(deaf).command == (0.0, 0.0)
    assert drive.decide(Measures(time=1, infrared=(None, None, 0.5, None))).command == (0.1, 0.1)


@pytest.fixture(scope="module")
def small_lab() -> Lab:
    def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
        return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))

    walls = (box(1.9, 2.0, 2.1, 6.0), box(5.0, 3.4, 6.1, 4.2), box(3.9, 1.9, 6.0, 2.1))
    return Lab(name="small", width=8.0, height=6.0, walls=walls)


def test_until_there_are_tables_the_log_has_no_belief(small_lab: Lab) -> None:
    angles = (0.0, 60.0, -60.0, 180.0)
    tables = build_tables(small_lab, angles, 2.0 / 9.0)
    worker = types.SimpleNamespace(coarse=None, fine=None, error=None, wait=lambda timeout: True)
    ticks = [0.0]

    def clock() -> float:
        ticks[0] += 1.0
        return ticks[0]

    # The clock lets a cycle take in four messages, so that what came before the tables takes its time.
    localizer = PoseFilter(small_lab, PARAMETERS, angles, tables=worker, budget=4.5, clock=clock)  # type: ignore[arg-type]
    header = RunHeader(lab_name="small", lab_sha256="", parameters=PARAMETERS, sensor_angles=angles)
    controller = LiveController(header, localizer, make_drive("explore", small_lab, PARAMETERS, angles))
    simulation, robot, measures = begin(small_lab, (1.0, 4.2, 77.0), angles)
    cycles: list[Cycle] = []
    there: list[np.ndarray] = []
    for number in range(140):
        if number == 40:
            worker.coarse = tables
        cycle, actions = controller.observe(measures)
        cycles.append(cycle)
        grid = localizer.live.filter
        if cycle.step is not None and number > 60:
            assert grid is not None
            there.append(cell_probabilities(small_lab, grid.belief))
        assert actions is not None
        measures = simulation.step({robot: actions})[robot]
    blind = [cycle for cycle in cycles if cycle.estimate is None]
    assert 40 <= len(blind) < 60
    assert cycles[len(blind)].estimate is not None
    assert all(cycle.cells is None and cycle.modes is None and cycle.entropy is None for cycle in blind)
    assert any(cycle.command != (0.0, 0.0) for cycle in blind[:10])
    statistics = localizer.live.statistics
    assert statistics.waited == len(blind)
    assert statistics.ready == len(blind)
    # What the run knew is what the belief file gets: the prior, the start, and every cell entered.
    blocks = localizer.live.moments.blocks
    steps = [cycle for cycle in cycles if cycle.step is not None]
    assert steps[0].time == 0
    assert len(blocks) == len(steps) + 1 > 3
    np.testing.assert_allclose(blocks.sum(axis=(1, 2)), 1.0)
    assert blocks[0].max() < 0.15  # nothing is known before the run
    np.testing.assert_array_equal(blocks[-len(there) :], there)
    x, y, _ = simulation.poses()[0]
    assert blocks[-1][int(steps[-1].estimate[1] // 2), int(steps[-1].estimate[0] // 2)] > 0.5  # type: ignore[index]
    assert abs(cycles[-1].estimate[0] - x) + abs(cycles[-1].estimate[1] - y) < 0.6  # type: ignore[index]
