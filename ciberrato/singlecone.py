"""The nearest wall in a sensor's view cone, for one sensor at a time.

The geometry is that of `ciberrato.viewcone`, where it is explained; the faces come nearest first, so that
the loop ends after a few. No face is skipped that could come nearest, so the result does not depend on
their order: whoever does the same arithmetic on the same faces gets the same number to the last bit.
"""

from __future__ import annotations

import math

from ciberrato.anglerules import distance_by_angles
from ciberrato.geometry import WallMap
from ciberrato.viewcone import HALF_APERTURE, IN_LINE
from ciberrato.viewlists import Seen

COS, TAN = math.cos(HALF_APERTURE), math.tan(HALF_APERTURE)

BEYOND = 1.0 + 1e-9
"""A face whose line is farther than this times the nearest one is left out."""


def single_cone_distance(
    walls: WallMap, x: float, y: float, direction: float, cosine: float, sine: float
) -> float:
    """Distance that a sensor takes: the least of three rays and of the corners in its cone.

    Parameters
    ----------
    walls : WallMap
    x, y : float
        Place of the sensor.
    direction : float
        Its axis in radians, within ±π.
    cosine, sine : float
        Of the direction.

    Returns
    -------
    float
        Units; infinite where no wall is seen.
    """
    bounds, faces, reach = walls.views.ahead(x, y, direction)
    nearest = _nearest(walls, x, y, direction, cosine, sine, bounds, faces)
    if nearest > reach:
        faces = walls.views.all_faces
        nearest = _nearest(walls, x, y, direction, cosine, sine, [0.0] * len(faces), faces)
    return nearest


def _nearest(
    walls: WallMap,
    x: float,
    y: float,
    direction: float,
    cosine: float,
    sine: float,
    bounds: list[float],
    faces: list[Seen],
) -> float:
    nearest = beyond = math.inf
    for bound, (x0, y0, ex, ey, length) in zip(bounds, faces, strict=True):
        if bound >= nearest:
            return nearest
        dx, dy = x0 - x, y0 - y
        area = dx * ey - dy * ex
        limit = beyond * length
        if not -limit < area < limit:
            continue  # even the line through the face is too far away
        v, ve = dy * cosine - dx * sine, ey * cosine - ex * sine
        u_tan, ue_tan = (dx * cosine + dy * sine) * TAN, (ex * cosine + ey * sine) * TAN
        lo, lo_slope = v - u_tan, ve - ue_tan
        hi, hi_slope = v + u_tan, ve + ue_tan
        lo_end, hi_end = lo + lo_slope, hi + hi_slope
        if -IN_LINE < area < IN_LINE:
            if dx * dx + dy * dy + dx * ex + dy * ey <= IN_LINE:
                return distance_by_angles(walls.nearby, x, y, direction)
            area = math.inf  # seen edge-on, a face counts by its corners alone
        elif (lo > 0.0 and lo_end > 0.0) or (hi <= 0.0 and hi_end <= 0.0):
            continue  # beside the cone, or behind
        if lo <= 0.0 < hi:
            distance = math.sqrt(dx * dx + dy * dy)
            if distance < nearest:
                nearest = distance
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
        beyond = nearest * BEYOND
    return nearest
