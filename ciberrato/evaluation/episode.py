"""Runs one task: a simulation, a filter and a drive in lockstep, in this process, without any network."""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from agent.drives.registry import DRIVES, RIGHT, make_drive, parse_drive, read_place
from agent.drives.right.phases import Phase
from ciberrato.checks.equal_places import Room, equal_poses, equal_rooms
from ciberrato.checks.free_space import FreeSpace, free_space
from ciberrato.evaluation.judged import BuiltInFilter, FilterSetup, Judged, OwnFilter, load_filter
from ciberrato.evaluation.record import Record
from ciberrato.evaluation.settings import with_settings
from ciberrato.evaluation.starts import elsewhere, reachable, start_pose
from ciberrato.evaluation.task import BUILT_IN, Outcome, Task
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import read_parameters
from ciberrato.labs import find_lab, find_parameters
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.tables.cache import cached_tables
from ciberrato.localization.tables.pose_tables import COARSE, PoseTables, fine_resolution
from ciberrato.localization.tables.tiled import TiledTables
from ciberrato.physics.kinematics import Command
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.coordinates import Pose
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
"""Mounting angles of the IR sensors, the simulator's defaults."""
RIGHT_ANGLES = (0.0, 90.0, -90.0, 180.0)
"""Those of the published method, for the drive to the right."""
STANDS = "stands"
"""Reason with which the drive to the right finishes before its wall."""
_AT_REST = 60
"""Messages; the filter asks nothing of the sensors of a robot that has stood for twenty."""


class Driver(Protocol):
    """Interface of a drive, for `run_task`."""

    def __call__(self, measures: Measures, pose_filter: GridFilter | None) -> tuple[Command, str | None]:
        """Return the command, and why the drive has finished if it has."""


@functools.lru_cache(maxsize=8)
def lab_of(name: str) -> Lab:
    """Read a lab, once a process."""
    return read_lab(find_lab(name))


@functools.lru_cache(maxsize=8)
def tables_of(name: str, angles: tuple[float, ...], resolution: float) -> PoseTables:
    """Read the tables of a lab, or compute them, once a process."""
    return cached_tables(lab_of(name), angles, resolution)


@functools.lru_cache(maxsize=8)
def rooms_of(name: str) -> tuple[FreeSpace, list[Room]] | None:
    """Find which rooms of a lab are equal, once a process; None for a lab that is too large."""
    lab = lab_of(name)
    space = free_space(lab)
    return None if space is None else (space, equal_rooms(lab, space))


def tables_needed(task: Task) -> list[tuple[str, tuple[float, ...], float]]:
    """Return which tables a task needs: lab, mounting angles and resolution of each."""
    needed: list[tuple[str, tuple[float, ...], float]] = [(task.lab, _angles(task), _resolution(task))]
    if task.staged and _resolution(task) < COARSE:
        needed.append((task.lab, _angles(task), COARSE))
    return needed


def prepare(lab: str, angles: tuple[float, ...], resolution: float) -> None:
    """Compute tables that are not on disk yet, once for all processes that follow."""
    cached_tables(lab_of(lab), angles, resolution)


def run_task(task: Task) -> Outcome:
    """Run a task.

    Parameters
    ----------
    task : Task

    Returns
    -------
    Outcome
        The same for the same task, but for the times that it took.
    """
    lab, angles = lab_of(task.lab), _angles(task)
    tables = tables_of(task.lab, angles, _resolution(task))
    parameters = _parameters(task)
    generator = np.random.default_rng([task.seed, 0x5EED])
    start = start_pose(task, tables.lattice, generator)
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=math.degrees(start[2])),))
    simulation = Simulation(lab, grid, parameters, seed=task.seed)
    robot = simulation.register(RobotRegistration(name="judged", sensor_angles=tuple(enumerate(angles))))
    assert robot is not None
    # Drives ask the project's filter, whichever is judged: so all filters see the same run.
    asked = task.drive != RIGHT or task.filter == BUILT_IN
    pose_filter = _pose_filter(task, lab, tables, parameters) if asked else None
    judged: Judged
    if task.filter == BUILT_IN:
        assert pose_filter is not None
        judged = BuiltInFilter(pose_filter)
    else:
        own = FilterSetup(
            lab=lab,
            parameters=parameters,
            angles=angles,
            start=task.prior,
            generator=np.random.default_rng([task.seed, 0xF117E2]),
        )
        judged = OwnFilter(load_filter(task.filter), own)
    room = reachable(tables.lattice, start)
    driver = _driver(task, lab, parameters, angles, tables, room, generator)
    record = Record(task, start, float(room.sum()) * tables.lattice.resolution**2, _equal(task, parameters))
    standing, at_rest = 0, _AT_REST + max(parameters.obstacle_latency, parameters.compass_latency)
    measures = simulation.launch()[robot]
    command: Command | None = None
    for cycle in range(task.cycles + 1):
        begin = time.thread_time()
        judged.observe(measures, command)
        judged.estimate()  # kept by the filter for all who ask
        filtered = time.thread_time() - begin
        if pose_filter is not None and task.filter != BUILT_IN:
            pose_filter.observe(measures, command)
        begin = time.thread_time()
        command, finished = driver(measures, pose_filter)
        record.times.append((filtered, time.thread_time() - begin))
        pose = simulation.poses()[0]
        record.take(cycle, pose, judged, collision=bool(measures.collision))
        if finished == "arrived" and record.arrived is None:
            record.arrived = cycle
        if task.kidnap and cycle + 1 == task.kidnap:
            simulation.place(robot, *elsewhere(tables.lattice, pose, generator))
            record.kidnapped = cycle + 1
        standing = standing + 1 if finished == STANDS and not measures.collision else 0
        if standing > at_rest and not task.kidnap:
            record.rest()
            break
        if _over(task, record, finished):
            break
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    return record.outcome(simulation.robots[0].collisions, judged)


