"""Schedule of meetings, with the start places.

Two in a run: the circle method, in which every two agents meet once in each cycle of rounds. More in a run:
rounds are drawn, each agent once a round, so that those meet who have met least (the sum of former meetings
within groups is made as small as swaps can make it), until all have met, or for as many rounds as are asked
for. Groups of a round differ by one agent at most.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, count, islice, product

import numpy as np
from numpy.typing import NDArray

from ciberrato.reprs import short_repr

DRAWS = 4
"""Draws of a round from which the best is taken."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Agents that meet in a run.

    Attributes
    ----------
    round, group, turn : int
        From 1; the turns of a group are the same agents from other places.
    agents : tuple of int
        Indices of agents, in order of the start places.
    """

    __repr__ = short_repr

    round: int
    group: int
    turn: int
    agents: tuple[int, ...]


def schedule(
    agents: int, robots: int, *, rounds: int | None, rotate: bool, generator: np.random.Generator
) -> list[Meeting]:
    """Draw a tournament.

    Parameters
    ----------
    agents : int
        2 or more.
    robots : int
        In a run at most, 2 or more.
    rounds : int or None
        None = until every two have met.
    rotate : bool
        Whether there is a turn for each start place, in which every agent of a group is shifted by one.
    generator : numpy.random.Generator

    Returns
    -------
    list of Meeting
        By round, group and turn.
    """
    met = np.zeros((agents, agents), dtype=np.int64)
    stood = np.zeros((agents, robots), dtype=np.int64)
    order = generator.permutation(agents)
    drawn = _circle(order) if min(agents, robots) == 2 else _draws(met, robots, generator)
    meetings = []
    for number, groups in enumerate(drawn, 1):
        for group, members in enumerate(groups, 1):
            for one, other in combinations(members, 2):
                met[one, other] += 1
                met[other, one] += 1
            for turn, placed in enumerate(_turns(members, stood, rotate=rotate), 1):
                stood[list(placed), range(len(placed))] += 1
                meetings.append(Meeting(number, group, turn, placed))
        if number == rounds or (rounds is None and np.all(met + np.eye(agents, dtype=np.int64))):
            break
    return meetings


def _circle(order: NDArray[np.int64]) -> Iterator[list[list[int]]]:
    """Pair agents, without end; with an odd number one of them rests in each round."""
    ring: list[int | None] = [int(one) for one in order]
    if len(ring) % 2:
        ring.append(None)
    half = len(ring) // 2
    while True:
        pairs = zip(ring[:half], reversed(ring[half:]), strict=True)
        yield [[one, other] for one, other in pairs if one is not None and other is not None]
        ring = [ring[0], ring[-1], *ring[1:-1]]


def _draws(met: NDArray[np.int64], robots: int, generator: np.random.Generator) -> Iterator[list[list[int]]]:
    """Draw rounds, without end; ``met`` is counted up by the caller between them."""
    agents = len(met)
    groups = -(-agents // robots)
    sizes = [agents // groups + (number < agents % groups) for number in range(groups)]
    for _ in count():
        drawn = (_settle(_cut(generator.permutation(agents), sizes), met) for _ in range(DRAWS))
        yield min(drawn, key=lambda found: _former(found, met))


def _cut(order: NDArray[np.int64], sizes: list[int]) -> list[list[int]]:
    rest = iter(order.tolist())
    return [list(islice(rest, size)) for size in sizes]


def _former(groups: list[list[int]], met: NDArray[np.int64]) -> int:
    """Count former meetings of those that are in a group."""
    return sum(int(met[np.ix_(group, group)].sum()) for group in groups) // 2


def _settle(groups: list[list[int]], met: NDArray[np.int64]) -> list[list[int]]:
    """Swap agents between groups as long as that brings former meetings down."""
    times: list[list[int]] = met.tolist()
    better = True
    while better:
        better = False
        for one, other in combinations(groups, 2):
            for i, k in product(range(len(one)), range(len(other))):
                a, b = one[i], other[k]
                # Each leaves its group and joins the other's, which the one it is swapped with has left.
                gain = 2 * times[a][b]
                gain += sum(times[a][c] - times[b][c] for c in one)
                gain += sum(times[b][c] - times[a][c] for c in other)
                if gain > 0:
                    one[i], other[k] = b, a
                    better = True
    return groups


def _turns(members: list[int], stood: NDArray[np.int64], *, rotate: bool) -> list[tuple[int, ...]]:
    """Return the start places of a group: all shifts, or those that best balance where agents stood."""
    if rotate:
        return [tuple(members[turn:] + members[:turn]) for turn in range(len(members))]
    from scipy.optimize import linear_sum_assignment

    _, chosen = linear_sum_assignment(stood[members, : len(members)].T)
    return [tuple(members[one] for one in chosen)]
