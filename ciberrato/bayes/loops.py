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

import numba
import numpy as np

from ciberrato.bayes.motion_loops import STRIP, drive_and_turn, turn_rows
from ciberrato.bayes.ray_loops import cast_rays
from ciberrato.bayes.scan_loops import RUN, scan_places, scan_states
from ciberrato.bayes.vectors import (
    LANES,
    add,
    as_in,
    count,
    double,
    greater,
    load,
    multiply,
    multiply_add,
    outside,
    positive,
    splat,
    store,
    subtract,
    times_power_of_two,
    total,
    where_at_least,
)
from ciberrato.machine_code import kept

_part = numba.njit(error_model="numpy", nogil=True)
_U = np.uint64

__all__ = (
    "LANES", "RUN", "STRIP", "cast_rays", "drive_and_turn", "greatest", "products", "scale", "scan_places",
    "scan_states", "turn_rows",
)  # fmt: skip

# exp(x) for x from -700 to 0: 2^n exp(r), |r| <= log(2) / 2, by its series to the 13th power.
_PER_LOG2, _SHIFT = 1.4426950408889634, 6755399441055744.0
_LOG2_HIGH, _LOG2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10


@_part
def _exp(x):
    """Return exp(x) of doubles from -700 to 0, to three units in the last place."""
    shifted = multiply_add(x, splat(_PER_LOG2), splat(_SHIFT))
    n = subtract(shifted, splat(_SHIFT))
    r = multiply_add(n, splat(-_LOG2_HIGH), x)
    r = multiply_add(n, splat(-_LOG2_LOW), r)
    p = multiply_add(splat(1.6059043836821613e-10), r, splat(2.08767569878681e-09))
    p = multiply_add(p, r, splat(2.505210838544172e-08))
    p = multiply_add(p, r, splat(2.755731922398589e-07))
    p = multiply_add(p, r, splat(2.7557319223985893e-06))
    p = multiply_add(p, r, splat(2.48015873015873e-05))
    p = multiply_add(p, r, splat(0.0001984126984126984))
    p = multiply_add(p, r, splat(0.001388888888888889))
    p = multiply_add(p, r, splat(0.008333333333333333))
    p = multiply_add(p, r, splat(0.041666666666666664))
    p = multiply_add(p, r, splat(0.16666666666666666))
    p = multiply_add(p, r, splat(0.5))
    p = multiply_add(p, r, splat(1.0))
    p = multiply_add(p, r, splat(1.0))
    return times_power_of_two(p, shifted)


@_part
def _product(belief, scores, best, far, least, floor, most, out, at, onto):
    """Store a vector of products; return it in double precision, and which are small or wrong."""
    held = load(belief, at)
    score = subtract(double(load(scores, at)), splat(best))
    factor = _exp(greater(score, splat(far)))
    product = where_at_least(multiply(factor, double(held)), score, splat(far))
    # -inf is impossible, and not small.
    low = outside(product, splat(least), splat(np.inf)) & positive(held)
    low &= ~outside(score, splat(np.finfo(np.float64).min), splat(np.inf))
    product = where_at_least(product, product, splat(floor))
    store(out, onto, as_in(product, out))
    return product, low, outside(double(held), splat(0.0), splat(most))


@kept
def products(belief, scores, best, far, least, floor, most, out, begin, end):
    """Multiply beliefs by exp(scores - best), all flat.

    Parameters
    ----------
    belief, scores, out : shape (n,)
        Of any precision.
    best, far : float
        The highest score; states whose score is this many nats (negative) from it get zero.
    least, floor, most : float
        Products of possible states below the least, and beliefs above the most, are counted; products below
        the floor become zero.

    Returns
    -------
    (float, int, int)
        Sum of the products; number of those that are below `least` though the state is possible; 0 unless a
        belief is nan, negative or above `most`.
    """
    whole, small, wrong = splat(0.0), _U(0), _U(0)
    full = (end - begin) // LANES * LANES
    for k in range(begin, begin + full, LANES):
        product, low, odd = _product(belief, scores, best, far, least, floor, most, out, _U(k), _U(k))
        whole = add(whole, product)
        small += count(low)
        wrong |= odd
    if begin + full < end:
        # The rest, filled up.
        held, score = np.zeros(LANES, belief.dtype), np.full(LANES, -np.inf, scores.dtype)
        made = np.empty(LANES, out.dtype)
        held[: end - begin - full] = belief[begin + full : end]
        score[: end - begin - full] = scores[begin + full : end]
        product, low, odd = _product(held, score, best, far, least, floor, most, made, _U(0), _U(0))
        out[begin + full : end] = made[: end - begin - full]
        whole = add(whole, product)
        small += count(low)
        wrong |= odd
    return total(whole), small, wrong


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