def _pose_filter(task: Task, lab: Lab, tables: PoseTables, parameters: Parameters) -> GridFilter:
    if not task.staged or task.resolution >= COARSE:
        return GridFilter(lab, tables, parameters, start=task.prior)
    coarse = tables_of(task.lab, _angles(task), COARSE)
    is_whole = tables.lattice.resolution <= task.resolution
    fine = tables if is_whole else TiledTables(lab, coarse, task.resolution)
    return staged_filter(lab, coarse, fine, parameters, start=task.prior)


def _resolution(task: Task) -> float:
    """Return the resolution of the tables of all of the lab; in a large one parts have finer ones."""
    return max(task.resolution, fine_resolution(lab_of(task.lab))) if task.staged else task.resolution


def _equal(task: Task, parameters: Parameters) -> Callable[[Pose], list[Pose]] | None:
    """Return what lists the poses that are equal to one; None for a lab that is too large to be looked at."""
    known = rooms_of(task.lab)
    if known is None:
        return None
    if parameters.beacon_sensor and lab_of(task.lab).beacons:
        return lambda pose: []  # bearings of beacons distinguish rooms that look the same
    heading = parameters.compass_sensor or parameters.gps
    return lambda pose: equal_poses(*known, pose, compass=heading)


def _over(task: Task, record: Record, finished: str | None) -> bool:
    """Return whether nothing more is to be learnt from a run."""
    if finished == "arrived":
        return True
    if task.kidnap:
        return record.found is not None
    return record.cycles >= record.last_cycle


def _parameters(task: Task) -> Parameters:
    announced = with_settings(read_parameters(find_parameters(task.parameters)), task.settings)
    return dataclasses.replace(
        announced,
        compass_sensor=task.compass,
        gps=announced.gps if task.gps == "announced" else task.gps == "on",
        sim_time=0,
    )


def _angles(task: Task) -> tuple[float, float, float, float]:
    return RIGHT_ANGLES if task.drive == RIGHT else ANGLES


def _driver(
    task: Task,
    lab: Lab,
    parameters: Parameters,
    angles: tuple[float, float, float, float],
    tables: PoseTables,
    room: NDArray[np.bool_],
    generator: np.random.Generator,
) -> Driver:
    if task.drive == RIGHT:
        return _right_driver(parameters, angles)
    name, goal = (task.drive, None) if task.drive in DRIVES else parse_drive(task.drive)
    if name in DRIVES and DRIVES[name].argument is read_place:
        roomy = np.flatnonzero(room & (tables.lattice.clearance >= 0.7))
        chosen = int(generator.choice(roomy))
        goal = (float(tables.lattice.x[chosen]), float(tables.lattice.y[chosen]))
    # In an evaluation the run goes on, to see whether the claim lasts.
    drive = make_drive(name, lab, parameters, angles, goal=goal, stop_when_localized=False)

    def decide(measures: Measures, pose_filter: GridFilter | None) -> tuple[Command, str | None]:
        assert pose_filter is not None
        decision = drive.decide(measures, pose_filter)
        return decision.command, decision.finished

    return decide


def _right_driver(parameters: Parameters, angles: tuple[float, float, float, float]) -> Driver:
    """Build the published drive: align to the right, drive right, stand before the wall."""
    from agent.drives.right.controller import Controller
    from ciberrato.files.run_records import RunHeader

    header = RunHeader(lab_name="", lab_sha256="", parameters=parameters, sensor_angles=angles)
    controller = Controller(header)

    def decide(measures: Measures, pose_filter: GridFilter | None) -> tuple[Command, str | None]:
        _, actions = controller.observe(measures)
        if actions is None or actions.left_motor is None or actions.right_motor is None:
            return (0.0, 0.0), None
        finished = STANDS if controller.phase is Phase.HOLDING else None
        return (actions.left_motor, actions.right_motor), finished

    return decide
