"""The nearest wall in a sensor's view cone, for one sensor at a time.

The arithmetic is that of `ciberrato.viewcone`, where it is explained; the faces come nearest first, so that
the loop ends after a few.
"""

from __future__ import annotations

import math

import numpy as np

from ciberrato.anglerules import distance_by_angles
from ciberrato.geometry import WallMap
from ciberrato.viewcone import HALF_APERTURE, IN_LINE, cone_distances

_COS, _TAN = math.cos(HALF_APERTURE), math.tan(HALF_APERTURE)


def single_cone_distance(walls: WallMap, x: float, y: float, direction: float) -> float:
    """Distance that a sensor takes: the least of three rays and of the corners in its cone.

    Parameters
    ----------
    walls : WallMap
    x, y : float
        Place of the sensor.
    direction : float
        Its axis in radians, within ±π.

    Returns
    -------
    float
        Units; infinite where no wall is seen.
    """
    cosine, sine = math.cos(direction), math.sin(direction)
    nearest = math.inf
    bounds, faces, reach = walls.nearby.around(x, y)
    for bound, (x0, y0, _, _, ex, ey, length, _, _) in zip(bounds, faces, strict=True):
        if bound >= nearest:
            return nearest
        dx, dy = x0 - x, y0 - y
        area = dx * ey - dy * ex
        if not -nearest * length < area < nearest * length:
            continue  # even the line through the face is too far away
        v, ve = dy * cosine - dx * sine, ey * cosine - ex * sine
        u_tan, ue_tan = (dx * cosine + dy * sine) * _TAN, (ex * cosine + ey * sine) * _TAN
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
        if (v > 0.0) != (v + ve > 0.0) and 0.0 <= area / ve < nearest:
            nearest = area / ve
        if (lo > 0.0) != (lo_end > 0.0) and 0.0 <= area / (lo_slope * _COS) < nearest:
            nearest = area / (lo_slope * _COS)
        if (hi > 0.0) != (hi_end > 0.0) and 0.0 <= area / (hi_slope * _COS) < nearest:
            nearest = area / (hi_slope * _COS)
    if nearest > reach:
        # The list ends before the nearest wall: a lab with very many faces, and a long view.
        among_all = cone_distances(walls, *np.array([[x], [y], [direction]]), every_point=False)
        return float(among_all[0])
    return nearest
