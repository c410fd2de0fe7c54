"""Moving the headings' images of an (x, y, heading) belief: what the models over poses have in common.

A belief is held heading first, (headings, x, y): an image for each heading. Turning moves and mixes images,
driving moves each by its own distribution over whole cells (`ciberrato.bayes.motion.lattice`).

Motion of less than a cell can be carried from step to step: the cells of each heading then stand for their
centres plus an offset, and all headings for theirs plus a turn (`PoseCarry`). Images that mix have the offset
of their mean, and each is moved by what its own differs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.convolution import fold, gaussian_kernel
from ciberrato.bayes.motion.lattice import LatticeKernels, lattice_kernels
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr

# Up to this many pairs of cells, all images are moved by one product with matrices written out.
_DENSE = 600_000
# Kernels of at least this many cells are worth a look at which part of an image holds anything.
_MANY = 24
# Kernels of more cells than this are applied by Fourier transform, where nothing has to stay.
_WIDE = 400
_MOST_DIRECTIONS = 16
_MOST_TURNS = 10.0
_MOST_DIAGONALS = 1000.0


@dataclass(frozen=True, slots=True)
class PoseCarry:
    """Motion that a belief's array does not hold.

    Attributes
    ----------
    turn : float
        Radians to add to the heading of every cell, within half a cell.
    offset : FloatArray, shape (headings, 2)
        Units of length to add to x and y of the cells of each heading, within half a cell.
    """

    __repr__ = short_repr

    turn: float
    offset: FloatArray

    @classmethod
    def none(cls, space: StateSpace) -> PoseCarry:
        """Return the carry of a belief whose cells are at their own centres."""
        return cls(0.0, np.zeros((space.shape[2], 2)))


def check_space(space: StateSpace, what: str) -> None:
    """Raise ValueError unless the axes are x, y and a heading over a whole turn."""
    if len(space.axes) != 3 or not math.isclose(space.axes[2].length, 2.0 * math.pi):
        raise ValueError(f"{what} needs axes x, y, heading, the last over a whole turn")


def check_motion(
    space: StateSpace, ways: Sequence[float], turns: Sequence[float], sigmas: Sequence[float]
) -> None:
    """Raise ValueError where a motion cannot be meant.

    Parameters
    ----------
    space : StateSpace
        x, y, heading.
    ways : sequence of float
        Lengths driven; no more than the diagonal of the grid.
    turns : sequence of float
        Radians; no more than ten turns.
    sigmas : sequence of float
        Standard deviations of lengths; no more than a thousand diagonals.
    """
    diagonal = math.hypot(space.axes[0].length, space.axes[1].length)
    unit = space.axes[0].unit
    for value in (*ways, *turns, *sigmas):
        if not math.isfinite(value):
            raise ValueError(f"a motion must be finite, not {value}")
    for way in ways:
        if abs(way) > diagonal:
            raise ValueError(
                f"a drive of {way:g} is longer than the grid's diagonal of {diagonal:g}"
                f"{' ' if unit else ''}{unit}: is it in the grid's unit?"
            )
    for turn in turns:
        if abs(turn) > _MOST_TURNS * 2.0 * math.pi:
            raise ValueError(f"a turn of {turn:g} rad is more than ten turns: is it in radians?")
    for sigma in sigmas:
        if sigma > _MOST_DIAGONALS * diagonal:
            raise ValueError(
                f"a standard deviation of {sigma:g} is more than a thousand times the grid's diagonal of "
                f"{diagonal:g}: is it in the grid's unit?"
            )


def turn_matrix(size: int, turn: float, sigma: float, *, before: int = 1, after: int = 1) -> FloatArray:
    """Return p(heading after | heading before), with exact mean, and exact spread if cells can have it.

    Parameters
    ----------
    size : int
        Number of heading cells.
    turn, sigma : float
        In heading cells.
    before, after : int
        Parts that each cell has before and after.

    Returns
    -------
    FloatArray, shape (size * before, size * after)
    """
    count = size * after
    if sigma > 2 * size:
        return np.full((size * before, count), 1.0 / count)  # to 1e-34
    result = np.empty((size, before, count))
    for part in range(before):
        kernel = gaussian_kernel((turn + part / before) * after, (sigma * after) ** 2)
        cells = (kernel.first + np.arange(len(kernel.weights))) % count
        row = np.tile(np.bincount(cells, np.maximum(kernel.weights, 0.0), count), 2)
        # Each heading's row is the one before, turned by a cell: a view of the row twice over, read backward.
        result[:, part] = np.lib.stride_tricks.as_strided(
            row[count:], (size, count), (-after * row.itemsize, row.itemsize)
        )
    return result.reshape(-1, count)


def turn_band(size: int, turn: float, sigma: float) -> tuple[int, FloatArray]:
    """Return what is not zero of a row of `turn_matrix`: its first cell, and the probabilities from there."""
    if sigma <= 2 * size:
        kernel = gaussian_kernel(turn, sigma**2)
        if len(kernel.weights) <= size:
            return kernel.first, np.maximum(kernel.weights, 0.0)
    return 0, np.ascontiguousarray(turn_matrix(size, turn, sigma)[0])


def spread(sigma: float) -> tuple[IntArray, FloatArray]:
    """Return whole steps of mean 0 and a standard deviation in steps, and their probabilities."""
    kernel = gaussian_kernel(0.0, sigma * sigma)
    held = kernel.weights > 0.0
    return (kernel.first + np.arange(len(kernel.weights)))[held], kernel.weights[held]


def directions_per_heading(space: StateSpace, way: float, final_sigma: float) -> int:
    """Return the number of directions that a heading cell needs, so that paths do not fan out in rays.

    One, unless heading cells are far apart at the end of the way. Several need a final turn whose noise
    covers the difference, which is half a heading cell of it.
    """
    axis = space.axes[2]
    apart = abs(way) * axis.cell / min(space.axes[0].cell, space.axes[1].cell)
    if apart <= 1.0 or final_sigma < 0.5 * axis.cell:
        return 1
    return min(_MOST_DIRECTIONS, math.ceil(apart))


def ways(
    space: StateSpace, direction: FloatArray, way: ArrayLike, sigma: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return mean, (n, 2), and covariance, (n, 2, 2), in cells, of paths driven along directions."""
    along = np.stack([np.cos(direction) / space.axes[0].cell, np.sin(direction) / space.axes[1].cell], axis=1)
    length, deviation = (np.asarray(v, dtype=float).reshape(-1, 1) for v in (way, sigma))
    spread_along = along * deviation
    return along * length, spread_along[:, :, np.newaxis] * spread_along[:, np.newaxis, :]


