# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""One running cycle of the robots of a world in machine code made by numba, all in one call.

The same operations in the same order as in `simulator_stub.world.motion`, `ciberrato.physics.collisions` and
the sensors give the same numbers to the last bit. What is not decided here ends the call: the caller
(`simulator_stub.compiled_cycle`) then has the cycle computed by those.
"""

from __future__ import annotations

import math

from ciberrato.infrared.cone_compiled import distance_ahead, row_at, wrap
from ciberrato.infrared.cone_pairs import HALF_APERTURE
from ciberrato.infrared.exact import CLOSE
from ciberrato.infrared.face_tables import TOUCHED
from ciberrato.infrared.model import CONTACT, SATURATION, SENSOR_OFFSET
from ciberrato.machine_code import kept
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.sensors.infrared import REACH
from simulator_stub.sensors.line import AHEAD, SIDEWAYS
from simulator_stub.world.floor import SQUARES_PER_UNIT as FLOOR_SQUARES_PER_UNIT

RIM = 1e-9
"""Units: nearer to the rim of a target than that, only `math.hypot` decides."""

YES, NO, FIRST_TAIL, PIECES = 10, 11, 12, 44
"""Rows of pieces of messages after `ciberrato.protocol.measures_text.HEAD_PIECES`, and how many there are."""
SHORT = 1e5
"""Readings below it have all their digits in the six that are sent, as they are whole tenths."""
ZERO, MINUS, POINT = ord("0"), ord("-"), ord(".")


@kept
def cycle(
    time, buttons, turn, robots, noise, fixed, faces, row_of, seen, touched, touched_count,
    floor, polygons, corners, texts, out,
):  # fmt: skip
    """Move the robots, measure, and write their messages; return whether all is decided.

    Rows of `robots`: x, y, heading, commands and outputs (left and right each), whether it moves, LEDs, and
    mounting angles. `noise[turn]`, by robot: normal numbers of right and left motor, four IR sensors and
    compass, and which elements of the line sensor are wrong. `fixed`: deviations of motors, IR and compass;
    column and row of the floor's first square; targets. LEDs, and buttons in `buttons`, are a number as in
    `ciberrato.protocol.measures_text.TAILS`. Rows of `out`: outputs (left, right), wanted pose, whether it
    touches a wall and a robot, readings of the IR sensors, compass, ground, pose after the move, reading of
    the line sensor, bytes of the message, 0 where it is not written.
    """
    deviations, targets = fixed[0], fixed[2:]
    draws = noise[turn]
    for robot in range(robots.shape[0]):
        left = (robots[robot, 3] + robots[robot, 5]) / 2.0
        right = (robots[robot, 4] + robots[robot, 6]) / 2.0
        if deviations[0] > 0.0:
            right *= 1.0 + deviations[0] * draws[robot, 0]
            left *= 1.0 + deviations[0] * draws[robot, 1]
        heading = robots[robot, 2]
        speed = (right + left) / 2.0
        x = robots[robot, 0] + speed * math.cos(heading)
        y = robots[robot, 1] + speed * math.sin(heading)
        out[robot, 0], out[robot, 1] = left, right
        out[robot, 2], out[robot, 3] = x, y
        out[robot, 4] = wrap(heading + (right - left) / (2.0 * ROBOT_RADIUS))
        row = row_at(row_of, x, y)
        if row < 0 or touched_count[row] > TOUCHED:
            return False
        touches = False
        for index in range(touched_count[row]):
            if touches_face(faces, touched[row, index], x, y):
                touches = True
                break
        out[robot, 5], out[robot, 6] = touches, False
    for first in range(robots.shape[0]):
        for second in range(first + 1, robots.shape[0]):
            dx, dy = out[first, 2] - out[second, 2], out[first, 3] - out[second, 3]
            if math.sqrt(dx * dx + dy * dy) < 2 * ROBOT_RADIUS:
                if _moves_towards(robots, out, first, second):
                    out[first, 6] = True
                if _moves_towards(robots, out, second, first):
                    out[second, 6] = True
    for robot in range(robots.shape[0]):
        for axis in range(3):
            out[robot, 13 + axis] = robots[robot, axis]
        if robots[robot, 7] != 0.0:
            out[robot, 15] = out[robot, 4]
            if out[robot, 5] == 0.0 and out[robot, 6] == 0.0:
                out[robot, 13], out[robot, 14] = out[robot, 2], out[robot, 3]
    for robot in range(robots.shape[0]):
        x, y, heading = out[robot, 13], out[robot, 14], out[robot, 15]
        for sensor in range(4):
            direction = heading + robots[robot, 9 + sensor]
            distance = distance_ahead(faces, row_of, seen, x, y, direction)
            if math.isnan(distance):
                return False
            if deviations[1] == 0.0 and distance > 0.0:
                tenths = 10.0 / distance
                if abs(tenths - math.floor(tenths) - 0.5) < CLOSE:
                    return False
            for other in range(robots.shape[0]):
                if other != robot:
                    there_x, there_y = out[other, 13], out[other, 14]
                    dx, dy = there_x - x, there_y - y
                    if math.sqrt(dx * dx + dy * dy) - REACH < distance:
                        distance = min(distance, _robot_ahead(x, y, direction, there_x, there_y))
            reading = 1.0 / distance if CONTACT < distance < math.inf else SATURATION
            reading += deviations[1] * draws[robot, 2 + sensor]
            out[robot, 7 + sensor] = math.floor(10.0 * reading + 0.5) / 10.0
        angle = wrap(heading + deviations[2] * draws[robot, 6])
        out[robot, 11] = math.floor(angle * 180.0 / math.pi + 0.5)
        out[robot, 12] = -1
        for number in range(targets.shape[0]):
            dx, dy = x - targets[number, 0], y - targets[number, 1]
            beyond = math.sqrt(dx * dx + dy * dy) - targets[number, 2]
            if abs(beyond) < RIM:
                return False
            if beyond <= 0.0:
                out[robot, 12] = number
        marks = _marks(x, y, heading, fixed[1], floor, polygons, corners)
        out[robot, 16] = marks ^ int(draws[robot, 7])
        out[robot, 17] = _write(texts, PIECES + robot, time, int(robots[robot, 8]) + buttons, out[robot])
    return True


@kept
def _marks(x, y, heading, first_square, floor, polygons, corners):
    """Return which elements of the line sensor are above a polygon; as `LineSensor.update`."""
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead_x, ahead_y = x + AHEAD * cosine, y + AHEAD * sine
    column = math.floor(ahead_x * FLOOR_SQUARES_PER_UNIT) - int(first_square[0])
    row = math.floor(ahead_y * FLOOR_SQUARES_PER_UNIT) - int(first_square[1])
    marks = 0
    if not (0 <= row < floor.shape[0] and 0 <= column < floor.shape[1] - 1):
        return marks
    begin, end = floor[row, column], floor[row, column + 1]
    if begin == end:
        return marks
    for side in SIDEWAYS:
        marks *= 2
        there_x, there_y = ahead_x - side * sine, ahead_y + side * cosine
        for index in range(begin, end):
            if inside(corners, polygons[index, 0], polygons[index, 1], there_x, there_y):
                marks += 1
                break
    return marks


@kept
def inside(corners, begin, end, x, y):
    """Return whether a point is inside a polygon, by the even-odd rule; as `simulator_stub.world.floor`."""
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


@kept
def _write(texts, row, time, switches, readings):
    """Write a message; return its length, 0 where a number is not one of those that are short.

    As `ciberrato.protocol.measures_text.usual_measures`, whose pieces are in the first rows of `texts`.
    """
    for reading in range(7, 13):
        if not abs(readings[reading]) < SHORT:
            return 0
    place = _digits(texts, row, _copy(texts, 0, row, 0), time)
    place = _copy(texts, 1, row, place)
    collides = readings[5] != 0.0 or readings[6] != 0.0
    place = _copy(texts, YES if collides else NO, row, place)
    for piece, reading in ((2, 11), (3, 12), (4, 7), (5, 8), (6, 9), (7, 10)):
        place = _tenths(texts, row, _copy(texts, piece, row, place), 10.0 * readings[reading])
    place = _copy(texts, 8, row, place)
    for element in range(7):
        texts[row, place] = ZERO + (int(readings[16]) >> (6 - element) & 1)
        place += 1
    place = _copy(texts, 9, row, place)
    return _copy(texts, FIRST_TAIL + switches, row, place)


@kept
def _copy(texts, piece, row, place):
    """Copy a piece, whose length is in the last two bytes of its row; return where it ends."""
    width = texts.shape[1]
    size = int(texts[piece, width - 2]) + 256 * int(texts[piece, width - 1])
    for index in range(size):
        texts[row, place + index] = texts[piece, index]
    return place + size


@kept
def _tenths(texts, row, place, tenths):
    """Write a tenth of a whole number, as ``%g`` does; return where it ends."""
    if math.copysign(1.0, tenths) < 0.0:
        texts[row, place] = MINUS
        place += 1
    number = math.floor(abs(tenths) + 0.5)
    place = _digits(texts, row, place, number // 10)
    if number % 10:
        texts[row, place] = POINT
        texts[row, place + 1] = ZERO + number % 10
        place += 2
    return place


@kept
def _digits(texts, row, place, number):
    """Write a whole number that is not negative; return where it ends."""
    size = 1
    rest = number // 10
    while rest:
        size += 1
        rest //= 10
    for index in range(size - 1, -1, -1):
        texts[row, place + index] = ZERO + number % 10
        number //= 10
    return place + size


@kept
def touches_face(faces, face, x, y):
    """Return whether a robot overlaps a face; as `NearbyFaces.any_within`."""
    dx, dy = x - faces[face, 0], y - faces[face, 1]
    along = dx * faces[face, 7] + dy * faces[face, 8]
    if along < 0.0:
        return math.sqrt(dx * dx + dy * dy) < ROBOT_RADIUS
    if along > faces[face, 4]:
        dx, dy = x - faces[face, 5], y - faces[face, 6]
        return math.sqrt(dx * dx + dy * dy) < ROBOT_RADIUS
    return abs(dx * faces[face, 8] - dy * faces[face, 7]) < ROBOT_RADIUS


@kept
def _moves_towards(robots, out, robot, other):
    """Return whether a robot moves towards another, by the poses before the move; as `physics.collisions`."""
    dx, dy = robots[other, 0] - robots[robot, 0], robots[other, 1] - robots[robot, 1]
    speed = (out[robot, 0] + out[robot, 1]) / 2.0
    if speed == 0.0 or (dx == 0.0 and dy == 0.0):
        return False
    ahead = math.cos(math.atan2(dy, dx) - robots[robot, 2])
    return ahead > 0.0 if speed > 0.0 else ahead < 0.0


@kept
def _robot_ahead(x, y, direction, other_x, other_y):
    """Return the distance of another robot; as `ciberrato.infrared.model.other_robot_distance`."""
    axis = wrap(direction)
    dx = other_x - (x + SENSOR_OFFSET * math.cos(axis))
    dy = other_y - (y + SENSOR_OFFSET * math.sin(axis))
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= ROBOT_RADIUS:
        return 0.0
    aside = abs(wrap(math.atan2(dy, dx) - axis)) - HALF_APERTURE
    if aside <= 0.0:
        return distance - ROBOT_RADIUS
    if aside > math.asin(ROBOT_RADIUS / distance):
        return math.inf
    across = distance * math.sin(aside)
    return distance * math.cos(aside) - math.sqrt(max(0.0, ROBOT_RADIUS * ROBOT_RADIUS - across * across))
