"""``explore`` in lockstep: free legs until the pose is known, then every cell, without touching anything."""

from __future__ import annotations

import dataclasses
import itertools
import types

import numpy as np
import pytest

from agent.drives import make_drive
from agent.drives.base import Decision
from agent.drives.cell_to_cell import CellDrive
from agent.drives.explore import ExploreDrive
from agent.drives.roam import Roamer
from agent.run.live_controller import LiveController
from ciberrato.files.run_log import Cycle, RunHeader
from ciberrato.localization.belief.estimate import CERTAIN
from ciberrato.localization.cell_beliefs import cell_beliefs
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.pose_filter import PoseFilter
from ciberrato.localization.tables.pose_tables import PoseTables, build_tables
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
PARAMETERS = Parameters(sim_time=0)
Cell = tuple[int, int]


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


ROWS = Lab(
    name="rows",
    width=10.0,
    height=6.0,
    walls=(
        box(1.9, 1.9, 6.1, 2.1),
        box(3.9, 3.9, 4.1, 6.0),
        box(7.9, 2.0, 8.1, 4.1),
        box(7.9, 3.9, 10.0, 4.1),
        box(5.9, 3.9, 6.1, 6.0),  # with the next two: a closed room in the top row
        box(4.0, 3.9, 6.1, 4.1),
    ),
)
OBLIQUE = Lab(
    name="oblique",
    width=10.0,
    height=6.0,
    walls=(
        Wall(height=4.0, corners=((2.4, 1.6), (2.6, 1.6), (4.1, 3.4), (3.9, 3.4))),
        box(5.58, 3.3, 5.62, 6.0),
        Wall(height=4.0, corners=((7.9, 2.8), (8.4, 3.1), (7.7, 3.3))),
        box(6.8, 0.75, 7.1, 1.2),
    ),
)


@pytest.fixture(scope="module", params=[ROWS, OBLIQUE], ids=lambda lab: lab.name)
def lab(request: pytest.FixtureRequest) -> Lab:
    return request.param


@pytest.fixture(scope="module")
def tables(lab: Lab) -> tuple[PoseTables, PoseTables]:
    return build_tables(lab, ANGLES, 2.0 / 9.0), build_tables(lab, ANGLES, 0.1)


def simulate(
    lab: Lab, start: tuple[float, float, float], parameters: Parameters, seed: int = 2
) -> Simulation:
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    return Simulation(lab, grid, parameters, seed)


def register(world: Simulation) -> tuple[int, Measures]:
    robot = world.register(RobotRegistration(name="explorer", sensor_angles=tuple(enumerate(ANGLES))))
    assert robot is not None
    return robot, world.launch()[robot]


