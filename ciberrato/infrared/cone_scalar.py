"""The nearest wall in the view cones of one robot's sensors, one after the other.

The geometry is that of `ciberrato.infrared.cone_pairs`, where it is explained; the faces come nearest first,
so that the loop ends after a few. No face is skipped that could come nearest, so the result does not depend
on their order: the same arithmetic on the same faces has the same result to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, floor, inf, pi, sin, sqrt, tan

from ciberrato.geometry.visible_faces import SECTORS, SECTORS_PER_RADIAN, SQUARES_PER_UNIT, Seen
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.cone_pairs import HALF_APERTURE, IN_LINE
from ciberrato.infrared.exact import exact_distance
from ciberrato.infrared.on_face import distance_by_angles

COS, TAN = cos(HALF_APERTURE), tan(HALF_APERTURE)

BEYOND = 1.0 + 1e-9
"""A face whose line is farther than this times the nearest one is left out."""

_TURN = 2 * pi


def single_cone_distances(
    walls: WallMap, x: float, y: float, directions: Iterable[float], offset: float
) -> list[float]:
    """Compute the distances that sensors measure: the least of three rays and of the corners in each cone.

    Parameters
    ----------
    walls : WallMap
    x, y : float
        Centre of the robot.
    directions : iterable of float
        The sensors' axes in radians, not wrapped yet. Those beyond ±3 π, which one turn does not bring within
        ±π, see what they see in the real simulator (`ciberrato.infrared.on_face`).
    offset : float
        Units from the centre to each sensor.

    Returns
    -------
    list of float
        Units from each sensor; infinite where no wall is seen.
    """
    distances = []
    lists, more = walls.views.lists, walls.views.add
    for direction in directions:
        axis = direction
        if direction > pi:
            direction -= _TURN
        elif direction < -pi:
            direction += _TURN
        if not -pi <= direction <= pi:
            distances.append(exact_distance(walls, x, y, axis, offset))
            continue
        cosine, sine = cos(direction), sin(direction)
        sensor_x, sensor_y = x + offset * cosine, y + offset * sine
        square = floor(sensor_x * SQUARES_PER_UNIT), floor(sensor_y * SQUARES_PER_UNIT)
        sectors = lists.get(square) or more(square)
        faces, reach = sectors[floor(direction * SECTORS_PER_RADIAN) % SECTORS]
        nearest = _nearest(faces, sensor_x, sensor_y, cosine, sine)
        if nearest > reach:
            nearest = _nearest(walls.views.all_faces, sensor_x, sensor_y, cosine, sine)
        if nearest < 0.0:
            nearest = distance_by_angles(walls.nearby, sensor_x, sensor_y, direction)
        distances.append(nearest)
    return distances


def _nearest(faces: Sequence[Seen], x: float, y: float, cosine: float, sine: float) -> float:
    """Return the distance of the nearest of faces sorted by distance; -1 if the sensor lies on one."""
    nearest = beyond = inf
    for bound, x0, y0, ex, ey, length in faces:
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
                return -1.0
            area = inf  # seen edge-on, a face counts by its corners alone
        elif (lo > 0.0 and lo_end > 0.0) or (hi <= 0.0 and hi_end <= 0.0):
            continue  # beside the cone, or behind
        if lo <= 0.0 < hi:
            distance = sqrt(dx * dx + dy * dy)
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
