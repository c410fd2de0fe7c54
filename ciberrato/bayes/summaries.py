"""Summaries of a belief: entropy, most likely cells, hypotheses, means, credible sets.

Beliefs need not sum to 1 (the masses named here are shares of their sum), but must have some mass and be
finite and not negative: a ValueError says which cell is not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import belief_array
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr


def entropy_bits(belief: ArrayLike) -> float:
    """Compute the Shannon entropy in bits: 0 when certain, log2 of the number of states when uniform."""
    masses = belief_array(belief).ravel()
    masses = masses[masses > 0.0]
    total = float(masses.sum())
    # H = -sum m/s log(m/s). Zero or more by mathematics; rounding may make it -1e-16.
    return max(0.0, float(np.log2(total) - (masses * np.log2(masses)).sum() / total))


def most_likely_cell(belief: ArrayLike) -> tuple[int, ...]:
    """Find the index of the greatest cell; of several equal ones the first in row-major order."""
    belief = belief_array(belief)
    return tuple(int(i) for i in np.unravel_index(int(belief.argmax()), belief.shape))


def most_likely_cells(belief: ArrayLike, *, tolerance: float = 1e-9) -> IntArray:
    """Return all cells that share the greatest probability.

    Parameters
    ----------
    belief : array_like
        Any shape.
    tolerance : float
        Relative difference up to which two cells count as tied: symmetric states differ by rounding.

    Returns
    -------
    IntArray, shape (ties, number of axes)
        Indices in row-major order; at least one.
    """
    belief = belief_array(belief)
    if not 0.0 <= tolerance <= 1.0:
        raise ValueError(f"a relative tolerance is in [0, 1], not {tolerance}")
    return np.argwhere(belief >= belief.max() * (1.0 - tolerance))


class Mode(NamedTuple):
    """One hypothesis: a hill of the belief.

    Attributes
    ----------
    peak : tuple of int
        Index of its greatest cell.
    mass : float
        Mass of all cells whose steepest ascent ends at the peak, as a share of the belief's.
    cells : int
        Number of these cells.
    """

    peak: tuple[int, ...]
    mass: float
    cells: int

    def __repr__(self) -> str:
        return short_repr(self)


def modes(belief: ArrayLike, *, space: StateSpace | None = None, least_mass: float = 0.01) -> list[Mode]:
    """Split a belief into hills and return those with enough mass.

    Each cell leads to its greatest neighbour (orthogonal and diagonal) that is greater than itself; the cells
    that lead to one peak are one hypothesis. Neighbours of equal probability go together, so that a flat top
    is one hill and a shelf on a slope none.

    Parameters
    ----------
    belief : array_like
        Any shape.
    space : StateSpace, optional
        Tells which axes are periodic; none if not given.
    least_mass : float
        Hills below this are left out; the masses left out are what is missing from a sum of 1.

    Returns
    -------
    list of Mode
        By falling mass; of equal masses the first in row-major order.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    belief = belief_array(belief) if space is None else space.checked_belief(belief)
    belief = np.asarray(belief / belief.sum())
    if not 0.0 <= least_mass <= 1.0:
        raise ValueError(f"a share of the mass is in [0, 1], not {least_mass}")
    index = np.arange(belief.size).reshape(belief.shape)
    best, target = belief.copy(), index.copy()
    equal_from, equal_to = [], []
    for offset in np.ndindex(*(3,) * belief.ndim):
        step = tuple(1 - o for o in offset)
        if not any(step):
            continue
        value, neighbour = (np.roll(array, step, axis=tuple(range(belief.ndim))) for array in (belief, index))
        exists = _neighbour_exists(belief.shape, step, space)
        same = exists & (value == belief) & (belief > 0.0)
        equal_from.append(index[same])
        equal_to.append(neighbour[same])
        greater = exists & (value > best)
        best, target = np.where(greater, value, best), np.where(greater, neighbour, target)
    # The graph routines of scipy 1.11 take no other integers.
    ends = tuple(np.concatenate(end).astype(np.int32) for end in (equal_from, equal_to))
    flats, flat = connected_components(coo_array((np.ones(len(ends[0])), ends), shape=(belief.size,) * 2))
    # Each flat goes where the steepest of its cells goes; lexsort puts that cell first.
    order = np.lexsort((index.ravel(), -best.ravel(), flat))
    steepest = order[np.searchsorted(flat[order], np.arange(flats))]
    root = flat[target.ravel()[steepest]]
    while not np.array_equal(root[root], root):  # the chains' lengths halve each time
        root = root[root]
    hill_of = root[flat]
    mass = np.bincount(hill_of, weights=belief.ravel(), minlength=flats)
    cells = np.bincount(hill_of[belief.ravel() > 0.0], minlength=flats)
    found = np.flatnonzero(mass >= max(least_mass, np.finfo(float).tiny))
    hills = []
    for hill in found:
        # Of a peak that is flat, the first cell.
        peak = np.unravel_index(int(steepest[hill]), belief.shape)
        hills.append(Mode(tuple(int(i) for i in peak), float(mass[hill]), int(cells[hill])))
    return sorted(hills, key=lambda hill: (-hill.mass, hill.peak))


