# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""The arithmetic of one cycle, robot by robot, in machine code made by numba.

The same operations in the same order as in `ciberrato.infrared.cone_scalar`,
`ciberrato.geometry.nearest_faces` and the sensors of a single simulation give the same numbers to the last
bit. What is not decided here is marked.
"""

from __future__ import annotations

import math

import numpy as np

from ciberrato.infrared.cone_compiled import distance_ahead, row_at, wrap
from ciberrato.infrared.exact import CLOSE
from ciberrato.infrared.face_tables import TOUCHED
from ciberrato.infrared.model import CONTACT, SATURATION
from ciberrato.machine_code import kept
from simulator_stub.cycle_loops import RIM, inside, touches_face
from simulator_stub.sensors.line import AHEAD, SIDEWAYS
from simulator_stub.world.floor import SQUARES_PER_UNIT as FLOOR_SQUARES_PER_UNIT

_SIDEWAYS = np.array(SIDEWAYS)
UNDECIDED = -2
"""Reading of the ground sensor nearer than `RIM` to the rim of a target."""


@kept
def move(robots, pose, motors, flags, deviation, noise, tables, wanted, undecided):
    """Move robots; returns how many are undecided, with `wanted` the places where they would be."""
    xs, ys, headings = pose
    left_command, right_command, left_output, right_output = motors
    moves, collides, collision_begins, collisions = flags
    faces, row_of, touched, touched_count = tables
    count = 0
    for robot in robots:
        right = (right_command[robot] + right_output[robot]) / 2.0
        left = (left_command[robot] + left_output[robot]) / 2.0
        if deviation[robot] > 0.0:
            right *= 1.0 + deviation[robot] * noise[robot, 0]
            left *= 1.0 + deviation[robot] * noise[robot, 1]
        right_output[robot] = right
        left_output[robot] = left
        speed = (right + left) / 2.0
        heading = headings[robot]
        x = xs[robot] + speed * math.cos(heading)
        y = ys[robot] + speed * math.sin(heading)
        if moves[robot]:
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
            if touches_face(faces, touched[row, index], x, y):
                touches = True
                break
        begins = touches and moves[robot] and not collides[robot]
        collision_begins[robot] = begins
        if begins:
            collisions[robot] += 1
        if moves[robot] and not touches:
            xs[robot] = x
            ys[robot] = y
        collides[robot] = touches
    return count


@kept
def sense(robots, pose, angles, deviations, noise, tables, targets, infrared, compass, ground):
    """Fill in the readings of robots.

    Returns how many are undecided: nan in `infrared`, `UNDECIDED` in `ground`.
    """
    xs, ys, headings = pose
    obstacle_deviation, compass_deviation = deviations
    infrared_noise, compass_noise = noise
    faces, row_of, seen = tables
    count = 0
    for robot in robots:
        x, y, heading = xs[robot], ys[robot], headings[robot]
        deviation = obstacle_deviation[robot]
        for sensor in range(angles.size):
            distance = distance_ahead(faces, row_of, seen, x, y, heading + angles[sensor])
            if math.isnan(distance):
                infrared[robot, sensor] = math.nan
                count += 1
                continue
            reading = 1.0 / distance if CONTACT < distance < math.inf else SATURATION
            if deviation > 0.0:
                reading += deviation * infrared_noise[robot, sensor]
            elif distance > 0.0:
                tenths = 10.0 / distance
                if abs(tenths - math.floor(tenths) - 0.5) < CLOSE:
                    infrared[robot, sensor] = math.nan
                    count += 1
                    continue
            infrared[robot, sensor] = math.floor(10.0 * reading + 0.5) / 10.0
        if compass_deviation[robot] > 0.0:
            heading += compass_deviation[robot] * compass_noise[robot, 0]
        compass[robot] = math.floor(wrap(heading) * 180.0 / math.pi + 0.5)
        found = -1
        for number in range(targets.shape[0]):
            dx, dy = x - targets[number, 0], y - targets[number, 1]
            beyond = math.sqrt(dx * dx + dy * dy) - targets[number, 2]
            if abs(beyond) < RIM:
                found = UNDECIDED
                count += 1
                break
            if beyond <= 0.0:
                found = number
        ground[robot] = found
    return count


@kept
def line(robots, pose, right_probability, noise, floor, marks):
    """Fill in `marks` of robots; `floor` is a tuple of what a `FloorTables` has."""
    xs, ys, headings = pose
    origin_column, origin_row, first, polygons, corner_first, corners = floor
    for robot in robots:
        probability = right_probability[robot]
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
                if inside(corners, corner_first[polygon], corner_first[polygon + 1], x, y):
                    mark = True
                    break
            if probability < 1.0 and noise[robot, element] >= probability:
                mark = not mark
            marks[robot, element] = mark
