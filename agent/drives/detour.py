"""Ways between places that no straight way between cell centres joins, over the squares of the lattice."""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection

import numpy as np

from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief.lattice import Lattice

Place = tuple[float, float]

_STEPS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)]
_ROOMY = 0.85  # units; ways nearer to walls count as longer
_LOOK = 0.1
_WAY_OUT = 0.35


def clear_way(walls: WallMap, begin: Place, end: Place, room: float) -> bool:
    """Say whether a straight way keeps clear of walls.

    Parameters
    ----------
    walls : WallMap
    begin, end : (float, float)
        Units. The robot may begin nearer to a wall than it is to get, if it gets no nearer.
    room : float
        Units.

    Returns
    -------
    bool
    """
    length = math.hypot(end[0] - begin[0], end[1] - begin[1])
    share = np.linspace(0.0, 1.0, max(math.ceil(length / _LOOK), 1) + 1)
    rooms = walls.distance(begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1]))
    leaving = (share * length <= _WAY_OUT) & (rooms >= rooms[0] - 1e-9)
    return bool(((rooms >= room) | leaving).all())


def shortest_detour(
    lattice: Lattice,
    walls: WallMap,
    begin: Place,
    ends: Collection[Place],
    room: float,
    longest: float = math.inf,
) -> list[Place]:
    """Find the shortest way from a place to the nearest of some others.

    Parameters
    ----------
    lattice : Lattice
    walls : WallMap
    begin : (float, float)
        Units.
    ends : collection of (float, float)
        Nodes of the lattice.
    room : float
        Units that all nodes of the way are away from walls, but for the first.
    longest : float
        Length at which the search is given up, in units.

    Returns
    -------
    list of (float, float)
        Corners of the way, the beginning left out; empty if there is none.
    """
    first = int(((lattice.x - begin[0]) ** 2 + (lattice.y - begin[1]) ** 2).argmin())
    goals = {_square(lattice, end) for end in ends} - {lattice.size}
    usable = np.append(lattice.clearance >= room, False)
    factor = 1.0 + 4.0 * np.maximum(_ROOMY - lattice.clearance, 0.0)
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
    way = [square]
    while before[way[-1]] != way[-1]:
        way.append(before[way[-1]])
    places = [(float(lattice.x[number]), float(lattice.y[number])) for number in way[::-1]]
    return _corners(walls, [begin, *(places[1:] or places)], room)


def _square(lattice: Lattice, place: Place) -> int:
    column = round((place[0] - lattice.origin[0]) / lattice.resolution)
    row = round((place[1] - lattice.origin[1]) / lattice.resolution)
    if not (0 <= column < lattice.nx and 0 <= row < lattice.ny):
        return lattice.size
    return int(lattice.index[row * lattice.nx + column])


def _corners(walls: WallMap, places: list[Place], room: float) -> list[Place]:
    """Leave out the places between which one can drive straight on."""
    corners, at = [], 0
    while at < len(places) - 1:
        beyond = at + 1
        while beyond + 1 < len(places) and clear_way(walls, places[at], places[beyond + 1], room):
            beyond += 1
        corners.append(places[beyond])
        at = beyond
    return corners
