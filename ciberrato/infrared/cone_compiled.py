# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""The arithmetic of `ciberrato.infrared.cone_scalar` in machine code made by numba, to the last bit.

numba cannot compile the function as it stands there, lists of tuples and all; so it is written a second
time, once for everybody who loops over sensors in machine code. Faces and lists are those of
`ciberrato.infrared.face_tables.LabTables`.

numba keeps what it compiled until the file of the *calling* function changes: after a change here, remove
the caches of the callers (``__pycache__``), or they go on with the old code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ciberrato.geometry.visible_faces import LONGEST, SECTORS, SECTORS_PER_RADIAN, SQUARES_PER_UNIT
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.cone_pairs import IN_LINE
from ciberrato.infrared.cone_scalar import BEYOND, COS, TAN
from ciberrato.infrared.face_tables import OUTSIDE, tables_of
from ciberrato.infrared.model import SENSOR_OFFSET, distances_at
from ciberrato.machine_code import kept

_PADDING = OUTSIDE * SQUARES_PER_UNIT
_TURN = 2 * math.pi


@kept
def nearest_listed(faces, seen, row, sector, x, y, cosine, sine):
    """Return the distance of the nearest face in a list; nan if the sensor lies on one.

    It is right if it is not beyond the last bound of the list.
    """
    nearest = math.inf
    for index in range(LONGEST):
        bound = seen[row, sector, index, 0]
        if bound >= nearest or bound == math.inf:
            break
        nearest = _nearer(faces, int(seen[row, sector, index, 1]), nearest, x, y, cosine, sine)
        if math.isnan(nearest):
            break
    return nearest


@kept
def nearest_of_all(faces, x, y, cosine, sine):
    """Return the distance of the nearest of all faces; nan if the sensor lies on one."""
    nearest = math.inf
    for face in range(faces.shape[0]):
        nearest = _nearer(faces, face, nearest, x, y, cosine, sine)
        if math.isnan(nearest):
            break
    return nearest


@kept
def _nearer(faces, face, nearest, x, y, cosine, sine):
    """Return the distance of a face where it is nearer, else the one passed in; see `cone_scalar`."""
    ex, ey = faces[face, 2], faces[face, 3]
    dx, dy = faces[face, 0] - x, faces[face, 1] - y
    area = dx * ey - dy * ex
    limit = nearest * BEYOND * faces[face, 4]
    if not -limit < area < limit:
        return nearest
    v, ve = dy * cosine - dx * sine, ey * cosine - ex * sine
    u_tan, ue_tan = (dx * cosine + dy * sine) * TAN, (ex * cosine + ey * sine) * TAN
    lo, lo_slope = v - u_tan, ve - ue_tan
    hi, hi_slope = v + u_tan, ve + ue_tan
    lo_end, hi_end = lo + lo_slope, hi + hi_slope
    if -IN_LINE < area < IN_LINE:
        if dx * dx + dy * dy + dx * ex + dy * ey <= IN_LINE:
            return math.nan
        area = math.inf
    elif (lo > 0.0 and lo_end > 0.0) or (hi <= 0.0 and hi_end <= 0.0):
        return nearest
    if lo <= 0.0 < hi:
        nearest = min(nearest, math.sqrt(dx * dx + dy * dy))
    if (v > 0.0) != (v + ve > 0.0):
        distance = area / ve
        if 0.0 <= distance < nearest:
            nearest = distance
    if (lo > 0.0) != (lo_end > 0.0):
        distance = area / (lo_slope * COS)
        if 0.0 <= distance < nearest:
            nearest = distance
    if (hi > 0.0) != (hi_end > 0.0):
        distance = area / (hi_slope * COS)
        if 0.0 <= distance < nearest:
            nearest = distance
    return nearest


@kept
def wrap(angle):
    """Wrap an angle by at most one turn; as `ciberrato.geometry.angles.wrap_once`."""
    if angle > math.pi:
        return angle - _TURN
    if angle < -math.pi:
        return angle + _TURN
    return angle


@kept
def row_at(row_of, x, y):
    """Return the row of the square that a place is in; -1 where there is none."""
    column = math.floor(x * SQUARES_PER_UNIT) + _PADDING
    row = math.floor(y * SQUARES_PER_UNIT) + _PADDING
    if 0 <= row < row_of.shape[0] and 0 <= column < row_of.shape[1]:
        return row_of[row, column]
    return -1


@kept
def distance_ahead(faces, row_of, seen, robot_x, robot_y, direction):
    """Return the distance that one sensor of a robot takes; nan where the lists of faces do not decide."""
    axis = wrap(direction)
    if not -math.pi <= axis <= math.pi:
        return math.nan
    cosine, sine = math.cos(axis), math.sin(axis)
    x = robot_x + SENSOR_OFFSET * cosine
    y = robot_y + SENSOR_OFFSET * sine
    row = row_at(row_of, x, y)
    if row < 0:
        return math.nan
    sector = math.floor(axis * SECTORS_PER_RADIAN) % SECTORS
    distance = nearest_listed(faces, seen, row, sector, x, y, cosine, sine)
    if distance > seen[row, sector, LONGEST, 0]:
        distance = nearest_of_all(faces, x, y, cosine, sine)
    return distance


@kept
def distances(x, y, directions, faces, row_of, seen):
    """Return the distances that the four sensors of one robot take, as a tuple; nan where undecided."""
    return (
        distance_ahead(faces, row_of, seen, x, y, directions[0]),
        distance_ahead(faces, row_of, seen, x, y, directions[1]),
        distance_ahead(faces, row_of, seen, x, y, directions[2]),
        distance_ahead(faces, row_of, seen, x, y, directions[3]),
    )


def compiled_distances(walls: WallMap) -> Callable[[float, float, Sequence[float]], list[float]]:
    """Return `ciberrato.infrared.model.distances_at` for some walls, in machine code."""
    tables = tables_of(walls)

    def at(x: float, y: float, directions: Sequence[float]) -> list[float]:
        found: tuple[float, ...] = distances(
            x, y, tuple(directions), tables.faces, tables.row_of, tables.seen
        )
        if math.isnan(sum(found)):
            axes = np.array(directions)
            tables.rows_at(x + SENSOR_OFFSET * np.cos(axes), y + SENSOR_OFFSET * np.sin(axes))
            return distances_at(walls, x, y, directions)
        return list(found)

    return at
