"""Distances of an IR sensor that sits exactly on a wall: the real simulator's own rules, angle by angle.

A robot that just touches a wall has a sensor point on a face. Then it hangs on the last bit of an arc
tangent whether that face is seen, at distance 0, or looked through, and only the same arithmetic gives the
same answer. Everywhere else these rules agree with `ciberrato.infrared.model.sensor_distances` within
rounding, and are much slower; with the sensor's place from `ciberrato.infrared.exact.exact_distance` they
equal the recorded distances of the real simulator to the last bit.

A ray at an angle hits a face if the angle lies between those of the face's ends, the short way round, ends
included; the hit is where the two straight lines cross. A face seen edge-on counts with its nearer end if
the angles are equal.
"""

from __future__ import annotations

import math

from ciberrato.geometry.angles import bearing, wrap_once
from ciberrato.geometry.nearest_faces import NearbyFaces

_QUARTER = math.pi / 2
_HALF_APERTURE = math.pi / 6


def distance_by_angles(walls: NearbyFaces, x: float, y: float, direction: float) -> float:
    """Compute the distance that the real sensor measures, the least of three rays and corners in the cone.

    Parameters
    ----------
    walls : NearbyFaces
        All sides of all walls; every corner is the start of one of them.
    x, y : float
        Place of the sensor, in units.
    direction : float
        Its axis in radians, wrapped once. It may still be beyond ±π, as that of a robot that starts with a
        heading of two turns: then every corner counts, and of the faces those that straddle ±π.

    Returns
    -------
    float
        Units; infinite where no wall is seen.
    """
    rays = (direction, wrap_once(direction + _HALF_APERTURE), wrap_once(direction - _HALF_APERTURE))
    nearest = math.inf
    for bound, (x0, y0, x1, y1, *_) in walls.nearest_first(x, y):
        if bound > nearest:
            break
        start, end = bearing(x, y, x0, y0), bearing(x, y, x1, y1)
        if _aside(start, direction) <= _HALF_APERTURE:
            nearest = min(nearest, _length(x, y, x0, y0))
        for ray in rays:
            if start == end:
                if ray == start:
                    nearest = min(nearest, _length(x, y, x0, y0), _length(x, y, x1, y1))
            elif _between(ray, start, end):
                hit = _crossing(x, y, ray, x0, y0, x1, y1)
                if hit is not None:
                    nearest = min(nearest, _length(x, y, *hit))
    return nearest


def ray_distance_by_angles(walls: NearbyFaces, x: float, y: float, angle: float) -> float:
    """Compute the distance along one ray to the nearest wall, by the same rules.

    Parameters
    ----------
    walls : NearbyFaces
    x, y : float
        Origin of the ray, in units.
    angle : float
        Radians, wrapped once.

    Returns
    -------
    float
        Units; infinite where no wall is hit.
    """
    nearest = math.inf
    for bound, (x0, y0, x1, y1, *_) in walls.nearest_first(x, y):
        if bound > nearest:
            break
        start, end = bearing(x, y, x0, y0), bearing(x, y, x1, y1)
        if start == end:
            if angle == start:
                nearest = min(nearest, _length(x, y, x0, y0), _length(x, y, x1, y1))
        elif _between(angle, start, end):
            hit = _crossing(x, y, angle, x0, y0, x1, y1)
            if hit is not None:
                nearest = min(nearest, _length(x, y, *hit))
    return nearest


def _aside(one: float, other: float) -> float:
    """Compute the angle between two directions; below 0 if one is beyond ±π, to be within any other."""
    aside = abs(one - other)
    return 2 * math.pi - aside if aside > math.pi else aside


def _between(angle: float, one: float, other: float) -> bool:
    least, greatest = min(one, other), max(one, other)
    if greatest - least <= math.pi:
        return least <= angle <= greatest
    return angle >= greatest or angle <= least


def _crossing(
    x: float, y: float, angle: float, x0: float, y0: float, x1: float, y1: float
) -> tuple[float, float] | None:
    """Compute where the line through a point at an angle crosses that through two others; None if nowhere."""
    if x0 == x1:
        return None if angle == _QUARTER else (x0, y + math.tan(angle) * (x0 - x))
    slope = (y1 - y0) / (x1 - x0)
    if angle == _QUARTER:
        return x, y0 + slope * (x - x0)
    tangent = math.tan(angle)
    if tangent == slope:
        return None
    # Cramer's rule for the two lines y = slope x + offset: to the last bit what the real simulator has.
    offset, ray_offset = y0 - slope * x0, y - tangent * x
    difference = tangent - slope
    return (offset - ray_offset) / difference, (tangent * offset - slope * ray_offset) / difference


def _length(x0: float, y0: float, x1: float, y1: float) -> float:
    return math.sqrt((x0 - x1) * (x0 - x1) + (y0 - y1) * (y0 - y1))
