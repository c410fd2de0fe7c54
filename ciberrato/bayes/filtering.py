"""The discrete Bayes filter's two steps: predict and update.

Thrun, Burgard, Fox, Probabilistic Robotics (2005): table 2.1 (Bayes filter), 4.1 (discrete Bayes filter),
8.1 (grid localization). `ciberrato.bayes.markovfilter` holds a belief and does these to it;
`ciberrato.bayes.logbelief` does the same in logarithms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import (
    belief_array,
    belief_bounds,
    floats,
    log_likelihood_array,
    refuse_log_likelihood,
)
from ciberrato.bayes.recovery import POLICIES, ImpossiblePolicy, recover
from ciberrato.reprs import short_repr

# Below this the sum of products may have lost digits to clipped terms, and the logarithms are taken instead.
_SAFE_TOTAL = 1e-230
# Likelihoods are followed down to this many nats below the best. Further down products with small beliefs
# would be denormal numbers, which are thirty times as slow; those that can matter are worked out one by one.
_FAR = -600.0
# The smallest number that has all its digits, and a belief that exp(_FAR) does not take below it.
_LEAST, _LOG_LEAST, _SMALL = 2.2250738585072014e-308, -708.3964185322641, 1e-46
_FEW = 4096
# In single precision: likelihoods are followed down to this many nats, products to the smallest number with
# all its digits, and a sum of products that is less is left to double precision.
_FAR_SINGLE, _LEAST_SINGLE, _LEAST_TOTAL = np.float32(-87.0), np.float32(1.1754944e-38), 1e-12
_PIECE = 32768
# Sums up to this, of products down to the least one that the machine code does not report: all scale safely.
_PLAIN_TOTAL, _PLAIN_LEAST = 1e7, 1e-300


class _Pair(NamedTuple):
    posterior: FloatArray
    log_evidence: float


class Update(_Pair):
    """Result of an update: a pair (posterior, log evidence), and a count.

    Attributes
    ----------
    posterior : FloatArray
        Sums to 1.
    log_evidence : float
        Natural logarithm of the reading's probability (or density) under the belief as given; -inf if it was
        impossible and the policy has decided. Where the belief was not normalized, because a prediction lost
        mass, the mass lost counts against the evidence.
    lost : int
        States that are possible but whose probability is below 2.2e-308, the smallest number with all its
        digits: zero from now on, though a later reading could favour them. `LogBelief` keeps them.
    """

    __repr__ = short_repr

    lost: int = 0

    @classmethod
    def of(cls, posterior: FloatArray, log_evidence: float, lost: int) -> Update:
        """Return an update that counts states lost."""
        result = cls(posterior, log_evidence)
        result.lost = lost
        return result


def update(
    belief: ArrayLike,
    log_likelihood: ArrayLike,
    *,
    on_impossible: ImpossiblePolicy = "raise",
    out: FloatArray | None = None,
) -> Update:
    """Correct a belief by a reading (table 4.1, line 4).

    Works for likelihoods far below the smallest float: only their ratios count. -inf means impossible. Every
    state whose posterior probability a double can hold gets it; the others are counted in `Update.lost`.
    In machine code (`ciberrato.bayes.compiled`) each posterior is the same to 1e-14 of it, or to 1e-12 where
    it is below 1e-300.

    Parameters
    ----------
    belief : array_like
        Prediction, any shape, non-negative; need not sum to 1. Zero everywhere (a prediction lost all) makes
        every reading impossible.
    log_likelihood : array_like
        log p(reading | state), same shape; +inf and nan are errors.
    on_impossible : {"raise", "keep", "uniform", "likelihood"}
        Action if no state with mass explains the reading; see `ciberrato.bayes.recovery`.
    out : FloatArray, optional
        Array for the posterior; may be `belief` or `log_likelihood` itself.

    A belief that is an array of float32 gets a posterior of float32; see `update_single`.

    Returns
    -------
    Update
        Posterior and log evidence, in this order.

    Raises
    ------
    ImpossibleReadingError
        If the reading is impossible and `on_impossible` is "raise".
    ValueError
        If shapes differ, the belief is negative or not finite, or a likelihood is nan or infinite.
    """
    belief = floats(belief)
    log_likelihood = log_likelihood_array(log_likelihood, belief.shape)
    if on_impossible not in POLICIES:
        raise ValueError(
            f"no policy {on_impossible!r} for impossible readings; choose one of {', '.join(POLICIES)}"
        )
    machine_code = belief.size and compiled.kernels(belief.size) is not None
    if machine_code or (belief.size >= compiled.LARGE and belief.dtype == np.float64):
        result = _update_large(belief, log_likelihood, out)
        if result is not None:
            return result
    if belief.dtype == np.float32:
        return update_single(belief, log_likelihood, on_impossible, out)
    least, most = belief_bounds(belief, massless=True)
    lowest = float(np.minimum.reduce(log_likelihood, axis=None, initial=np.inf))
    best = float(np.maximum.reduce(log_likelihood, axis=None, initial=-np.inf))
    if not best < math.inf:  # nan neither
        refuse_log_likelihood(log_likelihood)

    total = 0.0
    if best > -math.inf:
        free = out is not None and not (
            np.may_share_memory(out, belief) or np.may_share_memory(out, log_likelihood)
        )
        weights = np.subtract(log_likelihood, best, out=out if free else None, dtype=np.float64)
        if lowest < best + _FAR:
            np.maximum(weights, _FAR - 1.0, out=weights)
        np.exp(weights, out=weights)
        np.multiply(weights, belief, out=weights)
        total = float(np.add.reduce(weights, axis=None))
    if not _SAFE_TOTAL < total < math.inf:
        posterior, log_evidence, lost = _update_by_logarithms(belief, log_likelihood)
        if log_evidence == -math.inf:
            posterior = recover(belief, log_likelihood, on_impossible)
        return Update.of(_written(posterior, out), log_evidence, lost)
    log_evidence = best + math.log(total)
    if lowest >= best + _FAR and least >= _SMALL * max(1.0, total):
        # No product was clipped or underflowed.
        np.multiply(weights, 1.0 / total, out=weights)
        return Update(_written(weights, out), log_evidence)
    if lowest < best + _FAR:
        np.multiply(weights, log_likelihood >= best + _FAR, out=weights)
    lost = _finish(weights, total, belief, log_likelihood, most, log_evidence)
    return Update.of(_written(weights, out), log_evidence, lost)


def _products(
    belief: FloatArray,
    scores: FloatArray,
    best: float,
    far: float,
    least: float,
    floor: float,
    most: float,
    out: FloatArray,
    begin: int,
    end: int,
) -> tuple[float, int, int]:
    """Do what the machine code's `products` does, in double precision: in pieces that stay in the cache."""
    total, small, wrong = [], 0, 0
    for first in range(begin, end, _PIECE):
        piece = slice(first, min(first + _PIECE, end))
        held, part = belief[piece], out[piece]
        given = scores[piece]
        np.subtract(given, best, out=part, dtype=np.float64)
        # Of -inf the exponential is 0 at once; what else is far off would be a denormal number.
        distant = given < far + best
        near = part >= far if distant.any() and not np.array_equal(distant, given == -np.inf) else None
        np.exp(part if near is None else np.maximum(part, far, out=part), out=part)
        np.multiply(part, held, out=part)
        if near is not None:
            np.multiply(part, near, out=part)
        # Mostly as many are small as hold nothing before: these are not counted.
        low = part < least
        if np.count_nonzero(low) != np.count_nonzero(held == 0.0):
            small += int(np.count_nonzero(low & (held > 0.0) & (given > -np.inf)))
        wrong += not (held.min() >= 0.0 and held.max() <= most)
        total.append(float(part.sum()))
    return math.fsum(total), small, wrong


