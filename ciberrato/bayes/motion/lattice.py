r"""Distributions over whole cells of a plane with the mean and covariance asked for.

A step of :math:`\pm v_i`, whole cells, with the probabilities :math:`(\lambda_i \pm g_i) / 2` has the mean
:math:`\sum g_i v_i` and the second moment :math:`\sum \lambda_i v_i v_i^T`. Selling's reduction writes every
positive definite second moment of the plane as such a sum over three vectors with :math:`\lambda \ge 0`, and
the mean fixes the g but for one number. So mean and covariance are exact wherever :math:`|g_i| \le
\lambda_i`. Less variance along an axis than r (1 - r), r being the fraction of a cell in the mean, no
distribution over whole cells can have; there the probabilities are raised as little as keeps them from being
negative.

Wider distributions are sampled along the axis in which they are wider, and at each of its cells across, about
the line of regression. That is exact but for r (1 - r) across, where the spread across is less than it: at
most 1/4, on the average 1/6 square cell.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.reprs import short_repr

# Variances up to this many square cells are made of Selling's vectors.
_SMALL = 0.5
# A thin distribution along a slanting line needs long vectors; they may add this share of the second moment
# to stay short.
_THIN = 0.04
_MOST_BASES = 8
# Of three vectors in a ring, the next to each and the last.
_AFTER, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
# Sigmas at which wide distributions are cut, by default: they lose 1e-9 of their mass.
_SIGMAS = 6.1


class LatticeKernels(NamedTuple):
    """Distributions over whole-cell displacements of a plane, entry by entry.

    Attributes
    ----------
    kernel : IntArray, shape (n,)
        Index of the entry's kernel.
    cells : IntArray, shape (n, 2)
        Displacement; no two entries of a kernel have the same.
    weights : FloatArray, shape (n,)
        0 or more. They sum to 1 for each kernel, less what a reach left out.
    """

    kernel: IntArray
    cells: IntArray
    weights: FloatArray

    def moments(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return the mean, (count, 2), and covariance, (count, 2, 2), of the first `count` kernels."""
        mean = np.stack(
            [np.bincount(self.kernel, self.weights * self.cells[:, a], count) for a in (0, 1)], axis=1
        )
        off = self.cells - mean[self.kernel]
        pairs = [
            np.bincount(self.kernel, self.weights * off[:, a] * off[:, b], count)
            for a, b in ((0, 0), (0, 1), (0, 1), (1, 1))
        ]
        return np.asarray(mean), np.asarray(np.stack(pairs, axis=1).reshape(count, 2, 2))

    def __repr__(self) -> str:
        return short_repr(self)


def lattice_kernels(
    mean: FloatArray,
    covariance: FloatArray,
    *,
    reach: tuple[int, int],
    sigmas: float = _SIGMAS,
    cut: float | None = None,
    loops: Any = None,
) -> LatticeKernels:
    """Create kernels with the given means and covariances.

    Parameters
    ----------
    mean : FloatArray, shape (n, 2)
        In cells.
    covariance : FloatArray, shape (n, 2, 2)
        In square cells; positive semidefinite.
    reach : (int, int)
        Leave out displacements of more cells than this, either way.
    sigmas : float
        Cut wide distributions off beyond this many sigmas, and normalize the rest.
    cut : float, optional
        Leave out, after that, what is beyond this many sigmas along the wider axis.
    loops : module, optional
        Compiled loops of `ciberrato.bayes.loops`, for small kernels: weights differ by 1e-15 at most.

    Returns
    -------
    LatticeKernels
    """
    wide = np.maximum(covariance[:, 0, 0], covariance[:, 1, 1]) > _SMALL
    pieces = []
    small = np.flatnonzero(~wide)
    if len(small):
        held, piece = _by_vectors(small, mean[small], covariance[small], loops)
        wide[small[~held]] = True
        pieces.append(piece)
    chosen = np.flatnonzero(wide)
    if len(chosen):
        pieces += _by_lines(chosen, mean, covariance, reach, sigmas, cut)
    if not pieces:
        return LatticeKernels(np.empty(0, np.intp), np.empty((0, 2), np.intp), np.empty(0))
    kernel, cells, weights = (np.concatenate([p[i] for p in pieces]) for i in range(3))
    kept = (weights > 1e-17) & (np.abs(cells[:, 0]) <= reach[0]) & (np.abs(cells[:, 1]) <= reach[1])
    return LatticeKernels(kernel[kept], cells[kept], weights[kept])


