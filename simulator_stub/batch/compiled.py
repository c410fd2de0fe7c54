"""One cycle of a batch in machine code: the loops of `simulator_stub.batch.loops`, and what they leave open.

That is: places that have no square yet, squares with very many faces, sensors that lie exactly on a face,
readings that hang on rounding, rims of targets, and axes that one turn does not bring within ±π. The
functions for one robot decide there.

Threads share the robots of a lab among them. None of them writes to what another one reads, and what is left
open is done when all have ended, so the results do not depend on how many they are.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numpy as np

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.infrared.exact import exact_distance, hangs_on_rounding
from ciberrato.infrared.model import SENSOR_OFFSET, distances_at, ideal_reading, round_reading
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.batch import loops
from simulator_stub.batch.arrays import inside
from simulator_stub.batch.plan import LabPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.world.floor import Floor
from simulator_stub.world.floor_tables import FloorTables

LEAST_SHARE = 256
"""Robots for which another thread is worth its while."""

_NO_NOISE = np.zeros((1, 1))


class CompiledKernels:
    """The functions of `simulator_stub.batch.arrays` in machine code, with the same results.

    Parameters
    ----------
    threads : int
        At most so many work at a time.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads - 1, "ciberrato-batch") if threads > 1 else None

    def _share(self, work: Callable[[Integers], int], robots: Integers) -> int:
        """Run a part in each thread; return the sum of the results."""
        shares = min(self._threads, robots.size // LEAST_SHARE)
        if self._pool is None or shares < 2:
            return work(robots)
        mine, *others = np.array_split(robots, shares)
        waiting = [self._pool.submit(work, part) for part in others]
        return work(mine) + sum(part.result() for part in waiting)

    def move(self, lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None) -> None:
        """Apply the motors and move the robots, as `simulator_stub.batch.arrays.move`."""
        tables = lab.tables
        undecided = np.zeros(state.x.size, np.bool_)
        wanted = np.empty((2, state.x.size))

        def work(part: Integers) -> int:
            count: int = loops.move(
                part,
                (state.x, state.y, state.heading),
                (state.left_command, state.right_command, state.left_output, state.right_output),
                (state.moves, state.collides, state.collision_begins, state.collisions),
                state.motor_deviation,
                _NO_NOISE if noise is None else noise,
                (tables.faces, tables.row_of, tables.touched, tables.touched_count),
                wanted,
                undecided,
            )
            return count

        if self._share(work, robots):
            open_ones = np.flatnonzero(undecided)
            tables.rows_at(*wanted[:, open_ones])
            for robot in open_ones.tolist():
                x, y = float(wanted[0, robot]), float(wanted[1, robot])
                collides = tables.walls.touches(x, y, ROBOT_RADIUS)
                moves = bool(state.moves[robot])
                begins = collides and moves and not state.collides[robot]
                state.collision_begins[robot] = begins
                state.collisions[robot] += begins
                state.collides[robot] = collides
                if moves and not collides:
                    state.x[robot], state.y[robot] = x, y

    def sense(
        self,
        lab: LabPlan,
        robots: Integers,
        state: BatchState,
        noise: tuple[Floats | None, Floats | None],
        out: tuple[Floats, Floats, Integers],
    ) -> None:
        """Read IR sensors, compasses and ground sensors, as `simulator_stub.batch.arrays.sense`."""
        tables = lab.tables
        infrared_noise, compass_noise = (_NO_NOISE if one is None else one for one in noise)

        def work(part: Integers) -> int:
            count: int = loops.sense(
                part,
                (state.x, state.y, state.heading),
                state.angles,
                (state.obstacle_deviation, state.compass_deviation),
                (infrared_noise, compass_noise),
                (tables.faces, tables.row_of, tables.seen),
                lab.targets,
                *out,
            )
            return count

        if self._share(work, robots):
            _complete(lab, robots, state, infrared_noise, out[0])
            near = robots[out[2][robots] == loops.UNDECIDED]
            out[2][near] = inside(lab, state.x[near], state.y[near])

    def line(
        self, lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None, marks: Booleans
    ) -> None:
        """Read the line sensors, as `simulator_stub.batch.arrays.line`."""
        floor = _floor_tables(lab.world.floor)

        def work(part: Integers) -> int:
            loops.line(
                part,
                (state.x, state.y, state.heading),
                state.line_probability,
                _NO_NOISE if noise is None else noise,
                (*floor.origin, floor.first, floor.polygons, floor.corner_first, floor.corners),
                marks,
            )
            return 0

        self._share(work, robots)


def _complete(lab: LabPlan, robots: Integers, state: BatchState, noise: Floats, readings: Floats) -> None:
    """Read the IR sensors that were left open."""
    rows, sensors = np.nonzero(np.isnan(readings[robots]))
    who = robots[rows]
    axes = state.heading[who] + state.angles[sensors]
    # So that these squares are known in the next cycle.
    lab.tables.rows_at(
        state.x[who] + SENSOR_OFFSET * np.cos(axes), state.y[who] + SENSOR_OFFSET * np.sin(axes)
    )
    walls = lab.world.walls
    for robot, sensor, axis in zip(who.tolist(), sensors.tolist(), axes.tolist(), strict=True):
        place = float(state.x[robot]), float(state.y[robot])
        deviation = float(state.obstacle_deviation[robot])
        distance = distances_at(walls, *place, [axis])[0]
        if deviation == 0.0 and hangs_on_rounding(distance):
            distance = exact_distance(walls, *place, axis, SENSOR_OFFSET)
        reading = ideal_reading(distance)
        if deviation > 0.0:
            reading += deviation * float(noise[robot, sensor])
        readings[robot, sensor] = round_reading(reading)


@lru_cache(maxsize=16)
def _floor_tables(floor: Floor) -> FloorTables:
    return FloorTables(floor)