def reach(space: StateSpace) -> tuple[int, int]:
    """Return the greatest displacement on the grid, in cells."""
    return space.shape[0] - 1, space.shape[1] - 1


def drive(images: FloatArray, kernels: LatticeKernels, out: FloatArray | None = None) -> FloatArray:
    """Move each image, (n, x, y), by the kernel of its number; what leaves the grid is lost."""
    count, rows, columns = images.shape
    if count * (rows * columns) ** 2 > _DENSE:
        every = np.arange(count)
        return move(images, kernels, every, every, np.ones(count), count, out)
    # kernel[k, t - s] for all pairs of cells s, t: a view of the displacements, read backward and forward.
    table = np.zeros((count, 2 * rows - 1, 2 * columns - 1))
    table[kernels.kernel, kernels.cells[:, 0] + rows - 1, kernels.cells[:, 1] + columns - 1] = kernels.weights
    a, b, c = table.strides
    pairs = np.lib.stride_tricks.as_strided(
        table[:, rows - 1 :, columns - 1 :], (count, rows, columns, rows, columns), (a, -b, -c, b, c)
    )
    held = np.nonzero(images.any(axis=0))
    if 2 * len(held[0]) < rows * columns:
        taken, some = images[:, held[0], held[1]], pairs[:, held[0], held[1]]
    else:
        taken, some = images, pairs
    taken, some = taken.reshape(count, 1, -1), some.reshape(count, -1, rows * columns)
    return np.asarray(np.matmul(taken, some).reshape(images.shape), dtype=images.dtype)


def move(
    images: FloatArray,
    kernels: LatticeKernels,
    source: IntArray,
    target: IntArray,
    weight: FloatArray,
    count: int,
    out: FloatArray | None = None,
    inside: BoolArray | None = None,
) -> FloatArray:
    """Add up images that are moved by kernels, each from a source to a target.

    Parameters
    ----------
    images : FloatArray, shape (m, x, y)
        Mass that leaves the grid is lost.
    kernels : LatticeKernels
        Kernels of n moves.
    source, target : IntArray, shape (n,)
        Numbers of images before and after.
    weight : FloatArray, shape (n,)
        Share of the source.
    count : int
        Number of images after.
    out : FloatArray, optional
        Array for the result.
    inside : BoolArray, shape (x, y), optional
        If given, nothing is lost: what would leave these cells or the grid stays in its cell.

    Returns
    -------
    FloatArray, shape (count, x, y)
    """
    rows, columns = images.shape[1:]
    result = np.empty((count, rows, columns), dtype=images.dtype) if out is None else out
    result[...] = 0.0
    scratch = np.empty((rows, columns), dtype=images.dtype)
    order = np.argsort(kernels.kernel, kind="stable")
    ends = np.searchsorted(kernels.kernel[order], np.arange(len(source) + 1))
    for k, (s, t) in enumerate(zip(source.tolist(), target.tolist(), strict=True)):
        entries = order[ends[k] : ends[k + 1]]
        image, onto = images[s], result[t]
        low, high = (0, 0), (rows, columns)
        if len(entries) >= _MANY:
            held = [np.flatnonzero(image.any(axis=1 - a)) for a in (0, 1)]
            if not len(held[0]):
                continue
            low = int(held[0][0]), int(held[1][0])
            high = int(held[0][-1]) + 1, int(held[1][-1]) + 1
        if len(entries) > _WIDE and inside is None:
            box = image[low[0] : high[0], low[1] : high[1]]
            onto += weight[k] * _by_fourier(
                box, low, kernels.cells[entries], kernels.weights[entries], onto.shape
            )
            continue
        for (i, j), share in zip(
            kernels.cells[entries].tolist(), (weight[k] * kernels.weights[entries]).tolist(), strict=True
        ):
            top, bottom = max(low[0], -i), min(high[0], rows - i)
            left, right = max(low[1], -j), min(high[1], columns - j)
            if top < bottom and left < right:
                product = scratch[: bottom - top, : right - left]
                np.multiply(image[top:bottom, left:right], share, out=product)
                if inside is not None:
                    product *= inside[top + i : bottom + i, left + j : right + j]
                    onto[top:bottom, left:right] -= product
                onto[top + i : bottom + i, left + j : right + j] += product
        if inside is not None:
            # Kernels sum to 1: what has not gone anywhere is what there was, less what has.
            onto += weight[k] * image
    return np.maximum(result, 0.0, out=result) if inside is not None else result


