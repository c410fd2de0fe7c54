# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Steps of the Bayes filter over large (x, y, heading) grids, in machine code made by numba.

Each does some parts of its arrays, so that threads share the work. Beliefs are of double or single precision,
as they come; large arrays are flat. Sums are in a fixed order; a product and a sum may be one operation with
one rounding. Vectors are written out (`ciberrato.bayes.vectors`): the compiler finds few of them by itself.

Imported by `ciberrato.bayes.compiled` only.
"""

from __future__ import annotations

import numpy as np

from ciberrato.bayes.kernel_loops import kernels_of_vectors
from ciberrato.bayes.motion_loops import STRIP, drive_and_turn, turn_rows
from ciberrato.bayes.product_loops import products
from ciberrato.bayes.ray_loops import cast_rays
from ciberrato.bayes.scan_loops import RUN, scan_places, scan_states
from ciberrato.bayes.selected_loops import drive_states, heavy, turn_states
from ciberrato.bayes.step_loops import drive_and_correct
from ciberrato.bayes.vectors import LANES, greater, load, outside, store
from ciberrato.machine_code import kept

_U = np.uint64

__all__ = (
    "LANES", "RUN", "STRIP", "cast_rays", "drive_and_correct", "drive_and_turn", "drive_states", "greatest",
    "heavy", "kernels_of_vectors", "products", "scale", "scan_places", "scan_states", "turn_rows",
    "turn_states",
)  # fmt: skip


@kept
def greatest(values, begin, end):
    """Return the greatest of flat values; nan if one is."""
    best, wrong = load(np.full(LANES, -np.inf, values.dtype), _U(0)), _U(0)
    low = best
    high = load(np.full(LANES, np.inf, values.dtype), _U(0))
    full = (end - begin) // LANES * LANES
    for k in range(begin, begin + full, LANES):
        some = load(values, _U(k))
        best = greater(some, best)
        wrong |= outside(some, low, high)
    rest = np.full(LANES, -np.inf, values.dtype)
    rest[: end - begin - full] = values[begin + full : end]
    best = greater(load(rest, _U(0)), best)
    wrong |= outside(load(rest, _U(0)), low, high)
    store(rest, _U(0), best)
    return np.nan if wrong else np.float64(rest.max())


@kept
def scale(values, factor, begin, end):
    """Multiply by a factor, in place."""
    for k in range(begin, end):
        values[_U(k)] *= factor
