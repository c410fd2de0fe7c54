"""Paths between places that no straight line between cell centres joins, over the squares of the lattice."""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection

import numpy as np

from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.world.coordinates import Point

_STEPS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)]
_AMPLE = 0.85  # units; steps nearer to walls count as longer
_LOOK = 0.1
_LEAVING = 0.35


def is_clear(walls: WallMap, begin: Point, end: Point, clearance: float) -> bool:
    """Return whether a straight line keeps clear of walls.

    Parameters
    ----------
    walls : WallMap
    begin, end : (float, float)
        Units. The robot may begin nearer to a wall than it is to get, if it gets no nearer.
    clearance : float
        Units.

    Returns
    -------
    bool
    """
    length = math.hypot(end[0] - begin[0], end[1] - begin[1])
    share = np.linspace(0.0, 1.0, max(math.ceil(length / _LOOK), 1) + 1)
    distances = walls.distance(begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1]))
    leaving = (share * length <= _LEAVING) & (distances >= distances[0] - 1e-9)
    return bool(((distances >= clearance) | leaving).all())


def shortest_detour(
    lattice: Lattice,
    walls: WallMap,
    begin: Point,
    ends: Collection[Point],
    clearance: float,
    longest: float = math.inf,
) -> list[Point]:
    """Find the shortest path from a place to the nearest of some others.

    Parameters
    ----------
    lattice : Lattice
    walls : WallMap
    begin : (float, float)
        Units.
    ends : collection of (float, float)
        Nodes of the lattice.
    clearance : float
        Units that all nodes of the path are away from walls, but for the first.
    longest : float
        Length at which the search is given up, in units.

    Returns
    -------
    list of (float, float)
        Corners of the path, the beginning left out; empty if there is none.
    """
    first = int(((lattice.x - begin[0]) ** 2 + (lattice.y - begin[1]) ** 2).argmin())
    goals = {_square(lattice, end) for end in ends} - {lattice.size}
    usable = np.append(lattice.clearance >= clearance, False)
    factor = 1.0 + 4.0 * np.maximum(_AMPLE - lattice.clearance, 0.0)
    steps = [(lattice.neighbours(dx, dy), lattice.resolution * math.hypot(dx, dy)) for dx, dy in _STEPS]
    before: dict[int, int] = {}
    costs = {first: 0.0}
    queue = [(0.0, first, first)]
    square = first
    while queue:
        cost, square, parent = heapq.heappop(queue)
        if square in before:
            continue
        before[square] = parent
        if square in goals or cost > longest:
            break
        for neighbours, length in steps:
            other = int(neighbours[square])
            if not usable[other] or other in before:
                continue
            total = cost + length * float(factor[other])
            if total < costs.get(other, math.inf):
                costs[other] = total
                heapq.heappush(queue, (total, other, square))
    if square not in goals:
        return []
    squares = [square]
    while before[squares[-1]] != squares[-1]:
        squares.append(before[squares[-1]])
    places = [(float(lattice.x[number]), float(lattice.y[number])) for number in squares[::-1]]
    return _corners(walls, [begin, *(places[1:] or places)], clearance)


def _square(lattice: Lattice, place: Point) -> int:
    column = round((place[0] - lattice.origin[0]) / lattice.resolution)
    row = round((place[1] - lattice.origin[1]) / lattice.resolution)
    if not (0 <= column < lattice.nx and 0 <= row < lattice.ny):
        return lattice.size
    return int(lattice.index[row * lattice.nx + column])


def _corners(walls: WallMap, places: list[Point], clearance: float) -> list[Point]:
    """Remove the places between which a robot can drive straight on."""
    corners, at = [], 0
    while at < len(places) - 1:
        beyond = at + 1
        while beyond + 1 < len(places) and is_clear(walls, places[at], places[beyond + 1], clearance):
            beyond += 1
        corners.append(places[beyond])
        at = beyond
    return corners
