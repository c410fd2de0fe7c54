"""Distances that an IR sensor takes at many places, in evenly spaced directions.

The rule is that of `ciberrato.infrared.model.sensor_distances` (the least of three rays and of the corners in
the cone), computed for whole sets of places at once. Rays: with the axes turned along a ray, a face is met by
the sensors whose coordinate across the ray lies between those of its ends; they are one run of the sensors
sorted by that coordinate. Corners: no corner beyond the longest ray of a neighbourhood can be the nearest
there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import HALF_APERTURE, SENSOR_OFFSET

_TOUCH = 1e-9
_TILE = 1.0  # units; size of a neighbourhood
_CHUNK = 200_000  # elements worked on at once, to stay in the cache


def tabulate_distances(
    walls: WallMap,
    places: Floats,
    directions: Floats,
    *,
    progress: Callable[[float], None] | None = None,
) -> Floats:
    """Compute the distance that a sensor takes in every place and direction.

    Parameters
    ----------
    walls : WallMap
    places : array, shape (places, 2)
        Centres of the robot, in units.
    directions : array, shape (directions,)
        Axes of the sensor in the lab's frame, in radians.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    array, shape (directions, places)
        Units; infinite where no wall is seen.
    """
    table = np.empty((len(directions), len(places)))
    for number, direction in enumerate(directions):
        table[number] = _least_ray(walls, places, float(direction))
        if progress is not None:
            progress(0.6 * (number + 1) / len(directions))
    _apply_corners(walls, places, directions, table, progress)
    return table


def _least_ray(walls: WallMap, places: Floats, direction: float) -> Floats:
    sensors = places + SENSOR_OFFSET * np.array([math.cos(direction), math.sin(direction)])
    best = np.full(len(places), np.inf)
    for turn in (0.0, HALF_APERTURE, -HALF_APERTURE):
        np.minimum(best, _rays(walls, sensors, direction + turn), out=best)
    return best


def _rays(walls: WallMap, sensors: Floats, direction: float) -> Floats:
    """Compute the distance to the first face along parallel rays; sensors on a face see it."""
    ray = np.array([math.cos(direction), math.sin(direction)])
    normal = np.array([-ray[1], ray[0]])
    along, across = sensors @ ray, sensors @ normal
    order = np.argsort(across, kind="stable")
    along, across = along[order], across[order]
    start_u, start_v = walls.start @ ray, walls.start @ normal
    end_u, end_v = walls.end @ ray, walls.end @ normal
    rise = end_v - start_v
    seen = np.flatnonzero(np.abs(rise) > _TOUCH * walls.length)
    low = np.searchsorted(across, np.minimum(start_v, end_v) - _TOUCH)
    high = np.searchsorted(across, np.maximum(start_v, end_v) + _TOUCH, side="right")
    best = np.full(len(sensors), np.inf)
    for face in seen:
        run = slice(low[face], high[face])
        if run.start == run.stop:
            continue
        slope = (end_u[face] - start_u[face]) / rise[face]
        reach = start_u[face] - start_v[face] * slope + across[run] * slope - along[run]
        reach[reach < -_TOUCH] = np.inf
        np.minimum(best[run], reach, out=best[run])
    result = np.empty_like(best)
    result[order] = np.maximum(best, 0.0)
    return result


def _apply_corners(
    walls: WallMap,
    places: Floats,
    directions: Floats,
    table: Floats,
    progress: Callable[[float], None] | None,
) -> None:
    """Apply the nearest corner in the cone where it is nearer than the rays."""
    offset_x, offset_y = SENSOR_OFFSET * np.cos(directions), SENSOR_OFFSET * np.sin(directions)
    cosine, sine = np.cos(directions)[:, np.newaxis], np.sin(directions)[:, np.newaxis]
    tangent = math.tan(HALF_APERTURE)
    all_corners = np.unique(walls.start, axis=0)
    tile = np.floor(places / _TILE).astype(np.int64)
    keys, members = np.unique(tile[:, 1] * 100_000 + tile[:, 0], return_inverse=True)
    order = np.argsort(members, kind="stable")
    bounds = np.searchsorted(members[order], np.arange(len(keys) + 1))
    for number in range(len(keys)):
        group = order[bounds[number] : bounds[number + 1]]
        x, y = places[group].T
        reach = table[:, group].max() + SENSOR_OFFSET
        middle = np.array([(x.min() + x.max()) / 2.0, (y.min() + y.max()) / 2.0])
        radius = math.hypot(x.max() - middle[0], y.max() - middle[1])
        near = np.hypot(*(all_corners - middle).T) <= reach + radius + 1e-6
        corners = all_corners[near]
        if progress is not None and number % 8 == 0:
            progress(0.6 + 0.4 * number / len(keys))
        step = max(_CHUNK // (len(directions)), 1)
        for corner_x, corner_y in corners:
            for first in range(0, len(group), step):
                some = group[first : first + step]
                dx = (corner_x - places[some, 0]) - offset_x[:, np.newaxis]
                dy = (corner_y - places[some, 1]) - offset_y[:, np.newaxis]
                forward = dx * cosine + dy * sine
                sideways = np.abs(dy * cosine - dx * sine)
                distance = np.sqrt(dx * dx + dy * dy)
                distance[sideways > forward * tangent + _TOUCH] = np.inf
                table[:, some] = np.minimum(table[:, some], distance)
