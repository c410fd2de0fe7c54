"""One cycle of a batch with numpy alone; each function is for the robots in one lab."""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.geometry.angles import wrap_each_once
from ciberrato.infrared.cone_arrays import many_cone_distances
from ciberrato.infrared.exact import exact_distance, hang_on_rounding
from ciberrato.infrared.face_tables import touching
from ciberrato.infrared.model import CONTACT, SATURATION, SENSOR_OFFSET
from simulator_stub.batch.motion import cosines_and_sines
from simulator_stub.batch.plan import LabPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.ground import NOWHERE
from simulator_stub.sensors.line import AHEAD, SIDEWAYS
from simulator_stub.world.floor import inside_any

_CLOSE = 1e-9
"""Units: nearer to the rim of a target than that, only `math` decides."""


def move(lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None) -> None:
    """Apply the motors and move the robots.

    Parameters
    ----------
    lab : LabPlan
    robots : array of int, shape (n,)
        Numbers of their worlds.
    state : BatchState
        Changed in place.
    noise : array, shape (worlds, 2), or None
        Standard normal numbers for the right and left motors; None where motors have no noise.
    """
    right = (state.right_command[robots] + state.right_output[robots]) / 2.0
    left = (state.left_command[robots] + state.left_output[robots]) / 2.0
    if noise is not None:
        deviation = state.motor_deviation[robots]
        right *= 1.0 + deviation * noise[robots, 0]
        left *= 1.0 + deviation * noise[robots, 1]
    state.right_output[robots], state.left_output[robots] = right, left
    speed = (right + left) / 2.0
    heading, moves = state.heading[robots], state.moves[robots]
    cosine, sine = cosines_and_sines(heading)
    x, y = state.x[robots] + speed * cosine, state.y[robots] + speed * sine
    state.heading[robots] = np.where(moves, wrap_each_once(heading + (right - left)), heading)
    collides = touching(lab.tables, x, y)
    begins = collides & ~state.collides[robots] & moves
    state.collision_begins[robots] = begins
    state.collisions[robots] += begins
    state.collides[robots] = collides
    free = moves & ~collides
    there = robots[free]
    state.x[there], state.y[there] = x[free], y[free]


def sense(
    lab: LabPlan,
    robots: Integers,
    state: BatchState,
    noise: tuple[Floats | None, Floats | None],
    out: tuple[Floats, Floats, Integers],
) -> None:
    """Read IR sensors, compasses and ground sensors.

    Parameters
    ----------
    lab, robots, state
        As for `move`.
    noise : (array or None, array or None)
        Standard normal numbers of IR, shape (worlds, 4), and compasses, shape (worlds, 1); None where no
        robot has noise.
    out : (array, array, array of int)
        Filled in at the robots: IR, shape (worlds, 4); compass in degrees; ground.
    """
    infrared, compass, ground = out
    infrared[robots] = _infrared(lab, robots, state, noise[0])
    angles = state.heading[robots]
    if noise[1] is not None:
        angles = angles + state.compass_deviation[robots] * noise[1][robots, 0]
    compass[robots] = np.floor(wrap_each_once(angles) * 180.0 / math.pi + 0.5)
    ground[robots] = inside(lab, state.x[robots], state.y[robots])


def _infrared(lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None) -> Floats:
    directions = state.heading[robots, np.newaxis] + state.angles
    axes = wrap_each_once(directions)
    cosine, sine = cosines_and_sines(axes)
    x = state.x[robots, np.newaxis] + SENSOR_OFFSET * cosine
    y = state.y[robots, np.newaxis] + SENSOR_OFFSET * sine
    distances = many_cone_distances(lab.tables, *(array.ravel() for array in (x, y, axes, cosine, sine)))
    deviation = state.obstacle_deviation[robots, np.newaxis]
    silent = np.broadcast_to(deviation == 0.0, axes.shape).ravel()
    exactly = (np.abs(axes) > math.pi).ravel()
    if silent.any():
        exactly |= silent & hang_on_rounding(distances)
    for sensor in np.flatnonzero(exactly).tolist():
        robot = int(robots[sensor // state.angles.size])
        place = float(state.x[robot]), float(state.y[robot]), float(directions.flat[sensor])
        distances[sensor] = exact_distance(lab.world.walls, *place, SENSOR_OFFSET)
    usable = (distances > CONTACT) & (distances < np.inf)
    readings = np.divide(1.0, distances, out=np.full(distances.shape, SATURATION), where=usable)
    readings = readings.reshape(axes.shape)
    if noise is not None:
        readings += deviation * noise[robots]
    return np.asarray(np.floor(10.0 * readings + 0.5) / 10.0)


def inside(lab: LabPlan, x: Floats, y: Floats, *, first: bool = False) -> Integers:
    """Find the targets that whole robots are in.

    Parameters
    ----------
    lab : LabPlan
    x, y : array, shape (n,)
        Units.
    first : bool
        Whether to take the first of several targets, as scores do, and not the last, as sensors do.

    Returns
    -------
    array of int, shape (n,)
        -1 for none.
    """
    found = np.full(x.size, NOWHERE, np.int64)
    numbered = list(enumerate(lab.targets.tolist()))
    for number, (target_x, target_y, reach) in reversed(numbered) if first else numbered:
        dx, dy = x - target_x, y - target_y
        distance = np.sqrt(dx * dx + dy * dy)
        within = distance <= reach
        for robot in np.flatnonzero(np.abs(distance - reach) < _CLOSE).tolist():
            within[robot] = math.hypot(float(dx[robot]), float(dy[robot])) <= reach
        found[within] = number
    return found


def line(lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None, marks: Booleans) -> None:
    """Read the line sensors.

    Parameters
    ----------
    lab, robots, state
        As for `move`.
    noise : array, shape (worlds, 7), or None
        Numbers uniform in [0, 1); None where all elements are right.
    marks : array of bool, shape (worlds, 7)
        Filled in at the robots.
    """
    cosine, sine = cosines_and_sines(state.heading[robots])
    ahead_x, ahead_y = state.x[robots] + AHEAD * cosine, state.y[robots] + AHEAD * sine
    floor = lab.world.floor
    places = zip(*(array.tolist() for array in (robots, ahead_x, ahead_y, cosine, sine)), strict=True)
    for robot, x, y, along, across in places:
        outlines = floor.around(x, y)
        for element, side in enumerate(SIDEWAYS):
            marks[robot, element] = bool(outlines) and inside_any(
                outlines, x - side * across, y + side * along
            )
    if noise is not None:
        marks[robots] ^= noise[robots] >= state.line_probability[robots, np.newaxis]