def _by_vectors(
    some: IntArray, mean: FloatArray, covariance: FloatArray, loops: Any
) -> tuple[BoolArray, tuple[IntArray, IntArray, FloatArray]]:
    """Return the kernels that three vectors can hold, with the kernel, cells and weight of each entry."""
    if loops is not None:
        held, cells, weights = loops.kernels_of_vectors(mean, covariance, _THIN, _MOST_BASES)
        return held, (np.repeat(some[held], 7), cells[held].reshape(-1, 2), weights[held].ravel())
    nearest = np.rint(mean)
    rest = mean - nearest
    vectors, sizes, slants = _vectors(covariance + rest[:, :, np.newaxis] * rest[:, np.newaxis, :], rest)
    still = 1.0 - sizes.sum(axis=1, keepdims=True)
    held = still[:, 0] >= -1e-12
    weights = np.concatenate([still, 0.5 * (sizes + slants), 0.5 * (sizes - slants)], axis=1)
    steps = np.concatenate([np.zeros((len(some), 1, 2)), vectors, -vectors], axis=1)
    cells = (nearest[:, np.newaxis] + steps)[held].astype(np.intp)
    kernel = np.repeat(some[held], 7)
    return held, (kernel, cells.reshape(-1, 2), np.maximum(weights[held], 0.0).ravel())


def _vectors(moment: FloatArray, mean: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return three whole vectors, (n, 3, 2), with lambda and g of each, (n, 3): of Selling's bases the best.

    Base and vectors are each other's turned by a quarter; the slanting one at first lies as the moment does.
    """
    count = len(mean)
    side = np.where(moment[:, 0, 1] < 0.0, -1.0, 1.0)
    base = np.zeros((count, 3, 2))
    base[:, 0, 0], base[:, 0, 1], base[:, 1, 0], base[:, 2, 1] = side, -1.0, -side, 1.0
    enough = _THIN * (moment[:, 0, 0] + moment[:, 1, 1])
    best = np.full(count, np.inf)
    chosen = np.zeros((count, 3, 2)), np.zeros((count, 3)), np.zeros((count, 3))
    active = np.arange(count)
    for _ in range(_MOST_BASES):
        vectors = np.empty_like(base)
        np.negative(base[..., 1], out=vectors[..., 0])
        vectors[..., 1] = base[..., 0]
        after, last = base[:, _AFTER], base[:, _LAST]
        sizes = -np.einsum("nka,nab,nkb->nk", after, moment[active], last)
        cost, raised, slants = _raised(vectors, sizes, mean[active])
        better = cost < best[active] - 1e-12
        best[active[better]] = cost[better]
        for field, values in zip(chosen, (vectors, raised, slants), strict=True):
            field[active[better]] = values[better]
        goes_on = (cost > enough[active]) & (sizes.min(axis=1) < 0.0)
        if not goes_on.any():
            break
        # Of the pair whose angle is most acute, turn one round.
        rows, k = np.flatnonzero(goes_on), sizes[goes_on].argmin(axis=1)
        p, q = after[rows, k], last[rows, k]
        base, active = np.stack([-p, q, p - q], axis=1), active[goes_on]
    return chosen


def _raised(
    vectors: FloatArray, sizes: FloatArray, mean: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the variance that bases must add, (n,), their lambdas with that, and their g, (n, 3)."""
    first, second = vectors[:, 0], vectors[:, 1]
    whole = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]  # 1 or -1
    start = np.zeros(sizes.shape)
    start[:, 0] = (mean[:, 0] * second[:, 1] - mean[:, 1] * second[:, 0]) * whole
    start[:, 1] = (mean[:, 1] * first[:, 0] - mean[:, 0] * first[:, 1]) * whole
    # The three vectors sum to nothing, so any one number may be added to all of g.
    room = np.maximum(sizes, 0.0)
    low, high = (-room - start).max(axis=1), (room - start).min(axis=1)
    lengths = np.square(vectors).sum(axis=2)
    shifts = np.concatenate([-room - start, room - start], axis=1)
    shifts[low <= high] = (0.5 * (low + high))[low <= high, np.newaxis]
    reached = np.abs(start[:, np.newaxis] + shifts[:, :, np.newaxis])
    excess = np.maximum(sizes[:, np.newaxis], reached) - sizes[:, np.newaxis]
    costs = np.einsum("nsk,nk->ns", excess, lengths)
    cost = costs.min(axis=1)
    # The cost is convex: of several best numbers the middle is as good, and treats all directions alike.
    equal = costs <= cost[:, np.newaxis] + 1e-12
    shift = 0.5 * (np.where(equal, shifts, np.inf).min(axis=1) + np.where(equal, shifts, -np.inf).max(axis=1))
    slants = start + shift[:, np.newaxis]
    return cost, np.maximum(sizes, np.abs(slants)), slants


