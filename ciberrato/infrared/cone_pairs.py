"""The nearest wall in a sensor's view cone, for arrays of sensors.

For each sensor only the faces whose bounding box meets that of a short cone are looked at; the few sensors
that see nothing so near are asked again with a long one. What is left is a list of pairs (sensor, face), on
which everything is worked out at once in the sensor's frame: u ahead, v to its left. With the cone sheared
open, lo = v - u tan 30° and hi = v + u tan 30° are zero on its two edges, so that the signs of v, lo and hi
at the ends of a face say which rays it crosses, and lo <= 0 <= hi that a corner is inside.
"""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Booleans, Floats
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.on_face import distance_by_angles

HALF_APERTURE = math.pi / 6
"""Radians from the sensor's axis to the edge of its cone."""

_COS, _SIN, _TAN = math.cos(HALF_APERTURE), math.sin(HALF_APERTURE), math.tan(HALF_APERTURE)
_REACHES = (3.0, 9.0)
"""Units; nine of ten sensors in a maze see a wall within the first. The others ask again."""
_BLOCK = 512
"""Sensors worked on at once, in labs with fewer than 8192 faces."""
_BLOCK_ELEMENTS = 2**22
_MARGIN = 1e-6
"""Added to bounding boxes, far above rounding errors."""
IN_LINE = 1e-9
"""Twice the area of the triangle of a sensor and a face, below which they count as in one line."""


