"""Turn, drive, turn for a list of states: the prediction of `TurnDriveTurn` where the belief has mass.

The states' places are rows of a small dense array (places, headings); a turn is a product of it with the
matrix of all headings, a drive sends every state along the few entries of its direction's kernel. What is
computed equals the whole grid's prediction entry by entry; work and memory go with the states listed.
"""

from __future__ import annotations

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
    power = flat.view(np.int64) >> 52
    below = np.cumsum(np.bincount(power, flat))
    level = int(np.searchsorted(below, allowed, side="right"))
    if level == 0 or below[level - 1] == 0.0:
        return np.flatnonzero(flat), 0.0
    return np.flatnonzero(power >= level), float(below[level - 1])


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
    headings, directions = first.shape
    columns = free.shape[1]
    total = float(masses.sum())
    place, heading = np.divmod(states, headings)
    begins = np.empty(len(place), dtype=bool)
    begins[:1] = True
    np.not_equal(place[1:], place[:-1], out=begins[1:])
    places = place[begins]
    image = np.zeros((len(places), headings))
    image[np.cumsum(begins) - 1, heading] = masses
    image = image @ first
    chosen, left_out = heavy(image, 0.5 * skip * total)
    row, direction = np.divmod(chosen, directions)
    used = np.flatnonzero(np.bincount(direction, minlength=directions))
    moves = kernels(used)
    # Grid with a border as wide as the longest drive, so that targets are sums of numbers.
    border = int(np.abs(moves.cells).max(initial=0))
    wide = columns + 2 * border
    inside = np.pad(free, border).ravel()
    at = (places // columns + border) * wide + places % columns + border
    steps, shares = _by_direction(moves, len(used), wide)
    number = np.searchsorted(used, np.arange(directions))[direction]
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
    key *= directions
    key += np.repeat(direction, steps.shape[1])
    after = np.bincount(key, moved, len(reached) * directions)[: len(reached) * directions]
    result = after.reshape(len(reached), directions) @ last
    chosen, rest = heavy(result, 0.5 * skip * total)
    row, heading = np.divmod(chosen, headings)
    x, y = np.divmod(reached[row], wide)
    states = ((x - border) * columns + y - border) * headings + heading
    return States(states, result.ravel()[chosen], left_out + rest)


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