def _update_large(belief: FloatArray, log_likelihood: FloatArray, out: FloatArray | None) -> Update | None:
    """Return what `update` does, in few passes, by machine code if loaded; None if not plain."""
    loops: Any = compiled.kernels(belief.size)
    flat, scores = np.ascontiguousarray(belief).ravel(), np.ascontiguousarray(log_likelihood).ravel()
    size = flat.size
    if loops is None:
        best = float(scores.max())
    else:
        best = float(
            np.max(compiled.share(lambda begin, end: loops.greatest(scores, begin, end), size, size))
        )
    if not -math.inf < best < math.inf:
        return None
    fits = out is not None and out.flags.c_contiguous and out.dtype == belief.dtype
    if out is not None and fits and not (np.may_share_memory(out, flat) or np.may_share_memory(out, scores)):
        weights = out
    else:
        weights = np.empty(belief.shape, dtype=belief.dtype)
    products = weights.reshape(-1)
    single = belief.dtype == np.float32
    # In single precision, what is too small for all digits becomes zero, and is lost.
    given = (_FAR_SINGLE, _LEAST_SINGLE, _LEAST_SINGLE) if single else (_FAR, _PLAIN_LEAST, 0.0)
    of_part: Any = _products if loops is None else loops.products
    parts = compiled.share(
        lambda begin, end: of_part(
            flat, scores, best, *map(float, given), 1e300 / size, products, begin, end
        ),
        size,
        size,
    )
    total, lost = math.fsum(part[0] for part in parts), int(sum(part[1] for part in parts))
    least, most = (_LEAST_TOTAL, 1e30) if single else (_SAFE_TOTAL, _PLAIN_TOTAL)
    if any(part[2] for part in parts) or not least < total < most:
        return None
    log_evidence = best + math.log(total)
    if lost and not single:
        lost = _finish(weights, total, belief, log_likelihood, float(belief.max()), log_evidence)
    else:
        factor = belief.dtype.type(1.0 / total)
        if loops is None:
            np.multiply(products, factor, out=products)
        else:
            compiled.share(lambda begin, end: loops.scale(products, factor, begin, end), size, size)
    return Update.of(_written(weights, out), log_evidence, lost)


