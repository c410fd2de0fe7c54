"""One cycle of a batch in machine code: the loops of `simulator_stub.batch.loops`, and what they leave open.

That is: places that have no square yet, squares with very many faces, sensors that lie exactly on a face,
readings that hang on rounding, and axes that one turn does not bring within ±π.
The functions for one robot decide there. The few other sensors are the same as without machine code.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.infrared.exact import exact_distance, hangs_on_rounding
from ciberrato.infrared.model import SENSOR_OFFSET, distances_at, ideal_reading, round_reading
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.batch import loops
from simulator_stub.batch.arrays import compass, ground
from simulator_stub.batch.floortables import FloorTables
from simulator_stub.batch.plan import BatchPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.line import SIDEWAYS
from simulator_stub.world.floor import Floor

__all__ = ["compass", "ground", "infrared", "line", "move"]


_NO_NOISE = np.zeros((1, 1))


def move(plan: BatchPlan, state: BatchState, noise: Floats | None) -> None:
    """Let the motors run and the robots move, as `simulator_stub.batch.arrays.move`."""
    tables = plan.tables
    undecided = np.zeros(plan.worlds, np.bool_)
    wanted = np.empty((2, plan.worlds))
    count = loops.move(
        (state.x, state.y, state.heading),
        (state.left_command, state.right_command, state.left_output, state.right_output),
        state.collides,
        state.collisions,
        plan.motor_deviation,
        _NO_NOISE if noise is None else noise,
        tables.faces,
        tables.row_of,
        tables.touched,
        tables.touched_count,
        wanted,
        undecided,
    )
    if count:
        robots = np.flatnonzero(undecided)
        tables.rows_at(*wanted[:, robots])
        for robot in robots.tolist():
            x, y = float(wanted[0, robot]), float(wanted[1, robot])
            collides = tables.walls.touches(x, y, ROBOT_RADIUS)
            state.collisions[robot] += collides and not state.collides[robot]
            state.collides[robot] = collides
            if not collides:
                state.x[robot], state.y[robot] = x, y


def infrared(plan: BatchPlan, state: BatchState, noise: Floats | None) -> Floats:
    """Read the IR sensors, as `simulator_stub.batch.arrays.infrared`."""
    tables = plan.tables
    noise = _NO_NOISE if noise is None else noise
    readings = np.empty((plan.worlds, len(plan.angles)))
    count = loops.infrared(
        (state.x, state.y, state.heading),
        np.array(plan.angles),
        plan.obstacle_deviation,
        noise,
        tables.faces,
        tables.row_of,
        tables.seen,
        readings,
    )
    if count:
        _complete(plan, state, noise, readings)
    return readings


def _complete(plan: BatchPlan, state: BatchState, noise: Floats, readings: Floats) -> None:
    """Read the sensors that were left open."""
    robots, sensors = np.nonzero(np.isnan(readings))
    axes = state.heading[robots] + np.array(plan.angles)[sensors]
    # So that these squares are known in the next cycle.
    plan.tables.rows_at(
        state.x[robots] + SENSOR_OFFSET * np.cos(axes), state.y[robots] + SENSOR_OFFSET * np.sin(axes)
    )
    for robot, sensor, axis in zip(robots.tolist(), sensors.tolist(), axes.tolist(), strict=True):
        place = float(state.x[robot]), float(state.y[robot])
        distance = distances_at(plan.tables.walls, *place, [axis])[0]
        if plan.obstacle_deviation == 0.0 and hangs_on_rounding(distance):
            distance = exact_distance(plan.tables.walls, *place, axis, SENSOR_OFFSET)
        reading = ideal_reading(distance)
        if plan.obstacle_deviation > 0.0:
            reading += plan.obstacle_deviation * float(noise[robot, sensor])
        readings[robot, sensor] = round_reading(reading)


def line(plan: BatchPlan, state: BatchState, noise: Floats | None) -> NDArray[np.bool_]:
    """Read the line sensors, as `simulator_stub.batch.arrays.line`."""
    floor = _floor_tables(plan.world.floor)
    marks = np.empty((plan.worlds, len(SIDEWAYS)), np.bool_)
    loops.line(
        (state.x, state.y, state.heading),
        plan.world.parameters.line_sensor_true_probability if noise is not None else 1.0,
        _NO_NOISE if noise is None else noise,
        (*floor.origin, floor.first, floor.polygons, floor.corner_first, floor.corners),
        marks,
    )
    return marks


@lru_cache(maxsize=8)
def _floor_tables(floor: Floor) -> FloorTables:
    return FloorTables(floor)
