"""Runs one task: a simulation, a filter and a drive in lockstep, in this process, without any network."""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections import deque
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from agent.drives import make_drive
from agent.pose_filter.cache import cached_tables
from agent.pose_filter.estimate import CLAIM_RADIUS, CLAIM_TURN, probability_near
from agent.pose_filter.posefilter import PoseFilter
from agent.pose_filter.staged import StagedFilter
from agent.pose_filter.tables import COARSE, PoseTables
from ciberrato.gridfile import read_grid
from ciberrato.lab import Lab
from ciberrato.labfile import read_lab
from ciberrato.parameterfile import read_parameters
from ciberrato.parameters import Parameters
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.startgrid import GridPosition, StartGrid
from evaluation.task import Outcome, Task
from maps import find_grid, find_lab, find_parameters
from simulator_stub.simulation import Simulation

Pose = tuple[float, float, float]
Command = tuple[float, float]

ANGLES = (0.0, 60.0, -60.0, 180.0)
"""Mounting angles of the IR sensors, the simulator's defaults."""
RIGHT_ANGLES = (0.0, 90.0, -90.0, 180.0)
"""Those of the published method, for the drive to the right."""
_LEAST_CLEARANCE = 0.52
_FAR = 3.0


class Driver(Protocol):
    """What decides, for `run_task`."""

    def __call__(self, measures: Measures, pose_filter: PoseFilter) -> tuple[Command, str | None]:
        """Return the command, and why the drive has finished if it has."""


@functools.lru_cache(maxsize=8)
def _lab(name: str) -> Lab:
    return read_lab(find_lab(name))


@functools.lru_cache(maxsize=8)
def _tables(name: str, angles: tuple[float, ...], resolution: float) -> PoseTables:
    return cached_tables(_lab(name), angles, resolution)


def prepare(task: Task) -> None:
    """Compute the tables that a task needs, once for all that follow."""
    _tables(task.lab, _angles(task), task.resolution)
    if task.staged:
        _tables(task.lab, _angles(task), COARSE)


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
    lab, angles = _lab(task.lab), _angles(task)
    tables = _tables(task.lab, angles, task.resolution)
    parameters = dataclasses.replace(
        read_parameters(find_parameters(task.parameters)),
        compass_sensor=task.compass,
        sim_time=0,
    )
    generator = np.random.default_rng([task.seed, 0x5EED])
    start = _start_pose(task, lab, tables, generator)
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction=math.degrees(start[2])),))
    simulation = Simulation(lab, grid, parameters, seed=task.seed)
    robot = simulation.register(RobotRegistration(name="judged", sensor_angles=tuple(enumerate(angles))))
    assert robot is not None
    pose_filter = _pose_filter(task, lab, tables, parameters)
    reachable = _reachable(tables, start)
    driver = _driver(task, lab, parameters, angles, tables, reachable, generator)
    record = _Record(task, start, float(reachable.sum()) * tables.lattice.resolution**2)
    measures = simulation.launch()[robot]
    command: Command | None = None
    for cycle in range(task.cycles + 1):
        begin = time.thread_time()
        pose_filter.observe(measures, command)
        found = pose_filter.estimate()
        middle = time.thread_time()
        command, finished = driver(measures, pose_filter)
        end = time.thread_time()
        record.times.append((middle - begin, end - middle))
        pose = simulation.poses()[0]
        record.take(cycle, pose, pose_filter, collision=bool(measures.collision))
        if finished == "arrived" and record.arrived is None:
            record.arrived = cycle
        if task.kidnap and cycle + 1 == task.kidnap:
            elsewhere = _elsewhere(tables, pose, generator)
            simulation.place(robot, *elsewhere)
            record.kidnapped = cycle + 1
        if _over(task, record, finished, found.certain):
            break
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    return record.outcome(simulation.robots[0].collisions, pose_filter)


def _pose_filter(task: Task, lab: Lab, tables: PoseTables, parameters: Parameters) -> PoseFilter:
    if not task.staged or task.resolution >= COARSE:
        return PoseFilter(lab, tables, parameters, start=task.prior)
    coarse = _tables(task.lab, _angles(task), COARSE)
    return StagedFilter(lab, coarse, tables, parameters, start=task.prior)


