"""The best round trip through all beacons, and the planning references, which end with it."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TypeVar

from simulator_stub.scoring.textmap import TextMap

Node = TypeVar("Node", bound=tuple[int, int])
Links = Mapping[Node, Sequence[tuple[Node, float]]]
"""From each node, the nodes next to it and how far they are."""

_ROUNDING = 1e-9
"""Tours this close have the same length; it would be chance which of them comes out shorter."""


def distances_from(start: Node, links: Links[Node]) -> dict[Node, float]:
    """Find how far it is to each node that can be reached."""
    found: dict[Node, float] = {}
    waiting = [(0.0, start)]
    while waiting:
        distance, node = heapq.heappop(waiting)
        if node not in found:
            found[node] = distance
            for neighbour, length in links.get(node, ()):
                if neighbour not in found:
                    heapq.heappush(waiting, (distance + length, neighbour))
    return found


def best_tour(distances: Sequence[Sequence[float]]) -> tuple[tuple[int, ...], float]:
    """Find the shortest round trip from place 0 through all places.

    Parameters
    ----------
    distances : sequence of sequence of float
        From each place to each; infinite where there is no way.

    Returns
    -------
    tour : tuple of int
        Begins and ends with 0. Of tours of the same length the one that is first in lexical order.
    length : float
    """

    @cache
    def rest(here: int, left: frozenset[int]) -> float:
        if not left:
            return distances[here][0]
        return min(distances[here][there] + rest(there, left - {there}) for there in left)

    left = frozenset(range(1, len(distances)))
    tour, length = [0], 0.0
    while left:
        here = tour[-1]
        best = rest(here, left)
        there = min(
            place
            for place in left
            if distances[here][place] + rest(place, left - {place}) <= best + _ROUNDING
        )
        length += distances[here][there]
        tour.append(there)
        left -= {there}
    length += distances[tour[-1]][0]
    return (*tour, 0), length


MOST_PLACES = 12
"""Places of a tour. With more there is none: the real simulator, which tries all orders, would take hours."""


def tour_lines(places: Sequence[Node], links: Links[Node]) -> str:
    """Write the tour and its length as in planning.out; nothing with fewer than two places, or too many."""
    if not 2 <= len(places) <= MOST_PLACES:
        return ""
    distances = []
    for place in places:
        found = distances_from(place, links)
        distances.append([found.get(other, math.inf) for other in places])
    tour, length = best_tour(distances)
    return "".join(f" {place}" for place in tour) + f"\n{length:f}\n"


def planning_text(drawing: TextMap, places: Sequence[Node], start: Node, links: Links[Node]) -> str:
    """Write planning.out: a map with the numbers of the targets in it, the best tour, its length.

    Parameters
    ----------
    drawing : TextMap
        The map; the numbers are drawn into it.
    places : sequence of (column, row)
        Places of the targets, in their order.
    start : (column, row)
        Cell in the middle of the map.
    links : mapping of node to sequence of (node, length)

    Returns
    -------
    str
    """
    for number, (column, row) in enumerate(places):
        drawing.draw(2 * (column - start[0]), 2 * (row - start[1]), str(number)[-1])
    return str(drawing) + tour_lines(places, links)
