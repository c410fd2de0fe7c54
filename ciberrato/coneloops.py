# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""The arithmetic of `ciberrato.singlecone` in machine code made by numba, to the last bit.

numba cannot compile the function as it stands there, lists of tuples and all; so it is written a second
time, once for everybody who loops over sensors in machine code. Faces and lists are those of
`ciberrato.labtables.LabTables`.

numba keeps what it compiled until the file of the *calling* function changes: after a change here, remove
the caches of the callers (``__pycache__``), or they go on with the old code.
"""

from __future__ import annotations

import math

import numba

from ciberrato.singlecone import BEYOND, COS, TAN
from ciberrato.viewcone import IN_LINE
from ciberrato.viewlists import LONGEST

_jit = numba.njit(cache=True, error_model="numpy", nogil=True)


@_jit
def nearest_listed(faces, seen, row, sector, x, y, cosine, sine):
    """Give the distance of the nearest face in a list; nan if the sensor lies on one.

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


@_jit
def nearest_of_all(faces, x, y, cosine, sine):
    """Give the distance of the nearest of all faces; nan if the sensor lies on one."""
    nearest = math.inf
    for face in range(faces.shape[0]):
        nearest = _nearer(faces, face, nearest, x, y, cosine, sine)
        if math.isnan(nearest):
            break
    return nearest


@_jit
def _nearer(faces, face, nearest, x, y, cosine, sine):
    """Distance of a face where it is nearer, else the distance that is given; `ciberrato.singlecone`."""
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
