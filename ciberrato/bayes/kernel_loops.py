# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Distributions over whole cells of a plane, in machine code made by numba.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import numba
import numpy as np

from ciberrato.machine_code import kept

_part = numba.njit(error_model="numpy", nogil=True)


@_part
def _raised(vectors, sizes, mean_x, mean_y, slants):
    """Set the g of a basis, and raise its lambdas as far as they need it; return the variance added."""
    ax, ay, bx, by = vectors[0, 0], vectors[0, 1], vectors[1, 0], vectors[1, 1]
    whole = ax * by - ay * bx  # 1 or -1
    start = (mean_x * by - mean_y * bx) * whole, (mean_y * ax - mean_x * ay) * whole, 0.0
    low, high = -np.inf, np.inf
    for k in range(3):
        room = max(sizes[k], 0.0)
        low, high = max(low, -room - start[k]), min(high, room - start[k])
    middle, cost = 0.5 * (low + high), np.inf
    costs, shifts = np.empty(6), np.empty(6)
    for s in range(6):
        room = max(sizes[s % 3], 0.0)
        shifts[s] = (-room if s < 3 else room) - start[s % 3]
        if low <= high:
            shifts[s] = middle
        costs[s] = 0.0
        for k in range(3):
            length = vectors[k, 0] * vectors[k, 0] + vectors[k, 1] * vectors[k, 1]
            costs[s] += (max(sizes[k], abs(start[k] + shifts[s])) - sizes[k]) * length
        cost = min(cost, costs[s])
    # Of several best numbers the middle.
    first, last = np.inf, -np.inf
    for s in range(6):
        if costs[s] <= cost + 1e-12:
            first, last = min(first, shifts[s]), max(last, shifts[s])
    shift = 0.5 * (first + last)
    for k in range(3):
        slants[k] = start[k] + shift
        sizes[k] = max(sizes[k], abs(slants[k]))
    return cost


@kept
def kernels_of_vectors(mean, covariance, thin, most):
    """Compute small kernels of three vectors: what `ciberrato.bayes.motion.lattice` says of them.

    Parameters
    ----------
    mean, covariance : shapes (n, 2), (n, 2, 2)
        In cells.
    thin : float
        Share of the second moment that vectors may add to stay short.
    most : int
        Number of bases to try.

    Returns
    -------
    (held, cells, weights)
        Which kernels three vectors can hold, shape (n,); displacements, (n, 7, 2); probabilities, (n, 7).
    """
    count = mean.shape[0]
    held, cells, weights = np.empty(count, np.bool_), np.empty((count, 7, 2), np.int64), np.empty((count, 7))
    base, vectors, chosen = np.empty((3, 2)), np.empty((3, 2)), np.zeros((3, 2))
    sizes, raised, slants = np.empty(3), np.empty(3), np.empty(3)
    best_sizes, best_slants = np.zeros(3), np.zeros(3)
    for n in range(count):
        near_x, near_y = np.rint(mean[n, 0]), np.rint(mean[n, 1])
        x, y = mean[n, 0] - near_x, mean[n, 1] - near_y
        xx, xy, yy = covariance[n, 0, 0] + x * x, covariance[n, 0, 1] + x * y, covariance[n, 1, 1] + y * y
        side = -1.0 if xy < 0.0 else 1.0
        base[0, 0], base[0, 1], base[1, 0], base[1, 1], base[2, 0], base[2, 1] = (
            side, -1.0, -side, 0.0, 0.0, 1.0,
        )  # fmt: skip
        best = np.inf
        for _ in range(most):
            for k in range(3):
                vectors[k, 0], vectors[k, 1] = -base[k, 1], base[k, 0]
                p, q = (k + 1) % 3, (k + 2) % 3
                sizes[k] = -(
                    base[p, 0] * xx * base[q, 0] + base[p, 0] * xy * base[q, 1]
                    + (base[p, 1] * xy * base[q, 0] + base[p, 1] * yy * base[q, 1])
                )  # fmt: skip
            raised[:] = sizes
            cost = _raised(vectors, raised, x, y, slants)
            if cost < best - 1e-12:
                best = cost
                chosen[:], best_sizes[:], best_slants[:] = vectors, raised, slants
            k = int(np.argmin(sizes))
            if not (cost > thin * (xx + yy) and sizes[k] < 0.0):
                break
            # Of the pair whose angle is most acute, turn one round.
            p, q = (k + 1) % 3, (k + 2) % 3
            px, py, qx, qy = base[p, 0], base[p, 1], base[q, 0], base[q, 1]
            base[0, 0], base[0, 1], base[1, 0], base[1, 1] = -px, -py, qx, qy
            base[2, 0], base[2, 1] = px - qx, py - qy
        still = 1.0 - (best_sizes[0] + best_sizes[1] + best_sizes[2])
        held[n] = still >= -1e-12
        weights[n, 0] = max(still, 0.0)
        cells[n, 0, 0], cells[n, 0, 1] = int(near_x), int(near_y)
        for k in range(3):
            weights[n, 1 + k] = max(0.5 * (best_sizes[k] + best_slants[k]), 0.0)
            weights[n, 4 + k] = max(0.5 * (best_sizes[k] - best_slants[k]), 0.0)
            for axis, near in enumerate((near_x, near_y)):
                cells[n, 1 + k, axis] = int(near + chosen[k, axis])
                cells[n, 4 + k, axis] = int(near - chosen[k, axis])
    return held, cells, weights