def update_single(
    belief: FloatArray, log_likelihood: FloatArray, policy: ImpossiblePolicy, out: FloatArray | None
) -> Update:
    """Correct a belief of single precision: `update` for arrays of float32.

    Posteriors of 1e-25 or more are right to 1e-5 of each (likelihoods are taken down to 87 nats below the
    best, to single precision), smaller ones are that or zero. What single precision cannot decide, because
    the best states hold next to nothing, is worked out in double precision.
    """
    best = float(np.maximum.reduce(log_likelihood, axis=None, initial=-np.inf))
    if not best < math.inf:
        refuse_log_likelihood(log_likelihood)
    belief_bounds(belief, massless=True)
    weights: FloatArray = np.empty(belief.shape, dtype=np.float32)
    flat, held, scores = weights.ravel(), np.ravel(belief), np.ravel(log_likelihood)
    total, lost = 0.0, 0
    for begin in range(0, flat.size if best > -math.inf else 0, _PIECE):
        piece = slice(begin, begin + _PIECE)
        part, old, score = flat[piece], held[piece], scores[piece]
        np.subtract(score, best, out=part, dtype=scores.dtype, casting="same_kind")
        far = part < _FAR_SINGLE
        part[far] = _FAR_SINGLE
        np.exp(part, out=part)
        np.multiply(part, old, out=part)
        far |= part < _LEAST_SINGLE
        if far.any():
            part[far] = 0.0
            lost += int(np.count_nonzero((old[far] > 0.0) & (score[far] > -np.inf)))
        total += float(part.sum())
    if not _LEAST_TOTAL < total < 1e30:
        exact = update(belief.astype(float), log_likelihood, on_impossible=policy)
        return Update.of(_written(exact.posterior.astype(np.float32), out), exact.log_evidence, exact.lost)
    np.multiply(weights, np.float32(1.0 / total), out=weights)
    return Update.of(_written(weights, out), best + math.log(total), lost)


def _finish(
    weights: FloatArray,
    total: float,
    belief: FloatArray,
    log_likelihood: FloatArray,
    most: float,
    log_evidence: float,
) -> int:
    """Scale products, some of which are too small or zero, to the posterior; return how many states are lost.

    Products that have underflowed, or that were too far down to be followed, are worked out by logarithms
    where the posterior can hold them.
    """
    small = weights < _LEAST * max(1.0, total)
    np.multiply(weights, 1.0 / total, out=weights)
    possible = small & (belief > 0.0)
    if not possible.any():
        return 0
    possible &= log_likelihood > -np.inf
    np.multiply(weights, ~small, out=weights)
    lost = int(np.count_nonzero(possible))
    # No state below this can have a posterior that a double holds.
    reach = log_evidence - math.log(most) + _LOG_LEAST
    near = possible & (log_likelihood > reach)
    if near.any():
        scores = np.log(belief[near]) + log_likelihood[near] - log_evidence
        kept = scores >= _LOG_LEAST
        weights[near] = np.where(kept, np.exp(np.maximum(scores, _LOG_LEAST)), 0.0)
        lost -= int(np.count_nonzero(kept))
    return lost


