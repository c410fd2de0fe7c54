"""Collisions of robots in a cycle, and the poses after them.

The simulator moves all robots at once: it works out where each wants to be
(`ciberrato.physics.kinematics.advance`), asks `resolve_collisions` who is stopped, and commits what `settle`
returns. A cycle of a simulation is::

    wanted = [advance(x, y, heading, left, right) for ...]
    speeds = [(right + left) / 2 for ...]
    wall, robot = resolve_collisions(walls, poses, wanted, speeds)
    poses = [settle(*triple) for triple in zip(poses, wanted, or_(wall, robot))]

A robot that is finished takes part with the pose that its motors want, though it is going to stay where it
is: others can run into it, and it can collide by itself. A removed robot is left out. Poses are
(x, y, heading) in units and radians.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ciberrato.geometry.walls import WallMap
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.coordinates import Pose


def resolve_collisions(
    walls: WallMap, poses: Sequence[Pose], wanted: Sequence[Pose], speeds: Sequence[float]
) -> tuple[list[bool], list[bool]]:
    """Find who runs into what.

    Parameters
    ----------
    walls : WallMap
    poses : sequence of (x, y, heading)
        Poses before the cycle.
    wanted : sequence of (x, y, heading)
        Poses after the cycle if nothing were in the way.
    speeds : sequence of float
        Mean of the two motor powers of each robot, negative when it drives backwards.

    Returns
    -------
    wall : list of bool
        Whether the wanted place is nearer than a radius to a wall. Exactly a radius is free.
    robot : list of bool
        Whether the wanted place overlaps another robot's, and the robot moves towards the other. One that
        does not goes on, even into the other.
    """
    wall = [walls.touches(x, y, ROBOT_RADIUS) for x, y, _ in wanted]
    robot = [False] * len(wanted)
    for first, (x, y, _) in enumerate(wanted):
        for second in range(first + 1, len(wanted)):
            other_x, other_y, _ = wanted[second]
            dx = x - other_x
            if -2 * ROBOT_RADIUS < dx < 2 * ROBOT_RADIUS:  # mostly not, and that is soon seen
                dy = y - other_y
                if math.sqrt(dx * dx + dy * dy) < 2 * ROBOT_RADIUS:
                    robot[first] |= _moves_towards(poses[first], poses[second], speeds[first])
                    robot[second] |= _moves_towards(poses[second], poses[first], speeds[second])
    return wall, robot


def _moves_towards(pose: Pose, other: Pose, speed: float) -> bool:
    x, y, heading = pose
    dx, dy = other[0] - x, other[1] - y
    if speed == 0.0 or (dx == 0.0 and dy == 0.0):
        return False
    ahead = math.cos(math.atan2(dy, dx) - heading)
    return ahead > 0.0 if speed > 0.0 else ahead < 0.0


def settle(pose: Pose, wanted: Pose, collides: bool) -> Pose:
    """Return the pose after the cycle: a robot that collides keeps its position, but turns as commanded.

    Parameters
    ----------
    pose, wanted : (x, y, heading)
        Before, and as wanted.
    collides : bool
        With a wall or a robot.

    Returns
    -------
    (x, y, heading)
    """
    return (pose[0], pose[1], wanted[2]) if collides else wanted
