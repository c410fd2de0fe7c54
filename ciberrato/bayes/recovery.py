"""Recovery when no state can explain a reading.

A reading whose probability is zero in every state that the belief holds possible says that the map, the
sensor model or the belief is wrong. Bayes' rule has no answer to it (0 / 0), so the caller names one.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ciberrato.bayes.arraytypes import FloatArray

ImpossiblePolicy = Literal["raise", "keep", "uniform", "likelihood"]
"""`raise`: stop with `ImpossibleReadingError`.
`keep`: disregard the reading; the belief stays, normalized.
`uniform`: forget everything; all states are equally likely.
`likelihood`: forget the past, trust the reading: the likelihood alone, normalized, over all states; uniform
where the reading is impossible in every state there is."""

POLICIES: tuple[str, ...] = get_args(ImpossiblePolicy)


class ImpossibleReadingError(ValueError):
    """No state that the belief holds possible explains the reading."""


def recover(belief: FloatArray, log_likelihood: FloatArray, policy: ImpossiblePolicy) -> FloatArray:
    """Return the belief that a policy puts in the place of 0 / 0.

    Parameters
    ----------
    belief : FloatArray
        The prediction, any shape, not necessarily normalized; may be all zero.
    log_likelihood : FloatArray
        Same shape.
    policy : ImpossiblePolicy
        Its name.

    Returns
    -------
    FloatArray
        A new array that sums to 1.

    Raises
    ------
    ImpossibleReadingError
        If the policy is `raise`.
    ValueError
        If there is no policy of that name.
    """
    if policy == "keep":
        total = belief.sum()
        # A belief without any mass (all of it was shifted out of the map) holds nothing to keep.
        return belief / total if total > 0.0 else np.full(belief.shape, 1.0 / belief.size)
    with np.errstate(divide="ignore"):
        logs = recover_logs(np.log(belief), log_likelihood, policy)
    weights = np.exp(np.maximum(logs, -708.0)) * (logs >= -708.0)
    return np.asarray(weights / weights.sum())


def recover_logs(log_belief: FloatArray, log_likelihood: FloatArray, policy: ImpossiblePolicy) -> FloatArray:
    """Return the logarithms of the belief that a policy puts in the place of 0 / 0.

    Parameters and errors as of `recover`, but for `log_belief`: natural logarithms.
    """
    if policy == "raise":
        raise ImpossibleReadingError(
            "the reading is impossible in every state that the belief holds possible"
        )
    if policy not in POLICIES:
        raise ValueError(f"no policy {policy!r} for impossible readings; choose one of {', '.join(POLICIES)}")
    scores = {"keep": log_belief, "likelihood": log_likelihood, "uniform": np.zeros(log_belief.shape)}[policy]
    best = scores.max(initial=-np.inf)
    if best == -np.inf:  # nothing to keep, or nothing explains the reading: all states alike
        scores, best = np.zeros(scores.shape), 0.0
    # Two subtractions: the first one is exact where it matters.
    shifted = np.asarray(scores, dtype=float) - best
    return np.asarray(shifted - np.log(np.exp(np.maximum(shifted, -745.0)).sum()))
