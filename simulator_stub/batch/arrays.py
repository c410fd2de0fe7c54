"""One cycle of a batch with numpy alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.geometry.angles import wrap_each_once
from ciberrato.infrared.cone_arrays import many_cone_distances
from ciberrato.infrared.exact import exact_distance, hang_on_rounding
from ciberrato.infrared.face_tables import touching
from ciberrato.infrared.model import CONTACT, SATURATION, SENSOR_OFFSET
from simulator_stub.batch.motion import cosines_and_sines
from simulator_stub.batch.plan import BatchPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.ground import NOWHERE
from simulator_stub.sensors.line import AHEAD, SIDEWAYS
from simulator_stub.world.floor import inside_any

_CLOSE = 1e-9
"""Units: nearer to the rim of a target than that, only `math` decides."""


def move(plan: BatchPlan, state: BatchState, noise: Floats | None) -> None:
    """Let the motors run and the robots move.

    Parameters
    ----------
    plan : BatchPlan
    state : BatchState
        Changed in place.
    noise : array, shape (worlds, 2), or None
        Standard normal numbers for the right and left motors; None where motors have no noise.
    """
    right = (state.right_command + state.right_output) / 2.0
    left = (state.left_command + state.left_output) / 2.0
    if noise is not None:
        right *= 1.0 + plan.motor_deviation * noise[:, 0]
        left *= 1.0 + plan.motor_deviation * noise[:, 1]
    state.right_output, state.left_output = right, left
    speed = (right + left) / 2.0
    cosine, sine = cosines_and_sines(state.heading)
    x, y = state.x + speed * cosine, state.y + speed * sine
    state.heading = wrap_each_once(state.heading + (right - left))
    collides = touching(plan.tables, x, y)
    state.collisions += collides & ~state.collides
    state.collides = collides
    state.x = np.where(collides, state.x, x)
    state.y = np.where(collides, state.y, y)


def infrared(plan: BatchPlan, state: BatchState, noise: Floats | None) -> Floats:
    """Read the IR sensors.

    Parameters
    ----------
    plan : BatchPlan
    state : BatchState
    noise : array, shape (worlds, 4), or None
        Standard normal numbers.

    Returns
    -------
    array, shape (worlds, 4)
    """
    directions = state.heading[:, np.newaxis] + np.array(plan.angles)
    axes = wrap_each_once(directions)
    cosine, sine = cosines_and_sines(axes)
    x = state.x[:, np.newaxis] + SENSOR_OFFSET * cosine
    y = state.y[:, np.newaxis] + SENSOR_OFFSET * sine
    distances = many_cone_distances(plan.tables, *(array.ravel() for array in (x, y, axes, cosine, sine)))
    exactly = (np.abs(axes) > math.pi).ravel()
    if noise is None:
        exactly |= hang_on_rounding(distances)
    for sensor in np.flatnonzero(exactly).tolist():
        robot = sensor // len(plan.angles)
        place = float(state.x[robot]), float(state.y[robot]), float(directions.flat[sensor])
        distances[sensor] = exact_distance(plan.tables.walls, *place, SENSOR_OFFSET)
    usable = (distances > CONTACT) & (distances < np.inf)
    readings = np.divide(1.0, distances, out=np.full(distances.shape, SATURATION), where=usable)
    readings = readings.reshape(axes.shape)
    if noise is not None:
        readings += plan.obstacle_deviation * noise
    return np.asarray(np.floor(10.0 * readings + 0.5) / 10.0)


def compass(plan: BatchPlan, state: BatchState, noise: Floats | None) -> Floats:
    """Read the compasses; noise as above, shape (worlds, 1)."""
    angles = state.heading if noise is None else state.heading + plan.compass_deviation * noise[:, 0]
    return np.floor(wrap_each_once(angles) * 180.0 / math.pi + 0.5)


def ground(plan: BatchPlan, state: BatchState) -> NDArray[np.int64]:
    """Read the ground sensors."""
    found = np.full(plan.worlds, NOWHERE, np.int64)
    for number, (x, y, reach) in enumerate(plan.targets.tolist()):
        dx, dy = state.x - x, state.y - y
        distance = np.sqrt(dx * dx + dy * dy)
        inside = distance <= reach
        for robot in np.flatnonzero(np.abs(distance - reach) < _CLOSE).tolist():
            inside[robot] = math.hypot(float(dx[robot]), float(dy[robot])) <= reach
        found[inside] = number
    return found


def line(plan: BatchPlan, state: BatchState, noise: Floats | None) -> NDArray[np.bool_]:
    """Read the line sensors.

    Parameters
    ----------
    plan : BatchPlan
    state : BatchState
    noise : array, shape (worlds, 7), or None
        Numbers uniform in [0, 1); None where all elements are right.

    Returns
    -------
    array of bool, shape (worlds, 7)
    """
    cosine, sine = cosines_and_sines(state.heading)
    ahead_x, ahead_y = state.x + AHEAD * cosine, state.y + AHEAD * sine
    marks = np.zeros((plan.worlds, len(SIDEWAYS)), np.bool_)
    floor = plan.world.floor
    places = zip(ahead_x.tolist(), ahead_y.tolist(), cosine.tolist(), sine.tolist(), strict=True)
    for robot, (x, y, along, across) in enumerate(places):
        outlines = floor.around(x, y)
        if outlines:
            for element, side in enumerate(SIDEWAYS):
                marks[robot, element] = inside_any(outlines, x - side * across, y + side * along)
    if noise is not None:
        marks ^= noise >= plan.world.parameters.line_sensor_true_probability
    return marks