def _by_lines(
    some: IntArray,
    mean: FloatArray,
    covariance: FloatArray,
    reach: tuple[int, int],
    sigmas: float,
    cut: float | None,
) -> list[tuple[IntArray, IntArray, FloatArray]]:
    """Sample along the wider axis and spread across; return the kernel, cells and weight of each entry."""
    mean, covariance, longest = mean[some], covariance[some], max(reach)
    swapped = covariance[:, 1, 1] > covariance[:, 0, 0]
    mean[swapped] = mean[swapped, ::-1]
    covariance[swapped] = covariance[swapped, ::-1, ::-1]
    centre, variance = mean[:, :1], covariance[:, 0, :1]
    slope = covariance[:, 0, 1:] / variance
    rest = np.maximum(covariance[:, 1, 1] - (slope**2 * variance)[:, 0], 0.0)
    far = math.ceil(sigmas * math.sqrt(float(variance.max())) + 0.5)
    whole = far <= 2 * longest + 1
    if whole:
        place = np.rint(centre) + np.arange(-far, far + 1)
    else:  # much wider than the grid
        place = np.broadcast_to(np.arange(-longest, longest + 1.0), (len(some), 2 * longest + 1))
    off = place - centre
    along = np.exp(off * off * (-0.5 / variance))
    if whole:
        along[np.abs(off) > sigmas * np.sqrt(variance) + 0.5] = 0.0
        along /= along.sum(axis=1, keepdims=True)
        # Sampling a variance of half a square cell is off by 3e-4 cells; a slight tilt puts the mean right.
        along *= 1.0 - np.einsum("ki,ki->k", along, off)[:, np.newaxis] * off / variance
        np.maximum(along, 0.0, out=along)
        along /= along.sum(axis=1, keepdims=True)
    else:
        along /= np.sqrt(2.0 * math.pi * variance)
    if cut is not None:
        along[np.abs(off) > cut * np.sqrt(variance)] = 0.0
    middle = mean[:, 1:] + slope * off
    nearest = np.rint(middle)
    fraction = middle - nearest
    pieces = []
    for broad in (False, True):
        rows = np.flatnonzero((rest > 0.75) == broad)
        if not len(rows):
            continue
        here, spread = fraction[rows], rest[rows, np.newaxis]
        if broad:
            far = math.ceil(sigmas * math.sqrt(float(spread.max())) + 0.5)
            side = min(far, 2 * longest + 1)
            steps = np.arange(-side, side + 1)
            across = np.exp(np.square(steps - here[..., np.newaxis]) * (-0.5 / spread[..., np.newaxis]))
            if side == far:
                across /= across.sum(axis=2, keepdims=True)
            else:
                across /= np.sqrt(2.0 * math.pi * spread)[..., np.newaxis]
        else:
            steps = np.arange(-1, 2)
            second = np.maximum(spread, np.abs(here) * (1.0 - np.abs(here))) + here * here
            across = np.stack([0.5 * (second - here), 1.0 - second, 0.5 * (second + here)], axis=2)
        across *= along[rows][..., np.newaxis]
        cells = np.empty((*across.shape, 2), dtype=np.intp)
        cells[..., 0] = place[rows][..., np.newaxis]
        cells[..., 1] = nearest[rows][..., np.newaxis] + steps
        turned = swapped[rows]
        cells[turned] = cells[turned, ..., ::-1]
        kernel = np.broadcast_to(some[rows][:, np.newaxis, np.newaxis], across.shape)
        pieces.append((kernel.ravel(), cells.reshape(-1, 2), across.ravel()))
    return pieces