def _neighbour_exists(shape: tuple[int, ...], step: tuple[int, ...], space: StateSpace | None) -> BoolArray:
    exists = np.ones(shape, dtype=bool)
    for i, (size, s) in enumerate(zip(shape, step, strict=True)):
        if s and not (space is not None and space.axes[i].periodic):
            place = np.arange(size) - s
            ends = (place >= 0) & (place < size)
            exists &= ends.reshape((-1,) + (1,) * (len(shape) - 1 - i))
    return exists


class Moments(NamedTuple):
    """Mean and spread of a belief.

    Attributes
    ----------
    mean : FloatArray, shape (number of axes,)
        On periodic axes the circular mean, within the axis' range.
    covariance : FloatArray, shape (number of axes, number of axes)
        Covariance of the differences from the mean, taken the short way round on periodic axes.
    concentration : FloatArray, shape (number of axes,)
        On periodic axes the length of the mean direction vector, 0 (no preferred direction, the mean means
        nothing) to 1 (certain); 1 on bounded axes.
    """

    mean: FloatArray
    covariance: FloatArray
    concentration: FloatArray

    def __repr__(self) -> str:
        return short_repr(self)


def moments(belief: ArrayLike, space: StateSpace) -> Moments:
    """Return mean and covariance over the cell centres, circular on periodic axes.

    Parameters
    ----------
    belief : array_like
        Shape of the space; need not be normalized but must have mass.
    space : StateSpace
        Its axes.
    """
    masses = space.checked_belief(belief)
    masses = masses / masses.sum()
    mean, concentration, differences = [], [], []
    for i, axis in enumerate(space.axes):
        others = tuple(j for j in range(masses.ndim) if j != i)
        marginal, centres = masses.sum(axis=others), axis.centres
        centre, strength = float(marginal @ centres), 1.0
        if axis.periodic:
            turn = 2.0 * np.pi / axis.length
            vector = complex(marginal @ np.exp(1j * turn * (centres - axis.origin)))
            centre = axis.origin + float(np.angle(vector)) / turn % axis.length
            strength = abs(vector)
        mean.append(centre)
        concentration.append(strength)
        differences.append(axis.difference(centres, centre))
    covariance = np.empty((masses.ndim, masses.ndim))
    for i in range(masses.ndim):
        for j in range(i, masses.ndim):
            others = tuple(k for k in range(masses.ndim) if k not in (i, j))
            pair = masses.sum(axis=others)
            value = pair @ differences[i] ** 2 if i == j else differences[i] @ pair @ differences[j]
            covariance[i, j] = covariance[j, i] = value
    return Moments(np.array(mean), covariance, np.array(concentration))


def marginal(belief: ArrayLike, space: StateSpace, *names: str) -> FloatArray:
    """Sum out all axes but those named; the result's axes are in the order of the names."""
    keep = [space.position(name) for name in names]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"name each axis to keep once, and one at least, not {names}")
    kept_in_order = sorted(keep)
    summed = space.checked_belief(belief).sum(axis=tuple(i for i in range(len(space.axes)) if i not in keep))
    return np.transpose(summed, [kept_in_order.index(i) for i in keep])


def credible_set(belief: ArrayLike, mass: float = 0.95) -> BoolArray:
    """Return the smallest set of cells that holds at least `mass` of the belief.

    Parameters
    ----------
    belief : array_like
        Any shape.
    mass : float
        Share of the whole, in (0, 1].

    Returns
    -------
    BoolArray
        Same shape. Cells that tie with the last one taken are all taken, so that symmetric states are treated
        alike.
    """
    if not 0.0 < mass <= 1.0:
        raise ValueError(f"the mass of a credible set is in (0, 1], not {mass}")
    belief = belief_array(belief)
    belief = np.asarray(belief / belief.sum())
    falling = np.sort(belief.ravel())[::-1]
    needed = min(int(np.searchsorted(np.cumsum(falling), mass - 1e-12)), belief.size - 1)
    return np.asarray((belief >= falling[needed] * (1.0 - 1e-9)) & (belief > 0.0))