def cells_within_reach(tables: PoseTables, start: tuple[float, float]) -> set[Cell]:
    """Cells that a robot can get to whose centre has room: by flooding the squares."""
    lattice = tables.lattice
    free = np.append(lattice.clearance >= 0.55, False)
    reached = np.zeros(lattice.size + 1, np.bool_)
    reached[np.hypot(lattice.x - start[0], lattice.y - start[1]).argmin()] = True
    while True:
        grown = reached.copy()
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            grown[lattice.neighbours(dx, dy)[np.flatnonzero(reached[:-1])]] = True
        grown &= free | reached
        if (grown == reached).all():
            break
        reached = grown
    centred = np.flatnonzero(
        reached[:-1]
        & (lattice.clearance >= 0.6)
        & (np.abs(lattice.x % 2.0 - 1.0) < 0.01)
        & (np.abs(lattice.y % 2.0 - 1.0) < 0.01)
    )
    return {(int(lattice.y[k] // 2.0), int(lattice.x[k] // 2.0)) for k in centred}


@pytest.mark.parametrize(("motors_noise", "obstacle_noise"), [(1.5, 0.1), (5.0, 0.4)])
def test_every_cell_is_visited_and_nothing_touched(
    lab: Lab, tables: tuple[PoseTables, PoseTables], motors_noise: float, obstacle_noise: float
) -> None:
    parameters = dataclasses.replace(PARAMETERS, motors_noise=motors_noise, obstacle_noise=obstacle_noise)
    worker = types.SimpleNamespace(coarse=tables[0], fine=tables[1], error=None, wait=lambda timeout: True)
    localizer = PoseFilter(lab, parameters, ANGLES, tables=worker, budget=1e6)
    header = RunHeader(lab_name=lab.name, lab_sha256="", parameters=parameters, sensor_angles=ANGLES)
    controller = LiveController(header, localizer, make_drive("explore", lab, parameters, ANGLES))
    world = simulate(lab, (1.1, 4.7, 50.0), parameters)
    robot, measures = register(world)
    logged: list[Cycle] = []
    poses = []
    for _ in range(600):
        cycle, actions = controller.observe(measures)
        logged.append(cycle)
        poses.append(world.poses()[0].copy())
        measures = world.step({robot: actions or Actions()})[robot]
    true_cells = [(int(y // 2.0), int(x // 2.0)) for x, y, _ in poses]
    wanted = cells_within_reach(tables[0], (1.1, 4.7))
    assert 8 < len(wanted) <= 15
    assert wanted <= set(true_cells)
    assert world.robots[0].collisions == 0
    # What the dead reckoning of the drive to the right would say is not logged as if it were this drive's.
    assert {(cycle.displacement, cycle.heading, cycle.spread) for cycle in logged} == {(None, None, None)}
    # Every cell entered is a step of the log, from when the pose is known on.
    first = next(k for k, cycle in enumerate(logged) if cycle.estimate[3] > CERTAIN)
    assert first < 60
    entered = [cell for cell, _ in itertools.groupby(true_cells[first:])]
    steps = [(cycle.estimate[1] // 2.0, cycle.estimate[0] // 2.0) for cycle in logged if cycle.step]
    assert steps == entered[-len(steps) :]
    assert len(entered) - len(steps) <= 1  # the cell in which it was when it knew
    if obstacle_noise == PARAMETERS.obstacle_noise:
        # And a block of the belief file, made as the robot crosses the border between two cells.
        beliefs = cell_beliefs(lab, tables[1], parameters, localizer.live.history[:300])[2:]
        entered = [cell for cell, _ in itertools.groupby(true_cells[:300])][-len(beliefs) - 1 :]
        assert len(beliefs) > 12
        for block, (left, cell) in zip(beliefs, itertools.pairwise(entered), strict=True):
            assert block[left] + block[cell] > 0.9
            assert block[cell] > 0.2


class FreeLegs:
    """What `explore` was before it drove from cell to cell."""

    def __init__(self, noise: float) -> None:
        self._explorer = ExploreDrive(ANGLES, noise)
        self._roamer = Roamer(ANGLES, noise, self._explorer.choose)

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        self._explorer.note_visit(pose_filter)
        return self._roamer.decide(measures, pose_filter)


def side_by_side(
    lab: Lab, tables: PoseTables, start: tuple[float, float, float], cycles: int
) -> tuple[list[bool], list[bool]]:
    """Say of every cycle whether the pose was known, and whether free legs would have been driven."""
    parameters = dataclasses.replace(PARAMETERS, compass_sensor=False)
    world = simulate(lab, start, parameters)
    robot, measures = register(world)
    pose_filter = GridFilter(lab, tables, parameters)
    explore, free = make_drive("explore", lab, parameters, ANGLES), FreeLegs(parameters.obstacle_noise)
    command, certain, same = None, [], []
    for _ in range(cycles):
        pose_filter.observe(measures, command)
        certain.append(pose_filter.estimate().certain)
        decision = explore.decide(measures, pose_filter)
        same.append(free.decide(measures, pose_filter) == decision)
        command = decision.command
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    return certain, same


def test_while_the_pose_is_not_known_legs_are_free(lab: Lab, tables: tuple[PoseTables, PoseTables]) -> None:
    certain, same = side_by_side(lab, tables[0], (1.2, 4.6, 80.0), 150)
    first = certain.index(True)
    assert all(same[: first + 4])
    assert not all(same)


def test_where_two_rooms_are_alike_legs_stay_free() -> None:
    alike = Lab(name="alike", width=8.0, height=8.0, walls=(box(0.0, 3.9, 8.0, 4.1),))
    certain, same = side_by_side(alike, build_tables(alike, ANGLES, 2.0 / 9.0), (2.0, 1.3, 30.0), 200)
    assert not any(certain)
    assert all(same)


def test_legs_are_free_again_when_the_pose_is_lost() -> None:
    tables = build_tables(ROWS, ANGLES, 2.0 / 9.0)
    world = simulate(ROWS, (1.0, 5.0, -90.0), PARAMETERS)
    robot, measures = register(world)
    pose_filter = GridFilter(ROWS, tables, PARAMETERS, start="1,5,-90")
    drive = CellDrive(ANGLES, PARAMETERS.obstacle_noise)
    command, driven = None, []
    for cycle in range(60):
        pose_filter.observe(measures, command)
        if cycle == 40:
            pose_filter.restart(measures.time)
        drive.observe(measures, pose_filter, command)
        decided = drive.decide(measures)
        driven.append(decided is not None)
        command = decided or (0.0, 0.0)
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    assert not any(driven[:4])
    assert all(driven[5:40])
    assert not driven[40]


def test_what_the_map_does_not_have_is_not_run_into() -> None:
    """A block stands in the way between two centres; others are visited instead."""
    coarse, fine = build_tables(ROWS, ANGLES, 2.0 / 9.0), build_tables(ROWS, ANGLES, 0.1)
    real = dataclasses.replace(ROWS, walls=(*ROWS.walls, box(2.5, 2.6, 2.9, 3.4)))
    world = simulate(real, (1.0, 5.0, -90.0), PARAMETERS)
    robot, measures = register(world)
    pose_filter = staged_filter(ROWS, coarse, fine, PARAMETERS, start="1,5,-90")
    drive = make_drive("explore", ROWS, PARAMETERS, ANGLES)
    command, been = None, set()
    for _ in range(900):
        pose_filter.observe(measures, command)
        command = drive.decide(measures, pose_filter).command
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
        x, y, _ = world.poses()[0]
        been.add((int(y // 2.0), int(x // 2.0)))
    assert world.robots[0].collisions == 0
    assert len(been) >= 13


def test_the_robot_keeps_to_the_line_between_centres() -> None:
    coarse, fine = build_tables(ROWS, ANGLES, 2.0 / 9.0), build_tables(ROWS, ANGLES, 0.1)
    world = simulate(ROWS, (1.0, 5.0, -90.0), PARAMETERS)
    robot, measures = register(world)
    pose_filter = staged_filter(ROWS, coarse, fine, PARAMETERS, start="1,5,-90")
    drive = make_drive("explore", ROWS, PARAMETERS, ANGLES)
    command, away = None, []
    for _ in range(400):
        pose_filter.observe(measures, command)
        command = drive.decide(measures, pose_filter).command
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
        x, y, _ = world.poses()[0]
        away.append(min(abs(x % 2.0 - 1.0), abs(y % 2.0 - 1.0)))
    assert np.median(away[50:]) < 0.03
    assert np.quantile(away[50:], 0.95) < 0.1