def update_by_likelihood(
    belief: ArrayLike,
    likelihood: ArrayLike,
    *,
    on_impossible: ImpossiblePolicy = "raise",
    out: FloatArray | None = None,
) -> Update:
    """Correct a belief by a reading's likelihood itself, where probabilities are far from underflow.

    Parameters as of `update`, but for `likelihood`: p(reading | state), 0 or more and finite. One product,
    one sum and one scaling; where these underflow, the logarithms.

    Returns
    -------
    Update

    Raises
    ------
    ImpossibleReadingError, ValueError
        As `update`.
    """
    belief = np.asarray(belief, dtype=float)
    likelihood = np.asarray(likelihood, dtype=float)
    if belief.shape != likelihood.shape:
        raise ValueError(f"belief has shape {belief.shape}, likelihood {likelihood.shape}")
    if not belief.size:
        raise ValueError("the belief has no cells")
    few = belief.size < _FEW
    least = float(np.minimum(belief, likelihood).min()) if few else min(belief.min(), likelihood.min())
    if out is None:
        weights = belief * likelihood
    else:
        shared = np.may_share_memory(out, belief) or np.may_share_memory(out, likelihood)
        weights = np.multiply(belief, likelihood, out=None if shared else out)
    # A scalar product costs half of a sum where there is little to add up.
    total = float(np.vdot(belief, likelihood) if few else weights.sum())
    if least > 1e-150 and total < 1e7:  # no product underflows, nor does the posterior
        weights *= 1.0 / total
        return Update(_written(weights, out), math.log(total))
    # nan and infinity show in the sum.
    if not (least >= 0.0 and total < math.inf):
        belief_bounds(belief, massless=True)
        belief_bounds(likelihood, what="likelihood", massless=True)
    if on_impossible in POLICIES and _SAFE_TOTAL < total < math.inf:
        lost = (weights < _LEAST * max(1.0, total)) & (belief > 0.0) & (likelihood > 0.0)
        if not lost.any():
            weights *= 1.0 / total
            return Update(_written(weights, out), math.log(total))
    with np.errstate(divide="ignore"):
        return update(belief, np.log(likelihood), on_impossible=on_impossible, out=out)


def _update_by_logarithms(belief: FloatArray, log_likelihood: FloatArray) -> tuple[FloatArray, float, int]:
    with np.errstate(divide="ignore"):
        scores = np.log(belief) + log_likelihood
    best = float(scores.max(initial=-np.inf))
    if best == -math.inf:
        return np.zeros_like(belief), -math.inf, 0
    log_evidence = best + math.log(float(np.exp(np.maximum(scores - best, -745.0)).sum()))
    scores -= log_evidence
    kept = scores >= _LOG_LEAST
    lost = int(np.count_nonzero((scores > -np.inf) & ~kept))
    return np.exp(np.maximum(scores, _LOG_LEAST)) * kept, log_evidence, lost


def _written(values: FloatArray, out: FloatArray | None) -> FloatArray:
    if out is None or out is values:
        return values
    out[...] = values
    return out


def predict(transition: Callable[[FloatArray, Any], FloatArray], belief: ArrayLike, control: Any) -> Update:
    """Apply a motion model and normalize (table 4.1, line 3).

    Parameters
    ----------
    transition : callable
        A motion model's `predict`: (belief, control) -> belief, which may have lost mass over an edge.
    belief : array_like
        Sums to 1; all zero if an earlier prediction has lost everything.
    control : object
        Control of the motion model: a command or an odometry reading.

    Returns
    -------
    Update
        The predicted belief, normalized, and the logarithm of the mass kept (0 if none was lost). If no mass
        is left, the belief is all zero and the logarithm -inf: `update` then applies its policy.

    Raises
    ------
    ValueError
        If the belief is none, or what the motion model makes of it is none (nan, infinite, negative, another
        shape).
    """
    before = belief_array(belief, massless=True, single=True)
    predicted = belief_array(
        transition(before, control),
        what="motion model's result",
        shape=before.shape,
        massless=True,
        single=before.dtype == np.float32,
    ).astype(before.dtype, copy=False)
    kept = float(predicted.sum(dtype=np.float64))
    if kept <= 0.0:
        return Update(predicted, -math.inf)
    return Update(np.divide(predicted, kept, dtype=predicted.dtype), math.log(kept))
