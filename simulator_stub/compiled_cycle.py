"""Running cycles in machine code: `simulator_stub.cycle_loops` for the robots of one simulation.

It does what the modules of motion and sensors do in such a cycle, to the last bit, for robots with the usual
sensors that are not late. What it leaves undecided it leaves alone: places that have no list of faces yet,
sensors that lie exactly on a face, readings and rims of targets that hang on rounding.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ciberrato.infrared.face_tables import tables_of
from ciberrato.infrared.model import SENSOR_OFFSET
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.world.motion import commit
from simulator_stub.world.robot_state import MOVING

if TYPE_CHECKING:
    from simulator_stub.sensors import Equipment, Scene
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

_IN, _OUT = struct.Struct("=15d"), struct.Struct("=13d24x")
"""Rows of both arrays, what is needed of them; see `simulator_stub.cycle_loops.cycle`."""


class CompiledCycle:
    """Cycles of the robots in a world.

    Parameters
    ----------
    world : World
    """

    def __init__(self, world: World) -> None:
        from simulator_stub.cycle_loops import cycle

        parameters = world.parameters
        self._world = world
        self._kernel = cycle
        self._tables = tables_of(world.walls)
        self._motors = parameters.motors_noise > 0.0
        self._deviations = np.array(
            [
                parameters.motors_noise / 100.0,
                parameters.obstacle_noise,
                parameters.compass_noise * math.pi / 180.0,
            ]
        )
        targets = [(target.x, target.y, target.radius - ROBOT_RADIUS) for target in world.lab.targets]
        self._targets = np.array(targets, np.float64).reshape(-1, 3)
        self._late = any(
            (parameters.obstacle_latency, parameters.compass_latency, parameters.ground_latency)
        ) or bool(parameters.collision_latency)
        self._equipment: list[Equipment] = []
        self._make_room([], [])
        self._call()  # compiled, or read from the disk, before the first robot waits for it

    def __deepcopy__(self, memo: dict[int, object]) -> CompiledCycle:
        return CompiledCycle(self._world)

    def _make_room(self, equipment: list[Equipment], robots: Sequence[Robot]) -> None:
        """Prepare for these robots."""
        self._equipment = equipment
        self._usual = all(one.usual is not None for one in equipment) and not self._late
        angles: list[Any] = [one.usual[3].axes for one in equipment if one.usual is not None]
        # Per robot: sensors, and methods bound once.
        self._plan: list[tuple[Any, ...]] = []
        for robot, one in zip(robots, equipment, strict=True):
            if one.usual is not None:
                collision, compass, ground, infrared, line, hearing = one.usual
                draws = robot.motor_noise.normals, infrared.noise[1].normals, compass.noise[1].normal
                updates = (line.update, hearing.update)
                self._plan.append((collision, ground, infrared, *draws, updates, compass))
        self._angles = np.array(angles, np.float64).reshape(-1, 4)
        self._robots = np.zeros((len(equipment), 15))
        self._results = np.zeros((len(equipment), 16))
        self._in = self._robots.data.cast("B") if equipment else memoryview(b"")
        self._out = self._results.data.cast("B") if equipment else memoryview(b"")

    def _call(self) -> bool:
        tables = self._tables
        decided: bool = self._kernel(
            self._robots, self._deviations, self._angles, self._targets, tables.faces, tables.row_of,
            tables.seen, tables.touched, tables.touched_count, self._results,
        )  # fmt: skip
        return decided

    def run(self, robots: Sequence[Robot], equipment: Mapping[int, Equipment], scene: Scene) -> bool:
        """Move robots and measure, if all of it can be decided here.

        Parameters
        ----------
        robots : sequence of Robot
            All that are not removed.
        equipment : mapping of int to Equipment
            By robot id.
        scene : Scene
            Of a running cycle.

        Returns
        -------
        bool
            False if nothing has changed, and the cycle is still to be computed.
        """
        carried = [equipment[robot.robot_id] for robot in robots]
        if carried != self._equipment:
            self._make_room(carried, robots)
        if not self._usual:
            return False
        rows, plan = self._in, self._plan
        place = 0
        for robot, (_, _, _, motor, axes, turn, _, _) in zip(robots, plan, strict=True):
            right, left = motor(2) if self._motors else (0.0, 0.0)
            _IN.pack_into(
                rows, place,
                robot.x, robot.y, robot.heading, robot.left_command, robot.right_command,
                robot.left_output, robot.right_output, robot.state in MOVING, right, left, *axes(4), turn(),
            )  # fmt: skip
            place += _IN.size
        while not self._call():
            if not self._learn():
                self._put_back(robots)
                return False
        rows = self._out
        place = 0
        for robot, (collision, ground, infrared, _, _, _, _, compass) in zip(robots, plan, strict=True):
            (
                robot.left_output, robot.right_output, x, y, heading, wall, other,
                ir0, ir1, ir2, ir3, compass.reading, target,
            ) = _OUT.unpack_from(rows, place)  # fmt: skip
            place += _OUT.size
            robot.wanted = (x, y, heading)
            commit(robot, touches_wall=wall != 0.0, touches_robot=other != 0.0)
            collision.reading = robot.touches_wall or robot.touches_robot
            infrared.reading = (ir0, ir1, ir2, ir3)
            ground.reading = int(target)
        for robot, (_, _, _, _, _, _, updates, _) in zip(robots, plan, strict=True):
            for update in updates:
                update(robot, scene)
        return True

    def _learn(self) -> bool:
        """Create lists of faces for where the robots go; return whether any was missing."""
        tables, out = self._tables, self._results
        known = tables.squares
        axes = out[:, 15:16] + self._angles
        x = np.concatenate((out[:, 2], (out[:, 13:14] + SENSOR_OFFSET * np.cos(axes)).ravel()))
        y = np.concatenate((out[:, 3], (out[:, 14:15] + SENSOR_OFFSET * np.sin(axes)).ravel()))
        tables.rows_at(x, y)
        return tables.squares > known

    def _put_back(self, robots: Sequence[Robot]) -> None:
        """Return the random numbers to their streams: they are drawn again."""
        for robot, (_, _, infrared, _, _, _, _, compass) in zip(robots, self._plan, strict=True):
            if self._motors:
                robot.motor_noise.put_back(2)
            infrared.noise[1].put_back(4)
            compass.noise[1].put_back(1)
