# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""One running cycle of the robots of a world in machine code made by numba, all in one call.

The same operations in the same order as in `simulator_stub.world.motion`, `ciberrato.physics.collisions` and
the sensors give the same numbers to the last bit. What is not decided here ends the call: the caller
(`simulator_stub.compiled_cycle`) then has the cycle computed by those.
"""

from __future__ import annotations

import math

import numba

from ciberrato.infrared.cone_compiled import distance_ahead, row_at, wrap
from ciberrato.infrared.cone_pairs import HALF_APERTURE
from ciberrato.infrared.exact import CLOSE
from ciberrato.infrared.face_tables import TOUCHED
from ciberrato.infrared.model import CONTACT, SATURATION, SENSOR_OFFSET
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.sensors.infrared import REACH

RIM = 1e-9
"""Units: nearer to the rim of a target than that, only `math.hypot` decides."""

_jit = numba.njit(cache=True, error_model="numpy", nogil=True)


@_jit
def cycle(robots, deviations, angles, targets, faces, row_of, seen, touched, touched_count, out):
    """Move the robots and measure; return whether all is decided.

    Rows of `robots`: x, y, heading, commands and outputs (left and right each), whether it moves, and normal
    numbers: right and left motor, four IR sensors, compass. `deviations`: motors, IR, compass. Rows of
    `out`: outputs (left, right), wanted pose, whether it touches a wall and a robot, readings of the IR
    sensors, compass, ground, pose after the move.
    """
    for robot in range(robots.shape[0]):
        left = (robots[robot, 3] + robots[robot, 5]) / 2.0
        right = (robots[robot, 4] + robots[robot, 6]) / 2.0
        if deviations[0] > 0.0:
            right *= 1.0 + deviations[0] * robots[robot, 8]
            left *= 1.0 + deviations[0] * robots[robot, 9]
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
            direction = heading + angles[robot, sensor]
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
            reading += deviations[1] * robots[robot, 10 + sensor]
            out[robot, 7 + sensor] = math.floor(10.0 * reading + 0.5) / 10.0
        angle = wrap(heading + deviations[2] * robots[robot, 14])
        out[robot, 11] = math.floor(angle * 180.0 / math.pi + 0.5)
        out[robot, 12] = -1
        for number in range(targets.shape[0]):
            dx, dy = x - targets[number, 0], y - targets[number, 1]
            beyond = math.sqrt(dx * dx + dy * dy) - targets[number, 2]
            if abs(beyond) < RIM:
                return False
            if beyond <= 0.0:
                out[robot, 12] = number
    return True


@_jit
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


@_jit
def _moves_towards(robots, out, robot, other):
    """Return whether a robot moves towards another, by the poses before the move; as `physics.collisions`."""
    dx, dy = robots[other, 0] - robots[robot, 0], robots[other, 1] - robots[robot, 1]
    speed = (out[robot, 0] + out[robot, 1]) / 2.0
    if speed == 0.0 or (dx == 0.0 and dy == 0.0):
        return False
    ahead = math.cos(math.atan2(dy, dx) - robots[robot, 2])
    return ahead > 0.0 if speed > 0.0 else ahead < 0.0


@_jit
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