def _over(task: Task, record: _Record, finished: str | None, certain: bool) -> bool:
    """Whether nothing more is to be learnt from a run."""
    if finished == "arrived":
        return True
    if task.kidnap:
        return record.found is not None
    known = record.first_right
    return bool(task.settle and known is not None and record.cycles >= known + task.settle)


def _angles(task: Task) -> tuple[float, float, float, float]:
    return RIGHT_ANGLES if task.drive == "right" else ANGLES


def _driver(
    task: Task,
    lab: Lab,
    parameters: Parameters,
    angles: tuple[float, float, float, float],
    tables: PoseTables,
    reachable: NDArray[np.bool_],
    generator: np.random.Generator,
) -> Driver:
    if task.drive == "right":
        return _right_driver(parameters, angles)
    goal = None
    if task.drive == "goto":
        roomy = np.flatnonzero(reachable & (tables.lattice.clearance >= 0.7))
        chosen = int(generator.choice(roomy))
        goal = (float(tables.lattice.x[chosen]), float(tables.lattice.y[chosen]))
    stop = task.drive != "active"  # in an evaluation the run goes on, to see whether the claim lasts
    drive = make_drive(task.drive, lab, parameters, angles, goal=goal, stop_when_localized=stop)

    def decide(measures: Measures, pose_filter: PoseFilter) -> tuple[Command, str | None]:
        decision = drive.decide(measures, pose_filter)
        return decision.command, decision.finished

    return decide


def _right_driver(parameters: Parameters, angles: tuple[float, float, float, float]) -> Driver:
    """Build the published drive: align to the right, drive right, stand before the wall."""
    from agent.controller import Controller
    from agent.runrecords import RunHeader

    header = RunHeader(lab_name="", lab_sha256="", parameters=parameters, sensor_angles=angles)
    controller = Controller(header)

    def decide(measures: Measures, pose_filter: PoseFilter) -> tuple[Command, str | None]:
        _, actions = controller.observe(measures)
        if actions is None or actions.left_motor is None or actions.right_motor is None:
            return (0.0, 0.0), None
        return (actions.left_motor, actions.right_motor), None

    return decide


# --- where robots start -----------------------------------------------------------------------------


def _start_pose(task: Task, lab: Lab, tables: PoseTables, generator: np.random.Generator) -> Pose:
    lattice = tables.lattice
    if task.start == "grid":
        grid = read_grid(find_grid(task.lab if task.grid is None else task.grid))
        positions = [p for p in grid.positions if _clearance_at(tables, p.x, p.y) >= 0.5 - 1e-6]
        position = positions[task.seed % len(positions)]
        return position.x, position.y, math.radians(position.direction)
    if task.start == "centres":
        centred = (np.abs(lattice.x % 2.0 - 1.0) < 1e-6) & (np.abs(lattice.y % 2.0 - 1.0) < 1e-6)
        chosen = int(generator.choice(np.flatnonzero(centred & (lattice.clearance >= 0.5 - 1e-6))))
        turn = math.pi / 2.0 * int(generator.integers(4))
        return float(lattice.x[chosen]), float(lattice.y[chosen]), math.remainder(turn, 2.0 * math.pi)
    return _free_pose(tables, generator, np.ones(lattice.size, np.bool_))


def _free_pose(tables: PoseTables, generator: np.random.Generator, allowed: NDArray[np.bool_]) -> Pose:
    lattice = tables.lattice
    roomy = np.flatnonzero(allowed & (lattice.clearance >= _LEAST_CLEARANCE + lattice.resolution / 2.0**0.5))
    chosen = int(generator.choice(roomy))
    shift = generator.uniform(-0.5, 0.5, 2) * lattice.resolution
    turn = generator.uniform(-math.pi, math.pi)
    return float(lattice.x[chosen] + shift[0]), float(lattice.y[chosen] + shift[1]), float(turn)


def _elsewhere(tables: PoseTables, pose: NDArray[np.float64], generator: np.random.Generator) -> Pose:
    lattice = tables.lattice
    return _free_pose(tables, generator, np.hypot(lattice.x - pose[0], lattice.y - pose[1]) > _FAR)