def cone_distances(walls: WallMap, x: Floats, y: Floats, direction: Floats, *, every_point: bool) -> Floats:
    """Compute the distance of the nearest wall in each sensor's cone.

    Parameters
    ----------
    walls : WallMap
    x, y : array, shape (n,)
        Places of the sensors.
    direction : array, shape (n,)
        Their axes in radians, within ±π.
    every_point : bool
        False: what the real sensor looks at, its axis, the two edges of the cone, and corners inside. True:
        every point in the cone, for which the feet of perpendiculars are looked at too.

    Returns
    -------
    array, shape (n,)
        Units; infinite where there is no wall.
    """
    result = np.empty(direction.size)
    cosine, sine = np.cos(direction), np.sin(direction)
    low = np.minimum(walls.start, walls.end).T
    high = np.maximum(walls.start, walls.end).T
    block = max(1, min(_BLOCK, _BLOCK_ELEMENTS // max(1, walls.length.size)))
    for begin in range(0, direction.size, block):
        chosen = np.arange(begin, min(begin + block, direction.size))
        sensors = np.stack((x[chosen], y[chosen], cosine[chosen], sine[chosen]))
        far = 4.0 * (1.0 + max(float(np.abs(array).max(initial=0.0)) for array in (low, high, sensors[:2])))
        for reach in (*_REACHES, far):
            near = _boxes_meet(sensors, reach, low, high)
            closeness = _closeness(walls, sensors, near, every_point)
            result[chosen] = closeness
            again = closeness * reach < 1.0
            chosen, sensors = chosen[again], sensors[:, again]
            if chosen.size == 0:
                break
    result += 0.0  # -0.0, from a face behind the sensor, would become -inf
    with np.errstate(divide="ignore"):
        np.divide(1.0, result, out=result)
    on_face = np.flatnonzero(np.isnan(result))
    if on_face.size:
        on_faces = zip(x[on_face].tolist(), y[on_face].tolist(), direction[on_face].tolist(), strict=True)
        result[on_face] = [
            0.0 if every_point else distance_by_angles(walls.nearby, *sensor) for sensor in on_faces
        ]
    return result


def _boxes_meet(sensors: Floats, reach: float, low: Floats, high: Floats) -> Booleans:
    """Return which faces' boxes meet that of each sensor's cone up to `reach` units; shape (n, faces)."""
    x, y, cosine, sine = sensors
    left_cosine, left_sine = cosine * _COS - sine * _SIN, sine * _COS + cosine * _SIN
    right_cosine, right_sine = cosine * _COS + sine * _SIN, sine * _COS - cosine * _SIN
    meet: Booleans | None = None
    for place, axis, one, other, face_low, face_high in (
        (x, cosine, left_cosine, right_cosine, low[0], high[0]),
        (y, sine, left_sine, right_sine, low[1], high[1]),
    ):
        # The arc that ends the cone bulges to a full reach where the cone holds the direction of an axis.
        most = np.where(axis >= _COS, 1.0, np.maximum(np.maximum(one, other), 0.0))
        least = np.where(axis <= -_COS, -1.0, np.minimum(np.minimum(one, other), 0.0))
        below = face_low <= (place + reach * most + _MARGIN)[:, np.newaxis]
        meet = below if meet is None else np.logical_and(meet, below, out=meet)
        np.logical_and(meet, face_high >= (place + reach * least - _MARGIN)[:, np.newaxis], out=meet)
    assert meet is not None
    return meet


def _closeness(walls: WallMap, sensors: Floats, near: Booleans, every_point: bool) -> Floats:
    """Compute 1/distance; 0 where nothing is seen, nan where the sensor lies on a face; shape (n,)."""
    n, faces = near.shape
    pair = np.flatnonzero(near)
    sensor = pair // max(faces, 1)
    face = pair - sensor * faces
    x, y, cosine, sine = (array[sensor] for array in sensors)
    dx, dy = walls.start[face, 0] - x, walls.start[face, 1] - y
    ex, ey = walls.edge[face, 0], walls.edge[face, 1]
    v = dy * cosine - dx * sine
    u_tan = (dx * cosine + dy * sine) * _TAN
    ve = ey * cosine - ex * sine
    ue_tan = (ex * cosine + ey * sine) * _TAN
    area = dx * ey - dy * ex
    squared = dx * dx + dy * dy
    in_line = np.abs(area) < IN_LINE
    on_face = sensor[:0]
    if in_line.any():
        which = np.flatnonzero(in_line)
        # The start is behind the sensor, and the end ahead, or the other way round.
        dot = squared[which] + dx[which] * ex[which] + dy[which] * ey[which]
        on_face = sensor[which[dot <= IN_LINE]]
        area[which] = np.inf  # seen edge-on, a face counts by its corners alone
    lo, hi = v - u_tan, v + u_tan
    lo_positive, hi_positive = lo > 0.0, hi > 0.0
    # A ray at an angle meets the line of a face at area / (slope of the face against the ray).
    inverse = 1.0 / area
    ahead = ve * inverse * ((v > 0.0) != (v + ve > 0.0))
    for slope, side, positive in ((ve - ue_tan, lo, lo_positive), (ve + ue_tan, hi, hi_positive)):
        edge = slope * inverse
        edge *= _COS
        edge *= positive != (side + slope > 0.0)
        np.maximum(ahead, edge, out=ahead)
    if every_point:
        _add_feet(ahead, walls.length[face], dx * ex + dy * ey, ve, inverse)
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = np.sqrt((hi_positive & ~lo_positive) / squared)
    np.fmax(ahead, corner, out=ahead)
    result = np.zeros(n)
    count = np.bincount(sensor, minlength=n)
    seen = count > 0
    result[seen] = np.maximum.reduceat(ahead, (np.cumsum(count) - count)[seen]) if pair.size else 0.0
    result[on_face] = np.nan
    return result


def _add_feet(closeness: Floats, length: Floats, along: Floats, ve: Floats, inverse: Floats) -> None:
    """Add the foot of the perpendicular on each face, where it is on the face and in the cone."""
    on_face = (along <= 0.0) & (along >= -length * length)
    # The foot lies at right angles to the face, on the side that the sign of the area says.
    in_cone = ve * np.sign(inverse) >= _COS * length
    np.maximum(closeness, length * np.abs(inverse) * (on_face & in_cone), out=closeness)
