"""Running cycles in machine code: `simulator_stub.cycle_loops` for the robots of one simulation.

It does what the modules of motion and sensors do in such a cycle, to the last bit, for robots with the usual
sensors that are not late, and writes their messages. What it leaves undecided it leaves alone: places that
have no list of faces yet, sensors that lie exactly on a face, readings and rims of targets that hang on
rounding.
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
from ciberrato.protocol.measures_text import HEAD_PIECES, TAILS
from ciberrato.world.lab import Lab
from simulator_stub.sensors.base import Scene
from simulator_stub.sensors.line import TEXTS
from simulator_stub.world.floor import Floor
from simulator_stub.world.floor_tables import FloorTables
from simulator_stub.world.robot_state import MOVING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ciberrato.arrays import Integers
    from simulator_stub.sensors import Equipment
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

_IN, _OUT = struct.Struct("=9d"), struct.Struct("=18d")
"""Rows of both arrays, what is needed of them; see `simulator_stub.cycle_loops.cycle`."""

_ROW = 13 * 8
"""Bytes of a row of the first, mounting angles included."""

_AHEAD = 16
"""Cycles for which random numbers are laid out in advance."""

_PIECES = (*HEAD_PIECES, "Yes", "No", *TAILS.values())
_WIDTH = 1024
"""Bytes for a message, of 350 to 500, or a piece of one and its length."""


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
        # Lines of very large labs are looked for in Python.
        self._looks_down = FloorTables.fit(world.floor)
        floor = FloorTables(world.floor if self._looks_down else Floor(Lab()))
        ends: Integers = floor.corner_first
        self._floor = floor.first
        self._polygons = np.stack((ends[floor.polygons], ends[floor.polygons + 1]), axis=-1)
        self._corners = floor.corners
        targets = [(target.x, target.y, target.radius - ROBOT_RADIUS) for target in world.lab.targets]
        deviations = (
            parameters.motors_noise / 100.0,
            parameters.obstacle_noise,
            parameters.compass_noise * math.pi / 180.0,
        )
        self._fixed = np.array([deviations, (*floor.origin, 0.0), *targets], np.float64)
        self._late = any(
            (parameters.obstacle_latency, parameters.compass_latency, parameters.ground_latency)
        ) or bool(parameters.collision_latency)
        self._pieces = _rows(_PIECES)
        self._sent = 0, (False, False)
        self._make_room([], [])
        self._call(0, 0)  # compiled, or read from the disk, before the first robot waits for it

    def __deepcopy__(self, memo: dict[int, object]) -> CompiledCycle:
        return CompiledCycle(self._world)

    def _make_room(self, equipment: list[Equipment], robots: Sequence[Robot]) -> None:
        """Prepare for these robots."""
        self._of = list(robots)
        self._equipment = equipment
        self._usual = all(one.usual is not None for one in equipment) and not self._late
        # Per robot: sensors, and streams of random numbers.
        self._plan: list[tuple[Any, ...]] = []
        self._robots = np.zeros((len(equipment), 13))
        self._noise = np.zeros((_AHEAD, len(equipment), 8))
        self._turn = _AHEAD
        for row, (robot, one) in enumerate(zip(robots, equipment, strict=True)):
            if one.usual is not None:
                collision, compass, ground, infrared, line, hearing = one.usual
                streams = robot.motor_noise, infrared.noise[True], compass.noise[True], line.wrong[True]
                self._plan.append((collision, compass, ground, infrared, line, hearing, *streams))
                self._robots[row, 9:] = infrared.axes
        self._results = np.zeros((len(equipment), 18))
        self._texts = np.concatenate((self._pieces, np.zeros((len(equipment), _WIDTH), np.uint8)))
        self._in = self._robots.data.cast("B") if equipment else memoryview(b"")
        self._out = self._results.data.cast("B") if equipment else memoryview(b"")
        self._written = self._texts.data.cast("B")
        self._sizes = [0] * len(equipment)

    def _call(self, time: int, buttons: int) -> bool:
        tables = self._tables
        decided: bool = self._kernel(
            time, buttons, self._turn, self._robots, self._noise, self._fixed, tables.faces, tables.row_of,
            tables.seen, tables.touched, tables.touched_count, self._floor, self._polygons, self._corners,
            self._texts, self._results,
        )  # fmt: skip
        return decided

    def run(
        self,
        robots: Sequence[Robot],
        equipment: Mapping[int, Equipment],
        speakers: Sequence[Robot],
        time: int,
        buttons: tuple[bool, bool],
    ) -> bool:
        """Move robots and measure, if all of it can be decided here.

        Parameters
        ----------
        robots : sequence of Robot
            All that are not removed.
        equipment : mapping of int to Equipment
            By robot id.
        speakers : sequence of Robot
            Those that say something.
        time : int
            Simulated cycles, this one included.
        buttons : (bool, bool)
            Start and Stop.

        Returns
        -------
        bool
            False if nothing has changed, and the cycle is still to be computed.
        """
        if robots != self._of:
            self._make_room([equipment[robot.robot_id] for robot in robots], robots)
        if not self._usual:
            return False
        if self._turn == _AHEAD:
            self._look_ahead()
        rows, plan = self._in, self._plan
        place = 0
        for robot in robots:
            _IN.pack_into(
                rows, place,
                robot.x, robot.y, robot.heading, robot.left_command, robot.right_command,
                robot.left_output, robot.right_output, robot.state in MOVING,
                16 * robot.end_led + 8 * robot.returning_led + 4 * robot.visiting_led,
            )  # fmt: skip
            place += _ROW
        self._sent = time, buttons
        start, stop = buttons
        while not self._call(time, 2 * start + stop):
            if not self._learn():
                self._turn = _AHEAD  # the numbers are drawn elsewhere
                return False
        self._turn += 1
        rows, sizes = self._out, self._sizes
        place = 0
        for number, robot in enumerate(robots):
            collision, compass, ground, infrared, line, hearing, motors, axes, turn, wrong = plan[number]
            (
                robot.left_output, robot.right_output, x, y, heading, wall, other,
                ir0, ir1, ir2, ir3, compass.reading, target, robot.x, robot.y, robot.heading, marks, size,
            ) = _OUT.unpack_from(rows, place)  # fmt: skip
            place += _OUT.size
            robot.wanted = (x, y, heading)
            # As `simulator_stub.world.motion.commit` does.
            before = robot.collided_before = robot.touches_wall or robot.touches_robot
            robot.touches_wall = wall != 0.0
            robot.touches_robot = other != 0.0
            collision.reading = collides = robot.touches_wall or robot.touches_robot
            if collides and not before and robot.state in MOVING:
                robot.collisions += 1
            infrared.reading = (ir0, ir1, ir2, ir3)
            ground.reading = int(target)
            if self._motors:
                motors.position += 2
            axes.position += 4
            turn.position += 1
            if self._looks_down:
                wrong.pop()
                line.reading = TEXTS[int(marks)]
                sizes[number] = int(size)
            else:
                line.update(robot, Scene(robots, time, True))
            if hearing.heard or speakers:
                hearing.update(robot, Scene(robots, time, True, speakers))
        return True

    def datagrams(self) -> dict[int, bytes]:
        """Return what `Equipment.encoded` does for each robot, after `run` has returned True."""
        written, begin = self._written, len(_PIECES) * _WIDTH
        found = {}
        for robot, one, plan, size in zip(self._of, self._equipment, self._plan, self._sizes, strict=True):
            if size and not plan[5].heard:
                found[robot.robot_id] = bytes(written[begin : begin + size])
            else:
                found[robot.robot_id] = one.encoded(robot, *self._sent)
            begin += _WIDTH
        return found

    def _look_ahead(self) -> None:
        """Write the random numbers of the next cycles into rows; they stay in their streams."""
        for number, (_, _, _, _, line, _, motors, axes, turn, _) in enumerate(self._plan):
            noise = self._noise[:, number]
            if self._motors:
                noise[:, :2] = np.reshape(motors.peek(2 * _AHEAD), (_AHEAD, 2))
            noise[:, 2:6] = np.reshape(axes.peek(4 * _AHEAD), (_AHEAD, 4))
            noise[:, 6] = turn.peek(_AHEAD)
            noise[:, 7] = line.peek(_AHEAD)
        self._turn = 0

    def _learn(self) -> bool:
        """Create lists of faces for where the robots go; return whether any was missing."""
        tables, out = self._tables, self._results
        known = tables.squares
        axes = out[:, 15:16] + self._robots[:, 9:]
        x = np.concatenate((out[:, 2], (out[:, 13:14] + SENSOR_OFFSET * np.cos(axes)).ravel()))
        y = np.concatenate((out[:, 3], (out[:, 14:15] + SENSOR_OFFSET * np.sin(axes)).ravel()))
        tables.rows_at(x, y)
        return tables.squares > known


def _rows(pieces: Sequence[str]) -> NDArray[np.uint8]:
    """Return texts as rows of bytes, each with its length in the last two."""
    rows = np.zeros((len(pieces), _WIDTH), np.uint8)
    for row, piece in zip(rows, pieces, strict=True):
        data = piece.encode()
        row[: len(data)] = np.frombuffer(data, np.uint8)
        row[-2:] = len(data) % 256, len(data) // 256
    return rows
