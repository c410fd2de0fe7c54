"""Convolving a belief along its axes, and what happens at the edges of the space.

Units are cells. A kernel is weights and the offset of the first of them: mass at i goes to i + first + k with
weight k.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.reprs import short_repr

Edge = Literal["wrap", "stay", "lose"]
"""`wrap`: the axis is a circle. `stay`: mass that would leave stops in the border cell. `lose`: mass that
leaves is gone, and the sum of the belief says how much."""

EDGES: tuple[str, ...] = get_args(Edge)

# For a long line and few weights, products of pieces that stay in the cache are several times as fast as
# numpy's own convolution.
_LONG, _FEW, _PIECE = 1500, 40, 8192
# Standard deviation of a kernel, in cells, beyond which it must be a mistake.
_WIDEST = 1e6


class Kernel(NamedTuple):
    """A distribution over whole cells along one axis.

    Attributes
    ----------
    first : int
        Displacement of `weights[0]`, in cells.
    weights : FloatArray, shape (n,)
        Sum to 1.
    dropped : float
        Mass of the ideal distribution beyond the ends of the weights, before these were normalized.
    excess_variance : float
        Variance of the kernel above the variance asked for, in square cells.
    """

    first: int
    weights: FloatArray
    dropped: float
    excess_variance: float

    def __repr__(self) -> str:
        return short_repr(self)


def gaussian_kernel(mean: float, variance: float, *, tail: float = 1e-9) -> Kernel:
    """Create a kernel with the mean and variance of a Gaussian, so that repeated steps add up right.

    A variance of 1 or more is sampled at the cell centres: mean and variance are then right to 1e-7.
    Integrating the density over cells instead would add 1/12 to the variance at every step. Below 1 the
    kernel is a product of three-point kernels with exact mean and variance. A mean between cells with less
    variance than r (1 - r), r being its fraction, no distribution over whole cells can have: the two nearest
    cells share the mass, and `excess_variance` says what that adds (`whole_steps` avoids it).

    Parameters
    ----------
    mean, variance : float
        In cells and square cells; the variance 0 or more.
    tail : float
        Mass that may be cut off, both sides together, of the sampled kind.

    Returns
    -------
    Kernel

    Raises
    ------
    ValueError
        If mean or variance is not finite, the variance negative or more than a million cells squared, or the
        tail not in (0, 1).
    """
    if not (math.isfinite(mean) and math.isfinite(variance) and variance >= 0.0):
        raise ValueError(f"a kernel needs a finite mean and a variance of 0 or more, not {mean}, {variance}")
    if not 0.0 < tail < 1.0:
        raise ValueError(f"the tail is in (0, 1), not {tail}")
    if variance > _WIDEST**2:
        raise ValueError(
            f"a standard deviation of {math.sqrt(variance):g} cells is more than {_WIDEST:g}: is it in the "
            "cells' unit?"
        )
    nearest = round(mean)
    rest = mean - nearest
    if variance >= 1.0:
        sigma = math.sqrt(variance)
        reach = math.ceil(sigma * _sigmas_for(tail) + abs(rest))
        cells = np.arange(-reach, reach + 1)
        weights = np.exp(-0.5 * np.square((cells - rest) / sigma))
        dropped = 0.5 * (
            math.erfc((reach + 0.5 + rest) / (sigma * math.sqrt(2.0)))
            + math.erfc((reach + 0.5 - rest) / (sigma * math.sqrt(2.0)))
        )
        return Kernel(nearest - reach, weights / weights.sum(), dropped, 0.0)
    least = abs(rest) * (1.0 - abs(rest))
    if variance < least:
        low = math.floor(mean)
        fraction = mean - low
        return Kernel(low, np.array([1.0 - fraction, fraction]), 0.0, least - variance)
    # Up to 0.75 one three-point kernel holds any mean; what is above goes to a second, symmetric one.
    part = min(variance, 0.5) if variance > 0.75 else variance
    second = part + rest * rest
    weights = np.array([0.5 * (second - rest), 1.0 - second, 0.5 * (second + rest)])
    if part < variance:
        half = 0.5 * (variance - part)
        weights = np.convolve(weights, [half, 1.0 - 2.0 * half, half])
    return Kernel(nearest - len(weights) // 2, weights, 0.0, 0.0)


@lru_cache(maxsize=64)
def _sigmas_for(tail: float) -> float:
    low, high = 0.0, 40.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.erfc(middle / math.sqrt(2.0)) > tail else (low, middle)
    return high


def whole_steps(displacement: float, carry: float) -> tuple[int, float]:
    """Split a displacement into whole cells and a rest, which is carried over to the next call.

    Parameters
    ----------
    displacement, carry : float
        In cells; the carry is what the last call returned, 0 at first.

    Returns
    -------
    steps : int
        Nearest whole number of cells.
    carry : float
        Rest of the shift, in [-0.5, 0.5]: where the belief's cells have moved to relative to the grid.
    """
    total = displacement + carry
    steps = round(total)
    return steps, total - steps


def fold(full: FloatArray, first: int, size: int, edge: Edge, axis: int) -> FloatArray:
    """Fold an axis that reaches beyond the grid back to `size` cells.

    Parameters
    ----------
    full : FloatArray
        Along `axis`, entry j lies at cell j + first.
    first, size : int
        First cell, and number of cells.
    edge : {"wrap", "stay", "lose"}
        Treatment of entries off the grid.
    axis : int
        Index of the axis, counted from 0.

    Returns
    -------
    FloatArray
        With `size` entries along `axis`; may share memory with `full`.
    """
    if edge not in EDGES:
        raise ValueError(f"unknown edge {edge!r}; choose one of {', '.join(EDGES)}")
    length = full.shape[axis]
    lead = (slice(None),) * axis
    if edge == "wrap":
        result = np.zeros((*full.shape[:axis], size, *full.shape[axis + 1 :]))
        start = 0
        while start < length:
            cell = (first + start) % size
            count = min(length - start, size - cell)
            result[(*lead, slice(cell, cell + count))] += full[(*lead, slice(start, start + count))]
            start += count
        return result
    low = min(max(-first, 0), length)
    high = max(min(size - first, length), low)
    inside = full[(*lead, slice(low, high))]
    if edge == "lose" and first <= 0 and high - low == size:
        return inside
    result = np.zeros((*full.shape[:axis], size, *full.shape[axis + 1 :]))
    place = first + low
    result[(*lead, slice(place, place + high - low))] = inside
    if edge == "stay":
        result[(*lead, slice(0, 1))] += full[(*lead, slice(0, low))].sum(axis=axis, keepdims=True)
        result[(*lead, slice(size - 1, size))] += full[(*lead, slice(high, length))].sum(
            axis=axis, keepdims=True
        )
    return result


def convolve(
    belief: ArrayLike, weights: ArrayLike, first: int, *, edge: Edge = "lose", axis: int = -1
) -> FloatArray:
    """Convolve along one axis.

    Parameters
    ----------
    belief : array_like
        Any shape.
    weights : array_like, shape (n,)
        Mass at i goes to i + first + k with weights[k].
    first : int
        In cells.
    edge : {"wrap", "stay", "lose"}
        Treatment of mass that leaves the axis.
    axis : int
        Index of the axis.

    Returns
    -------
    FloatArray
        The belief's shape.
    """
    belief, weights = np.asarray(belief, dtype=float), np.asarray(weights, dtype=float)
    axis %= belief.ndim
    size = belief.shape[axis]
    if belief.ndim == 1:
        margin = len(weights) + abs(first)
        if size > max(_LONG, 2 * margin) and len(weights) <= _FEW and edge != "stay":
            return _convolve_long(belief, weights, first, edge)
        return fold(np.convolve(belief, weights), first, size, edge, 0)
    full = np.zeros((*belief.shape[:axis], size + len(weights) - 1, *belief.shape[axis + 1 :]))
    lead = (slice(None),) * axis
    product = np.empty_like(belief)
    for k, weight in enumerate(weights):
        if weight != 0.0:
            np.multiply(belief, weight, out=product)
            full[(*lead, slice(k, k + size))] += product
    return fold(full, first, size, edge, axis)


def _convolve_long(line: FloatArray, weights: FloatArray, first: int, edge: Edge) -> FloatArray:
    """Convolve a line much longer than the kernel's reach."""
    size, taps = len(line), len(weights)
    result = np.empty(size)
    # Cells all of whose sources are on the line; the others are looked up one by one.
    low, high = max(0, first + taps - 1), min(size, size + first)
    product = np.empty(_PIECE)
    for start in range(low, high, _PIECE):
        stop = min(start + _PIECE, high)
        piece, other = result[start:stop], product[: stop - start]
        np.multiply(line[start - first : stop - first], weights[0], out=piece)
        for k in range(1, taps):
            np.multiply(line[start - first - k : stop - first - k], weights[k], out=other)
            piece += other
    border = np.r_[0:low, high:size]
    source = border[:, np.newaxis] - first - np.arange(taps)
    found = line[source % size]
    if edge == "lose":
        found = np.where((source >= 0) & (source < size), found, 0.0)
    result[border] = found @ weights
    return result


