# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Products of beliefs and likelihoods, in machine code made by numba.

Imported by `ciberrato.bayes.loops` and its siblings only.
"""

from __future__ import annotations

import numba
import numpy as np

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
def product(belief, at, scores, seen, best, far, least, floor, most, out, onto):
    """Store a vector of products; return it in double precision, and which are small or wrong."""
    held = load(belief, at)
    score = subtract(double(load(scores, seen)), splat(best))
    factor = _exp(greater(score, splat(far)))
    result = where_at_least(multiply(factor, double(held)), score, splat(far))
    # -inf is impossible, and not small.
    low = outside(result, splat(least), splat(np.inf)) & positive(held)
    low &= ~outside(score, splat(np.finfo(np.float64).min), splat(np.inf))
    result = where_at_least(result, result, splat(floor))
    store(out, onto, as_in(result, out))
    return result, low, outside(double(held), splat(0.0), splat(most))


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
        one, low, odd = product(belief, _U(k), scores, _U(k), best, far, least, floor, most, out, _U(k))
        whole = add(whole, one)
        small += count(low)
        wrong |= odd
    if begin + full < end:
        # The rest, filled up.
        held, score = np.zeros(LANES, belief.dtype), np.full(LANES, -np.inf, scores.dtype)
        made = np.empty(LANES, out.dtype)
        held[: end - begin - full] = belief[begin + full : end]
        score[: end - begin - full] = scores[begin + full : end]
        one, low, odd = product(held, _U(0), score, _U(0), best, far, least, floor, most, made, _U(0))
        out[begin + full : end] = made[: end - begin - full]
        whole = add(whole, one)
        small += count(low)
        wrong |= odd
    return total(whole), small, wrong
