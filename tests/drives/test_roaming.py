"""Legs and their safety: no standing still before what the belief expects, no turn into a wall."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from agent.drives import make_drive
from agent.drives.roam import Barred
from agent.drives.safety import Bumper
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.tables.pose_tables import PoseTables, build_tables
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
QUIET = dataclasses.replace(Parameters(), motors_noise=0.0, obstacle_noise=0.0, compass_sensor=False)


@pytest.fixture(scope="module")
def room() -> Lab:
    wall = Wall(height=4.0, corners=((3.9, 0.0), (4.1, 0.0), (4.1, 2.5), (3.9, 2.5)))
    return Lab(name="room", width=8.0, height=4.0, walls=(wall,))


@pytest.fixture(scope="module")
def tables(room: Lab) -> PoseTables:
    return build_tables(room, ANGLES, 2.0 / 9.0)


def drive(
    lab: Lab,
    tables: PoseTables,
    start: tuple[float, float, float],
    name: str,
    cycles: int,
    parameters: Parameters,
    believed: tuple[float, float, float] | None = None,
) -> tuple[np.ndarray, int]:
    """Poses of a run, and how often it ran into something; the belief may be fixed to a wrong pose."""
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    simulation = Simulation(lab, grid, parameters, seed=4)
    robot = simulation.register(RobotRegistration(name="r", sensor_angles=tuple(enumerate(ANGLES))))
    assert robot is not None
    pose_filter = GridFilter(lab, tables, parameters)
    policy = make_drive(name, lab, parameters, ANGLES, stop_when_localized=False)
    measures, command, poses = simulation.launch()[robot], None, []
    for _ in range(cycles):
        if believed is None:
            pose_filter.observe(measures, command)
        else:
            lattice = tables.lattice
            square = np.hypot(lattice.x - believed[0], lattice.y - believed[1]).argmin()
            turned = round(believed[2] / 5.0) % 72
            pose_filter.belief.set_states(np.array([turned]), np.array([square]))
        command = policy.decide(measures, pose_filter).command
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
        poses.append(simulation.poses()[0].copy())
    return np.array(poses), simulation.robots[0].collisions


@pytest.mark.parametrize("name", ["explore", "active"])
@pytest.mark.parametrize(
    "start", [(1.0, 0.56, 0.0), (3.3, 3.4, 64.0), (7.4, 0.56, -57.0), (0.6, 3.44, 180.0)]
)
def test_a_start_beside_a_wall_is_left(
    room: Lab, tables: PoseTables, start: tuple[float, float, float], name: str
) -> None:
    parameters = dataclasses.replace(Parameters(), compass_sensor=False, obstacle_noise=0.4, motors_noise=5.0)
    poses, collisions = drive(room, tables, start, name, 60, parameters)
    assert np.hypot(poses[:, 0] - start[0], poses[:, 1] - start[1]).max() > 1.5
    assert collisions == 0


def test_a_wrong_belief_does_not_hold_the_robot(room: Lab, tables: PoseTables) -> None:
    # It stands in the open, and is sure to stand with its face to the wall, in a corner.
    poses, collisions = drive(room, tables, (1.0, 2.0, 0.0), "explore", 80, QUIET, believed=(3.4, 0.6, 0.0))
    assert np.hypot(poses[:, 0] - 1.0, poses[:, 1] - 2.0).max() > 0.8
    assert collisions == 0


@pytest.mark.parametrize("start", [(0.65, 0.65, 120.0), (0.75, 0.56, 0.0)])
def test_a_wrong_belief_does_not_hold_the_robot_in_a_corner(
    room: Lab, tables: PoseTables, start: tuple[float, float, float]
) -> None:
    # Not in the open, and no way is free by the belief, whatever the turn: IR alone decides in the end.
    believed = (7.4, 3.4, 0.0) if start[2] else (3.4, 0.6, 0.0)
    poses, collisions = drive(room, tables, start, "explore", 120, QUIET, believed=believed)
    assert np.hypot(poses[:, 0] - start[0], poses[:, 1] - start[1]).max() > 0.8
    assert collisions == 0


def test_directions_are_never_all_barred() -> None:
    bumper = Bumper(ANGLES, 0.1)
    bumper.observe((0.5, 0.5, 0.5, 0.5))
    turns = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    barred = Barred()
    for _ in range(20):
        barred.add()
        closed = barred.closed(turns, bumper)
        assert closed[0]
        assert not closed.all()
        barred.turn(math.radians(70.0))


def test_a_failed_direction_is_barred_until_the_robot_has_moved_on() -> None:
    bumper = Bumper(ANGLES, 0.1)
    bumper.observe((0.5, 0.5, 0.5, 0.5))
    turns = np.deg2rad(np.array([-90.0, -30.0, 0.0, 30.0, 90.0, 180.0]))
    barred = Barred()
    assert not barred.closed(turns, bumper).any()
    barred.add()
    assert barred.closed(turns, bumper).tolist() == [False, True, True, True, False, False]
    barred.turn(math.radians(90.0))  # the failed direction is now to the right
    assert barred.closed(turns, bumper).tolist() == [True, False, False, False, False, False]
    barred.add()
    assert barred.closed(turns, bumper).tolist() == [True, True, True, True, False, False]
    barred.clear()
    assert not barred.closed(turns, bumper).any()


@pytest.mark.parametrize(
    ("infrared", "sign"),
    [((30.0, 1.0, 1.0, 1.0), -1), ((1.0, 1.0, 1.0, 30.0), 1), ((30.0, 1.0, 1.0, 30.0), 0), ((2.0,) * 4, 0)],
)
def test_a_turn_in_place_keeps_off_what_is_touched(infrared: tuple[float, ...], sign: int) -> None:
    bumper = Bumper(ANGLES, 0.1)
    bumper.observe(infrared)
    assert np.sign(bumper.retreat) == sign


def test_the_robot_backs_off_what_it_ran_into(room: Lab, tables: PoseTables) -> None:
    # Both sensors miss a corner between their cones: nothing but the collision tells.
    pose_filter = GridFilter(room, tables, QUIET)
    policy = make_drive("explore", room, QUIET, ANGLES)
    open_ahead = Measures(time=0, infrared=(0.5, 0.5, 0.5, 0.5), collision=False)
    command = None
    for time in range(20):
        measures = dataclasses.replace(open_ahead, time=time)
        command = policy.decide(measures, pose_filter).command
        if command[0] + command[1] > 0.2:
            break
    assert command is not None
    assert command[0] + command[1] > 0.2
    wheels, way = list(command), 0.0
    for time in range(20, 23):
        measures = dataclasses.replace(open_ahead, time=time, collision=time == 20)
        command = policy.decide(measures, pose_filter).command
        wheels = [(c + w) / 2.0 for c, w in zip(command, wheels, strict=True)]
        way += sum(wheels) / 2.0
    assert sum(wheels) < 0.0
    assert way < 0.0
