"""Turn, drive, turn for a list of states: the prediction of `TurnDriveTurn` where the belief has mass.

The states' places are rows of a small dense array (places, headings); a turn is a product of it with the
matrix of all headings, a drive sends every state along the few entries of its direction's kernel. What is
computed equals the whole grid's prediction entry by entry; work and memory go with the states listed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.motion.lattice import LatticeKernels
from ciberrato.reprs import short_repr


class States(NamedTuple):
    """A belief as a list of states.

    Attributes
    ----------
    states : IntArray, shape (n,)
        Numbers of cells in the raveled belief, rising.
    masses : FloatArray, shape (n,)
        Need not sum to 1.
    left_out : float
        Mass of states that were given up because they hold too little.
    """

    states: IntArray
    masses: FloatArray
    left_out: float

    def __repr__(self) -> str:
        return short_repr(self)


def heavy(masses: FloatArray, allowed: float) -> tuple[IntArray, float]:
    """Return the states to keep, numbers in the raveled array, and the mass of the others.

    Parameters
    ----------
    masses : FloatArray
        0 or more, C order.
    allowed : float
        Greatest mass to leave out. States of zero are never kept.

    Notes
    -----
    Sums by powers of two take the place of a sort: what is kept holds at least the greatest power of two
    for which the rest is allowed.
    """
    flat = masses.ravel()
    # What is below this can all be left out, whatever its number.
    sure = math.ldexp(1.0, math.frexp(allowed / max(1, flat.size))[1] - 1) if allowed > 0.0 else 0.0
    able = np.flatnonzero(flat >= sure) if sure > 0.0 else np.flatnonzero(flat)
    values = flat[able]
    rest = 0.0
    if sure > 0.0:
        others = flat.copy()
        others[able] = 0.0
        rest = float(others.sum())
    power = values.view(np.int64) >> 52
    least = int(power.min(initial=2047))
    below = np.cumsum(np.bincount(power - least, values)) + rest
    level = int(np.searchsorted(below, allowed, side="right"))
    if level == 0 or below[level - 1] == rest:
        return able, rest
    return able[power >= least + level], float(below[level - 1])


def turn_drive_turn(
    states: IntArray,
    masses: FloatArray,
    first: FloatArray,
    kernels: Callable[[IntArray], LatticeKernels],
    last: FloatArray,
    free: BoolArray,
    skip: float,
) -> States:
    """Move listed states by a turn, a drive in whole cells and another turn.

    Parameters
    ----------
    states : IntArray, shape (n,)
        Numbers of cells (x, y, heading), rising.
    masses : FloatArray, shape (n,)
    first : FloatArray, shape (headings, directions)
        p(direction | heading before).
    kernels : callable
        Numbers of directions -> kernels of these.
    last : FloatArray, shape (directions, headings)
        p(heading after | direction).
    free : BoolArray, shape (x, y)
        Mass that ends elsewhere, or off the grid, is lost.
    skip : float
        Share of the mass that may be left out: at most half of it between turn and drive, half at the end.

    Returns
    -------
    States
        The mass left out is counted before the drive may lose some of it: a bound for the missing mass.
    """
    headings, columns = first.shape[0], free.shape[1]
    total = float(masses.sum())
    place, heading = np.divmod(states, headings)
    begins = np.empty(len(place), dtype=bool)
    begins[:1] = True
    np.not_equal(place[1:], place[:-1], out=begins[1:])
    places = place[begins]
    # Headings and directions that hold anything: few, where the belief is narrow.
    held, at = _used(heading, headings)
    image = np.zeros((len(places), len(held)))
    image[np.cumsum(begins) - 1, at] = masses
    turn = first[held]
    aimed = np.flatnonzero(turn.any(axis=0))
    image = image @ turn[:, aimed]
    chosen, left_out = heavy(image, 0.5 * skip * total)
    row, direction = np.divmod(chosen, max(1, len(aimed)))
    used, number = _used(direction, len(aimed))
    moves = kernels(aimed[used])
    # Grid with a border as wide as the longest drive, so that targets are sums of numbers.
    border = int(np.abs(moves.cells).max(initial=0))
    wide = columns + 2 * border
    inside = np.pad(free, border).ravel()
    at = (places // columns + border) * wide + places % columns + border
    steps, shares = _by_direction(moves, len(used), wide)
    target = (at[row][:, np.newaxis] + steps[number]).ravel()
    moved = (image.ravel()[chosen][:, np.newaxis] * shares[number]).ravel()
    np.multiply(moved, inside[target], out=moved)
    met = np.zeros(inside.shape, dtype=bool)
    met[target] = True
    met &= inside
    reached = np.flatnonzero(met)
    slot = np.zeros(inside.shape, dtype=np.intp)
    slot[reached] = np.arange(len(reached))
    key = slot[target]
    key *= len(used)
    key += np.repeat(number, steps.shape[1])
    size = len(reached) * len(used)
    after = (
        np.bincount(key, moved, size)[:size].reshape(len(reached), -1) if size else np.zeros((0, len(used)))
    )
    turn = last[aimed[used]]
    held = np.flatnonzero(turn.any(axis=0))
    result = after @ turn[:, held]
    chosen, rest = heavy(result, 0.5 * skip * total)
    row, heading = np.divmod(chosen, max(1, len(held)))
    heading = held[heading]
    x, y = np.divmod(reached[row], wide)
    states = ((x - border) * columns + y - border) * headings + heading
    return States(states, result.ravel()[chosen], left_out + rest)


def _used(numbers: IntArray, size: int) -> tuple[IntArray, IntArray]:
    """Return which numbers below a size there are, rising, and where each one given is among them."""
    there = np.zeros(size, dtype=bool)
    there[numbers] = True
    used = np.flatnonzero(there)
    place = np.empty(size, dtype=np.intp)
    place[used] = np.arange(len(used))
    return used, place[numbers]


def _by_direction(kernels: LatticeKernels, directions: int, wide: int) -> tuple[IntArray, FloatArray]:
    """Return steps on a grid of rows of this width, and their shares, both (directions, most entries)."""
    order = np.argsort(kernels.kernel, kind="stable")
    kernel = kernels.kernel[order]
    number = np.arange(len(kernel)) - np.searchsorted(kernel, kernel)
    most = int(number.max(initial=0)) + 1
    steps, shares = np.zeros((directions, most), dtype=np.intp), np.zeros((directions, most))
    steps[kernel, number] = kernels.cells[order] @ np.array([wide, 1])
    shares[kernel, number] = kernels.weights[order]
    return steps, shares
