"""The discrete Bayes filter: predict, update, and a thin holder around them.

Thrun, Burgard, Fox, Probabilistic Robotics (2005): table 2.1 (Bayes filter), 4.1 (discrete Bayes filter),
8.1 (grid localization).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.recovery import POLICIES, ImpossiblePolicy, recover

# Below this the sum of products may have lost digits to denormal numbers, and the logarithms are taken
# instead.
_SAFE_TOTAL = 1e-280


class Update(NamedTuple):
    """What a reading makes of a belief.

    Attributes
    ----------
    posterior : FloatArray
        Sums to 1.
    log_evidence : float
        Natural logarithm of the reading's probability (or density) under the belief as given; -inf if it was
        impossible and the policy has decided. Where the belief was not normalized, because a prediction lost
        mass, the mass lost counts against the evidence.
    """

    posterior: FloatArray
    log_evidence: float


def update(
    belief: ArrayLike,
    log_likelihood: ArrayLike,
    *,
    on_impossible: ImpossiblePolicy = "raise",
    out: FloatArray | None = None,
) -> Update:
    """Correct a belief by a reading (table 4.1, line 4).

    Works for likelihoods far below the smallest float: only their ratios count. -inf means impossible.

    Parameters
    ----------
    belief : array_like
        Prediction, any shape, non-negative; need not sum to 1.
    log_likelihood : array_like
        log p(reading | state), same shape; +inf and nan are errors.
    on_impossible : {"raise", "keep", "uniform", "likelihood"}
        What to do if no state with mass explains the reading; see `ciberrato.bayes.recovery`.
    out : FloatArray, optional
        Where to write the posterior; may be `belief` or `log_likelihood` itself.

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
    belief = np.asarray(belief, dtype=float)
    log_likelihood = np.asarray(log_likelihood, dtype=float)
    if belief.shape != log_likelihood.shape:
        raise ValueError(f"belief has shape {belief.shape}, log likelihood {log_likelihood.shape}")
    if on_impossible not in POLICIES:
        raise ValueError(
            f"no policy {on_impossible!r} for impossible readings; there are {', '.join(POLICIES)}"
        )
    lowest, greatest = belief.min(initial=0.0), belief.max(initial=0.0)
    if not (lowest >= 0.0 and greatest < np.inf):  # nan fails both comparisons
        raise ValueError("a belief must be finite and not negative")
    best = float(log_likelihood.max(initial=-np.inf))
    if math.isnan(best) or best == np.inf:
        raise ValueError("a log likelihood must be below infinity and not nan")

    total = 0.0
    if best > -np.inf:
        # Clipping keeps exp away from denormal numbers, which are ten times as slow; -inf goes the same way,
        # to 1e-304, and is put right below only where it could matter.
        free = out is not None and not (
            np.may_share_memory(out, belief) or np.may_share_memory(out, log_likelihood)
        )
        weights = np.subtract(log_likelihood, best, out=out if free else None)
        np.maximum(weights, -700.0, out=weights)
        np.exp(weights, out=weights)
        np.multiply(weights, belief, out=weights)
        total = float(weights.sum())
    if total > _SAFE_TOTAL:
        # Clipped terms are below 1e-304 of a total above 1e-280, yet a posterior that is exactly zero stays
        # so.
        weights[log_likelihood < best - 700.0] = 0.0
        np.multiply(weights, 1.0 / total, out=weights)
        return Update(_written(weights, out), best + math.log(total))
    posterior, log_evidence = _update_by_logarithms(belief, log_likelihood)
    if log_evidence == -np.inf:
        posterior = recover(belief, log_likelihood, on_impossible)
    return Update(_written(posterior, out), log_evidence)


def update_by_likelihood(
    belief: ArrayLike,
    likelihood: ArrayLike,
    *,
    on_impossible: ImpossiblePolicy = "raise",
    out: FloatArray | None = None,
) -> Update:
    """Correct a belief by a reading's likelihood itself, where probabilities are far from underflow.

    Parameters as of `update`, but for `likelihood`: p(reading | state), 0 or more and finite. One product,
    one sum and one scaling.

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
    weights = np.multiply(belief, likelihood, out=out)
    total = float(np.add.reduce(weights, axis=None))
    # A negative product is only possible if one factor is; nan and infinity show in the sum.
    if not np.minimum.reduce(weights, axis=None, initial=0.0) >= 0.0 or not total < np.inf:
        raise ValueError("beliefs and likelihoods must be finite and not negative")
    if total > _SAFE_TOTAL:
        np.multiply(weights, 1.0 / total, out=weights)
        return Update(weights, math.log(total))
    if out is not None and (np.may_share_memory(out, belief) or np.may_share_memory(out, likelihood)):
        raise ValueError("products underflow, and `out` has overwritten what they came from; use `update`")
    with np.errstate(divide="ignore"):
        return update(belief, np.log(likelihood), on_impossible=on_impossible, out=out)


def _update_by_logarithms(belief: FloatArray, log_likelihood: FloatArray) -> tuple[FloatArray, float]:
    with np.errstate(divide="ignore"):
        scores = np.log(belief) + log_likelihood
    best = scores.max(initial=-np.inf)
    if best == -np.inf:
        return np.zeros_like(belief), -math.inf
    weights = np.exp(scores - best)
    total = weights.sum()
    return weights / total, float(best + np.log(total))


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
        Sums to 1.
    control : object
        What the motion model takes.

    Returns
    -------
    Update
        The predicted belief, normalized, and the logarithm of the mass kept (0 if none was lost). If no mass
        is left, the belief is all zero and the logarithm -inf: `update` then applies its policy.
    """
    predicted = transition(np.asarray(belief, dtype=float), control)
    kept = float(predicted.sum())
    if kept <= 0.0:
        return Update(predicted, -math.inf)
    return Update(predicted / kept, math.log(kept))


class MarkovFilter:
    """A belief that is predicted and corrected in turn.

    Parameters
    ----------
    prior : array_like
        Initial belief; is normalized.
    motion : callable
        A motion model's `predict`.
    on_impossible : {"raise", "keep", "uniform", "likelihood"}
        Policy for impossible readings.

    Attributes
    ----------
    belief : FloatArray
        Current belief, sums to 1.
    log_evidence : float
        Sum of the log evidence of all possible readings so far, mass lost in predictions included.
    recoveries : int
        How often a reading was impossible and the policy decided.
    """

    def __init__(
        self,
        prior: ArrayLike,
        motion: Callable[[FloatArray, Any], FloatArray],
        *,
        on_impossible: ImpossiblePolicy = "raise",
    ) -> None:
        prior = np.asarray(prior, dtype=float)
        if not (prior.min() >= 0.0 and 0.0 < prior.sum() < np.inf):
            raise ValueError("a prior must be finite and not negative, and have some mass")
        self.belief: FloatArray = prior / prior.sum()
        self.log_evidence = 0.0
        self.recoveries = 0
        self._motion = motion
        self._policy: ImpossiblePolicy = on_impossible

    def predict(self, control: Any) -> FloatArray:
        """Move the belief by a control and return it; mass lost over edges counts in the evidence."""
        self.belief, log_kept = predict(self._motion, self.belief, control)
        if log_kept > -np.inf:
            self.log_evidence += log_kept
        return self.belief

    def update(self, log_likelihood: ArrayLike) -> FloatArray:
        """Correct the belief by a reading's log likelihood, same shape, and return it."""
        self.belief, log_evidence = update(self.belief, log_likelihood, on_impossible=self._policy)
        if log_evidence > -np.inf:
            self.log_evidence += log_evidence
        else:
            self.recoveries += 1
        return self.belief
