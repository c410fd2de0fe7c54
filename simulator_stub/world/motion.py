"""One running cycle of motion: motors, wanted poses, collisions, new poses."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin
from typing import TYPE_CHECKING

from ciberrato.geometry.angles import wrap_once
from ciberrato.physics.collisions import resolve_collisions
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.world.robot_state import MOVING

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


def move(world: World, robots: Sequence[Robot]) -> None:
    """Move robots by one cycle and set their collision flags and counters.

    The motors of a robot that does not move (stopped or finished) run all the same, and it can be bumped
    into; only its pose and its count of collisions stay. A robot that collides keeps its place and takes its
    new heading.

    Parameters
    ----------
    world : World
    robots : sequence of Robot
        All robots that are not removed, in order of their ids.
    """
    deviation = world.parameters.motors_noise / 100.0
    for robot in robots:
        _run_motors(robot, deviation)
    if len(robots) == 1:
        x, y, _ = robots[0].wanted
        commit(robots[0], touches_wall=world.walls.touches(x, y, ROBOT_RADIUS), touches_robot=False)
        return
    wall, robot_in_way = resolve_collisions(
        world.walls,
        [(robot.x, robot.y, robot.heading) for robot in robots],
        [robot.wanted for robot in robots],
        [(robot.left_output + robot.right_output) / 2.0 for robot in robots],
    )
    for robot, touches_wall, touches_robot in zip(robots, wall, robot_in_way, strict=True):
        commit(robot, touches_wall=touches_wall, touches_robot=touches_robot)


def _run_motors(robot: Robot, deviation: float) -> None:
    """Filter the commands, with noise: the right motor draws first."""
    if deviation > 0.0:
        right, left = robot.motor_noise.normals(2)
        right_factor = 1.0 + deviation * right
        left_factor = 1.0 + deviation * left
    else:
        right_factor = left_factor = 1.0
    # As `filter_power` and `advance` do, operation by operation, without their calls.
    right_output = (robot.right_command + robot.right_output) / 2.0 * right_factor
    left_output = (robot.left_command + robot.left_output) / 2.0 * left_factor
    robot.right_output, robot.left_output = right_output, left_output
    heading = robot.heading
    speed = (right_output + left_output) / 2.0
    turn = (right_output - left_output) / (2.0 * ROBOT_RADIUS)
    robot.wanted = (
        robot.x + speed * cos(heading),
        robot.y + speed * sin(heading),
        wrap_once(heading + turn),
    )


def commit(robot: Robot, *, touches_wall: bool, touches_robot: bool) -> None:
    """Set the flags, the counter, which counts beginnings only, and the pose."""
    collided_before = robot.touches_wall or robot.touches_robot
    collides = touches_wall or touches_robot
    robot.collided_before = collided_before
    robot.touches_wall = touches_wall
    robot.touches_robot = touches_robot
    if robot.state in MOVING:
        if collides and not collided_before:
            robot.collisions += 1
        if collides:  # as `settle` does
            robot.heading = robot.wanted[2]
        else:
            robot.x, robot.y, robot.heading = robot.wanted