def _by_fourier(
    box: FloatArray, low: tuple[int, int], cells: IntArray, weights: FloatArray, shape: tuple[int, ...]
) -> FloatArray:
    """Convolve part of an image, which begins at `low`, with a wide kernel; less than 1e-15 of it is 0."""
    first = cells.min(axis=0)
    kernel = np.zeros(cells.max(axis=0) - first + 1)
    kernel[cells[:, 0] - first[0], cells[:, 1] - first[1]] = weights
    size = tuple(a + b - 1 for a, b in zip(box.shape, kernel.shape, strict=True))
    full = np.fft.irfft2(np.fft.rfft2(box, size) * np.fft.rfft2(kernel, size), size)
    full[full < 1e-15 * box.sum()] = 0.0
    result = full
    for axis in (0, 1):
        result = fold(result, int(first[axis]) + low[axis], shape[axis], "lose", axis)
    return result


def move_carried(
    images: FloatArray,
    carry: FloatArray,
    source: IntArray,
    target: IntArray,
    weight: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    inside: BoolArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Move images whose cells are off their centres; return them and their new offsets.

    Parameters
    ----------
    images : FloatArray, shape (headings, x, y)
        Any sum.
    carry : FloatArray, shape (headings, 2)
        In cells.
    source, target, weight : array, shape (n,)
        As of `move`.
    mean : FloatArray, shape (n, 2)
        In cells.
    covariance : FloatArray, shape (n, 2, 2)
        In square cells.
    inside : BoolArray, shape (x, y), optional
        As of `move`.
    """
    count = len(images)
    arrival = carry[source] + mean
    mass = images.sum(axis=(1, 2))
    # Headings that hold nothing have the offset that they would have with the same mass as all others.
    share = weight * np.maximum(mass[source], 1e-12 * mass.sum() + 1e-300)
    total = np.bincount(target, share, count)
    # Whole cells are the kernels' affair: count each arrival from the greatest one of its target.
    greatest = np.empty((count, 2))
    order = np.argsort(share, kind="stable")
    greatest[target[order]] = arrival[order]
    near = arrival - np.rint(arrival - greatest[target])
    middle: FloatArray = np.stack([np.bincount(target, share * near[:, a], count) for a in (0, 1)], axis=1)
    middle = np.asarray(middle / np.maximum(total, 1e-300)[:, np.newaxis])
    off: FloatArray = middle - np.rint(middle)
    reach = images.shape[1] - 1, images.shape[2] - 1
    kernels = lattice_kernels(arrival - off[target], covariance, reach=reach)
    return move(images, kernels, source, target, weight, count, inside=inside), off


def turn_carried(
    space: StateSpace, images: FloatArray, offset: FloatArray, turned: float, turn: float, sigma: float
) -> tuple[FloatArray, FloatArray, float]:
    """Turn images, (headings, x, y), whose cells are off by offset / cells and turned / radians."""
    axis = space.axes[2]
    total = turned + turn
    steps = round(total / axis.cell)
    if sigma > 2.0 * axis.length:
        step, weight = np.arange(axis.size), np.full(axis.size, 1.0 / axis.size)
    else:
        step, weight = spread(sigma / axis.cell)
    source = np.repeat(np.arange(axis.size), len(step))
    target = (source + np.tile(step, axis.size) + steps) % axis.size
    still = np.zeros((len(source), 2))
    images, offset = move_carried(
        images, offset, source, target, np.tile(weight, axis.size), still, np.zeros((len(source), 2, 2))
    )
    return images, offset, total - steps * axis.cell
