# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""The arithmetic of one cycle, robot by robot, in machine code made by numba.

The same operations in the same order as in `ciberrato.infrared.cone_scalar`,
`ciberrato.geometry.nearest_faces` and the sensors of a single simulation give the same numbers to the last
bit. What is not decided here is marked.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ciberrato.infrared.cone_compiled import distance_ahead, row_at, wrap
from ciberrato.infrared.exact import CLOSE
from ciberrato.infrared.face_tables import TOUCHED
from ciberrato.infrared.model import CONTACT, SATURATION
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.sensors.line import AHEAD, SIDEWAYS
from simulator_stub.world.floor import SQUARES_PER_UNIT as FLOOR_SQUARES_PER_UNIT

_SIDEWAYS = np.array(SIDEWAYS)

_jit = numba.njit(cache=True, error_model="numpy", nogil=True)


@_jit
def move(
    pose,
    motors,
    collides,
    collisions,
    deviation,
    noise,
    faces,
    row_of,
    touched,
    touched_count,
    wanted,
    undecided,
):
    """Move all robots; returns how many are undecided, with `wanted` the places where they would be."""
    xs, ys, headings = pose
    left_command, right_command, left_output, right_output = motors
    count = 0
    for robot in range(xs.size):
        right = (right_command[robot] + right_output[robot]) / 2.0
        left = (left_command[robot] + left_output[robot]) / 2.0
        if deviation > 0.0:
            right *= 1.0 + deviation * noise[robot, 0]
            left *= 1.0 + deviation * noise[robot, 1]
        right_output[robot] = right
        left_output[robot] = left
        speed = (right + left) / 2.0
        heading = headings[robot]
        x = xs[robot] + speed * math.cos(heading)
        y = ys[robot] + speed * math.sin(heading)
        headings[robot] = wrap(heading + (right - left))
        row = row_at(row_of, x, y)
        if row < 0 or touched_count[row] > TOUCHED:
            undecided[robot] = True
            wanted[0, robot] = x
            wanted[1, robot] = y
            count += 1
            continue
        touches = False
        for index in range(touched_count[row]):
            if _touches(faces, touched[row, index], x, y):
                touches = True
                break
        if touches:
            if not collides[robot]:
                collisions[robot] += 1
        else:
            xs[robot] = x
            ys[robot] = y
        collides[robot] = touches
    return count


@_jit
def _touches(faces, face, x, y):
    dx, dy = x - faces[face, 0], y - faces[face, 1]
    along = dx * faces[face, 7] + dy * faces[face, 8]
    if along < 0.0:
        return math.sqrt(dx * dx + dy * dy) < ROBOT_RADIUS
    if along > faces[face, 4]:
        dx, dy = x - faces[face, 5], y - faces[face, 6]
        return math.sqrt(dx * dx + dy * dy) < ROBOT_RADIUS
    return abs(dx * faces[face, 8] - dy * faces[face, 7]) < ROBOT_RADIUS


@_jit
def infrared(pose, angles, deviation, noise, faces, row_of, seen, readings):
    """Fill in `readings`; returns how many are undecided, which are nan."""
    xs, ys, headings = pose
    count = 0
    for robot in range(xs.size):
        for sensor in range(angles.size):
            axis = headings[robot] + angles[sensor]
            distance = distance_ahead(faces, row_of, seen, xs[robot], ys[robot], axis)
            if math.isnan(distance):
                readings[robot, sensor] = math.nan
                count += 1
                continue
            reading = 1.0 / distance if CONTACT < distance < math.inf else SATURATION
            if deviation > 0.0:
                reading += deviation * noise[robot, sensor]
            elif distance > 0.0:
                tenths = 10.0 / distance
                if abs(tenths - math.floor(tenths) - 0.5) < CLOSE:
                    readings[robot, sensor] = math.nan
                    count += 1
                    continue
            readings[robot, sensor] = math.floor(10.0 * reading + 0.5) / 10.0
    return count


@_jit
def line(pose, right_probability, noise, floor, marks):
    """Fill in `marks`; `floor` is a tuple of what a `FloorTables` has."""
    xs, ys, headings = pose
    origin_column, origin_row, first, polygons, corner_first, corners = floor
    for robot in range(xs.size):
        cosine, sine = math.cos(headings[robot]), math.sin(headings[robot])
        ahead_x = xs[robot] + AHEAD * cosine
        ahead_y = ys[robot] + AHEAD * sine
        column = math.floor(ahead_x * FLOOR_SQUARES_PER_UNIT) - origin_column
        row = math.floor(ahead_y * FLOOR_SQUARES_PER_UNIT) - origin_row
        begin = end = 0
        if 0 <= row < first.shape[0] and 0 <= column < first.shape[1] - 1:
            begin, end = first[row, column], first[row, column + 1]
        for element in range(_SIDEWAYS.size):
            x = ahead_x - _SIDEWAYS[element] * sine
            y = ahead_y + _SIDEWAYS[element] * cosine
            mark = False
            for index in range(begin, end):
                polygon = polygons[index]
                if _inside(corners, corner_first[polygon], corner_first[polygon + 1], x, y):
                    mark = True
                    break
            if right_probability < 1.0 and noise[robot, element] >= right_probability:
                mark = not mark
            marks[robot, element] = mark


@_jit
def _inside(corners, begin, end, x, y):
    inside = False
    previous_x, previous_y = corners[end - 1, 0], corners[end - 1, 1]
    for index in range(begin, end):
        corner_x, corner_y = corners[index, 0], corners[index, 1]
        if (corner_y > y) != (previous_y > y):
            crossing = corner_x + (y - corner_y) * (previous_x - corner_x) / (previous_y - corner_y)
            if x < crossing:
                inside = not inside
        previous_x, previous_y = corner_x, corner_y
    return inside
