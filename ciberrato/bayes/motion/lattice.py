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
from typing import NamedTuple

import numpy as np

from ciberrato.bayes.arraytypes import FloatArray, IntArray

# Variances up to this many square cells are made of Selling's vectors.
_SMALL = 0.5
# A thin distribution along a slanting line needs long vectors; they may add this share of the second moment
# to stay short.
_THIN = 0.04
# Sigmas at which wide distributions are cut, if not told otherwise: they lose 1e-9 of their mass.
_SIGMAS = 6.1


class LatticeKernels(NamedTuple):
    """Distributions over whole-cell displacements of a plane, entry by entry.

    Attributes
    ----------
    kernel : IntArray, shape (n,)
        Which kernel the entry is of.
    cells : IntArray, shape (n, 2)
        Displacement; no two entries of a kernel have the same.
    weights : FloatArray, shape (n,)
        0 or more. They sum to 1 for each kernel, less what a reach left out.
    """

    kernel: IntArray
    cells: IntArray
    weights: FloatArray

    def moments(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Give the mean, (count, 2), and covariance, (count, 2, 2), of the first `count` kernels."""
        mean = np.stack(
            [np.bincount(self.kernel, self.weights * self.cells[:, a], count) for a in (0, 1)], axis=1
        )
        off = self.cells - mean[self.kernel]
        pairs = [
            np.bincount(self.kernel, self.weights * off[:, a] * off[:, b], count)
            for a, b in ((0, 0), (0, 1), (0, 1), (1, 1))
        ]
        return mean, np.stack(pairs, axis=1).reshape(count, 2, 2)


def lattice_kernels(
    mean: FloatArray,
    covariance: FloatArray,
    *,
    reach: tuple[int, int],
    sigmas: float = _SIGMAS,
    cut: float | None = None,
) -> LatticeKernels:
    """Make kernels with the means and covariances given.

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

    Returns
    -------
    LatticeKernels
    """
    wide = np.maximum(covariance[:, 0, 0], covariance[:, 1, 1]) > _SMALL
    pieces = []
    for k in np.flatnonzero(~wide):
        made = _by_vectors(mean[k], covariance[k])
        if made is None:
            wide[k] = True
        else:
            pieces.append((np.full(len(made[1]), k), *made))
    chosen = np.flatnonzero(wide)
    if len(chosen):
        pieces += _by_lines(chosen, mean, covariance, reach, sigmas, cut)
    if not pieces:
        return LatticeKernels(np.empty(0, np.intp), np.empty((0, 2), np.intp), np.empty(0))
    kernel, cells, weights = (np.concatenate([p[i] for p in pieces]) for i in range(3))
    kept = (weights > 1e-17) & (np.abs(cells[:, 0]) <= reach[0]) & (np.abs(cells[:, 1]) <= reach[1])
    return LatticeKernels(kernel[kept], cells[kept], weights[kept])


def _by_vectors(mean: FloatArray, covariance: FloatArray) -> tuple[IntArray, FloatArray] | None:
    """Give cells and weights; None if three vectors cannot hold so much variance."""
    x, y = float(mean[0]), float(mean[1])
    nearest = round(x), round(y)
    a, b = x - nearest[0], y - nearest[1]
    moment = (float(covariance[0, 0]) + a * a, float(covariance[0, 1]) + a * b, float(covariance[1, 1]) + b * b)
    cells, weights = [nearest], [1.0]
    for (i, j), size, slant in zip(*_vectors(moment, (a, b)), strict=True):
        weights[0] -= size
        cells += [(nearest[0] + i, nearest[1] + j), (nearest[0] - i, nearest[1] - j)]
        weights += [max(0.0, 0.5 * (size + slant)), max(0.0, 0.5 * (size - slant))]
    if weights[0] < -1e-12:
        return None
    weights[0] = max(weights[0], 0.0)
    return np.array(cells), np.array(weights)


def _vectors(
    moment: tuple[float, float, float], mean: tuple[float, float]
) -> tuple[list[tuple[int, int]], list[float], list[float]]:
    """Give three integer vectors with lambda and g of each: of Selling's bases the one that adds least."""
    xx, xy, yy = moment
    # The vectors are the base's, turned by a quarter; the slanting one at first lies as the moment does.
    base = [(-1, -1), (1, 0), (0, 1)] if xy < 0.0 else [(1, -1), (-1, 0), (0, 1)]
    best: tuple[float, list[tuple[int, int]], list[float], list[float]] | None = None
    for _ in range(8):
        vectors = [(-q, p) for p, q in base]
        sizes = []
        for k in range(3):
            (p, q), (r, s) = base[k - 2], base[k - 1]
            sizes.append(-(xx * p * r + xy * (p * s + q * r) + yy * q * s))
        cost, raised, slants = _raised(vectors, sizes, mean)
        if best is None or cost < best[0] - 1e-12:
            best = cost, vectors, raised, slants
        least = min(sizes)
        if cost <= _THIN * (xx + yy) or least >= 0.0:
            break
        # Of the pair whose angle is most acute, turn one round.
        k = sizes.index(least)
        p, q = base[k - 2], base[k - 1]
        base = [(-p[0], -p[1]), q, (p[0] - q[0], p[1] - q[1])]
    assert best is not None
    return best[1:]


def _raised(
    vectors: list[tuple[int, int]], sizes: list[float], mean: tuple[float, float]
) -> tuple[float, list[float], list[float]]:
    """Give the variance that a base must add, its lambdas with that, and its g."""
    (a, b), (c, d) = vectors[0], vectors[1]
    whole = a * d - b * c  # 1 or -1
    start = ((mean[0] * d - mean[1] * c) / whole, (mean[1] * a - mean[0] * b) / whole, 0.0)
    # The three vectors sum to nothing, so any one number may be added to all of g.
    room = [max(s, 0.0) for s in sizes]
    low = max(-room[k] - start[k] for k in range(3))
    high = min(room[k] - start[k] for k in range(3))
    shifts = [0.5 * (low + high)]
    if low > high:
        shifts = [sign * room[k] - start[k] for k in range(3) for sign in (-1.0, 1.0)]
    lengths = [i * i + j * j for i, j in vectors]

    def cost(shift: float) -> float:
        return sum((max(s, abs(g + shift)) - s) * n for s, g, n in zip(sizes, start, lengths, strict=True))

    # The cost is convex: of several best numbers the middle is as good, and treats all directions alike.
    costs = [cost(shift) for shift in shifts]
    equal = [shift for shift, c in zip(shifts, costs, strict=True) if c <= min(costs) + 1e-12]
    shift = 0.5 * (min(equal) + max(equal))
    slants = [g + shift for g in start]
    return min(costs), [max(s, abs(g)) for s, g in zip(sizes, slants, strict=True)], slants


def _by_lines(
    some: IntArray,
    mean: FloatArray,
    covariance: FloatArray,
    reach: tuple[int, int],
    sigmas: float,
    cut: float | None,
) -> list[tuple[IntArray, IntArray, FloatArray]]:
    """Sample along the wider axis and spread across; give the kernel, cells and weight of each entry."""
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
