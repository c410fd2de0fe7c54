"""The wall point that an IR sensor's distance belongs to: what a figure of the cones shows.

`ciberrato.infrared.model` has distances for arrays of sensors. Here one sensor's candidates are listed one
by one, so that the nearest can be drawn; a test holds the two against each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import HALF_APERTURE, SENSOR_OFFSET
from ciberrato.world.coordinates import Point

_TOLERANCE = 1e-9


def sensor_point(x: float, y: float, direction: float) -> Point:
    """Return the place of a sensor on the robot's rim.

    Parameters
    ----------
    x, y : float
        The robot's centre, units.
    direction : float
        The sensor's axis, radians.

    Returns
    -------
    x, y : float
    """
    return x + SENSOR_OFFSET * math.cos(direction), y + SENSOR_OFFSET * math.sin(direction)


def nearest_point(
    walls: WallMap, x: float, y: float, direction: float, *, every_point: bool = False
) -> Point | None:
    """Find the wall point that a sensor's distance belongs to.

    Parameters
    ----------
    walls : WallMap
    x, y : float
        The robot's centre, units.
    direction : float
        The sensor's axis, radians.
    every_point : bool
        False: what the real sensor looks at (three rays, and corners in the cone); True: all of the cone.

    Returns
    -------
    (float, float) or None
        None if no wall is in the cone.
    """
    place = sensor_point(x, y, direction)
    candidates = list(_candidates(walls, place, direction, every_point))
    if not candidates:
        return None
    return min(candidates, key=lambda point: math.dist(point, place))


def _candidates(walls: WallMap, place: Point, direction: float, every_point: bool) -> Iterator[Point]:
    for corner in walls.start:  # each corner begins a face
        if _in_cone(place, direction, (float(corner[0]), float(corner[1]))):
            yield float(corner[0]), float(corner[1])
    for start, end in zip(walls.start, walls.end, strict=True):
        for edge in (-HALF_APERTURE, 0.0, HALF_APERTURE):
            yield from _crossing(place, direction + edge, start, end)
        if every_point:
            way = end - start
            share = float(np.dot(np.asarray(place) - start, way) / np.dot(way, way))
            foot = start + share * way
            if 0.0 <= share <= 1.0 and _in_cone(place, direction, (float(foot[0]), float(foot[1]))):
                yield float(foot[0]), float(foot[1])


def _in_cone(place: Point, direction: float, point: Point) -> bool:
    bearing = math.atan2(point[1] - place[1], point[0] - place[0]) - direction
    return abs(math.remainder(bearing, 2 * math.pi)) <= HALF_APERTURE + _TOLERANCE


def _crossing(place: Point, angle: float, start: np.ndarray, end: np.ndarray) -> Iterator[Point]:
    """Yield where a ray meets a face, if it does."""
    ux, uy = math.cos(angle), math.sin(angle)
    wx, wy = end - start
    across = ux * wy - uy * wx
    if abs(across) < _TOLERANCE:  # along the face: its nearer end is a corner, which counts anyway
        return
    dx, dy = start[0] - place[0], start[1] - place[1]
    distance = (dx * wy - dy * wx) / across
    share = (dx * uy - dy * ux) / across
    if distance >= 0.0 and -_TOLERANCE <= share <= 1.0 + _TOLERANCE:
        yield float(place[0] + distance * ux), float(place[1] + distance * uy)