def _clearance_at(tables: PoseTables, x: float, y: float) -> float:
    from agent.drives.outlook import clearance

    return float(clearance(tables.lattice, np.array([x]), np.array([y]))[0])


def _reachable(tables: PoseTables, start: Pose) -> NDArray[np.bool_]:
    """Squares that can be reached from a pose."""
    lattice = tables.lattice
    near = int(np.hypot(lattice.x - start[0], lattice.y - start[1]).argmin())
    free = np.append(lattice.clearance >= 0.5 - 1e-6, False)
    seen = np.zeros(lattice.size + 1, np.bool_)
    seen[near] = True
    queue = deque([near])
    steps = [lattice.neighbours(dx, dy) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    while queue:
        square = queue.popleft()
        for step in steps:
            other = int(step[square])
            if free[other] and not seen[other]:
                seen[other] = True
                queue.append(other)
    return seen[:-1]


# --- what is recorded ---------------------------------------------------------------------------------


class _Record:
    def __init__(self, task: Task, start: Pose, room: float) -> None:
        self.task = task
        self.start = [start[0], start[1], math.degrees(start[2])]
        self.room = room
        self.times: list[tuple[float, float]] = []
        self.cycles = 0
        self.first_right: int | None = None
        self.first_claim: int | None = None
        self.first_claim_wrong = False
        self.claimed = self.wrongly = self.colliding = 0
        self.kidnapped: int | None = None
        self.noticed: int | None = None
        self.found: int | None = None
        self.arrived: int | None = None
        self.truth: list[float] = []
        self.calibration = [[0, 0] for _ in range(10)]
        self.place_error = self.turn_error = math.nan
        self.final_claim = False

    def take(
        self, cycle: int, pose: NDArray[np.float64], pose_filter: PoseFilter, *, collision: bool
    ) -> None:
        """Compare the filter with the true pose after a cycle."""
        found = pose_filter.estimate()
        self.cycles = cycle
        self.place_error = math.hypot(found.x - pose[0], found.y - pose[1])
        turn = math.remainder(found.heading - pose[2], 2.0 * math.pi)
        self.turn_error = abs(math.degrees(turn))
        right = self.place_error <= CLAIM_RADIUS and abs(turn) <= CLAIM_TURN
        self.final_claim = found.certain
        self.colliding += collision
        entry = self.calibration[min(int(found.probability * 10.0), 9)]
        entry[0] += 1
        entry[1] += right
        if found.certain:
            self.claimed += 1
            self.wrongly += not right
            if self.first_claim is None:
                self.first_claim, self.first_claim_wrong = cycle, not right
            if right and self.first_right is None:
                self.first_right = cycle
        if self.kidnapped is not None and cycle >= self.kidnapped:
            since = cycle - self.kidnapped
            restarted = any(at >= self.kidnapped for at in pose_filter.restarts)
            if self.noticed is None and (restarted or not found.certain):
                self.noticed = since
            if self.found is None and found.certain and right:
                self.found = since
        if cycle % 10 == 0:
            self.truth.append(round(probability_near(pose_filter.belief, pose[0], pose[1], pose[2]), 4))

    def outcome(self, collisions: int, pose_filter: PoseFilter) -> Outcome:
        """Sum up."""
        times = 1000.0 * np.array(self.times)
        quantiles = np.round(np.quantile(times, [0.5, 0.99, 1.0], axis=0), 3)
        return Outcome(
            cycles=self.cycles,
            start=[round(value, 4) for value in self.start],
            room=round(self.room, 1),
            first_right=self.first_right,
            first_claim=self.first_claim,
            first_claim_wrong=self.first_claim_wrong,
            claimed=self.claimed,
            wrongly=self.wrongly,
            final_claim=self.final_claim,
            final_place_error=round(self.place_error, 4),
            final_turn_error=round(self.turn_error, 3),
            collisions=collisions,
            colliding=self.colliding,
            restarts=list(pose_filter.restarts),
            kidnapped=self.kidnapped,
            noticed=self.noticed,
            found=self.found,
            arrived=self.arrived,
            truth=self.truth,
            calibration=self.calibration,
            filter_ms=quantiles[:, 0].tolist(),
            drive_ms=quantiles[:, 1].tolist(),
            given_up=round(pose_filter.belief.given_up, 6),
        )