def convolve_all(
    belief: ArrayLike, kernel: ArrayLike, first: Sequence[int], *, edges: Sequence[Edge]
) -> FloatArray:
    """Convolve along all axes at once with a kernel that need not be a product.

    Parameters
    ----------
    belief, kernel : array_like
        The same number of axes.
    first : sequence of int
        Displacement of the kernel's entry [0, ..., 0] along each axis.
    edges : sequence of {"wrap", "stay", "lose"}
        One for each axis. Where mass leaves over a corner, each axis is treated by itself.

    Returns
    -------
    FloatArray
        The belief's shape.
    """
    before: FloatArray = np.asarray(belief, dtype=float)
    taps: FloatArray = np.asarray(kernel, dtype=float)
    if not before.ndim == taps.ndim == len(first) == len(edges):
        raise ValueError(f"kernel {taps.shape}, offsets and edges must have {before.ndim} axes")
    full = np.zeros([b + k - 1 for b, k in zip(before.shape, taps.shape, strict=True)])
    for flat in np.flatnonzero(taps):
        index = tuple(int(i) for i in np.unravel_index(int(flat), taps.shape))
        window = tuple(slice(i, i + size) for i, size in zip(index, before.shape, strict=True))
        full[window] += taps[index] * before
    for axis, edge in enumerate(edges):
        full = fold(full, first[axis], before.shape[axis], edge, axis)
    return full
