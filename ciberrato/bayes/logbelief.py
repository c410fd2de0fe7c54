r"""A belief in natural logarithms, which keeps every state that is possible.

A double holds probabilities down to 2.2e-308, 708 nats below certainty; 18 range beams that are half a metre
off are further down than that. Here a state that is unlikely stays possible, and wins when later readings
favour it. Updates are sums. Predictions are sums of probabilities, which the motion model works out: the
belief is cut into bands of 600 nats, each is scaled to where doubles hold it, moved by itself, and the
results are added as logarithms,

.. math:: \log \sum_k e^{s_k} M(e^{\ell - s_k} [\ell \in \text{band } k]),

which is exact because motion models are linear in the belief.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import belief_array, log_likelihood_array, refuse_log_likelihood
from ciberrato.bayes.recovery import POLICIES, ImpossiblePolicy, recover_logs

# Nats that a band spans, scaled to between 1 and e^600: products with any transition probability that a
# double holds are then within the range of numbers.
_BAND = 600.0
_LOG_LEAST = -708.3964185322641


def log_total(logs: FloatArray) -> float:
    """Return the logarithm of the sum of what the logarithms stand for; -inf if that is nothing."""
    best = float(logs.max(initial=-np.inf))
    if not -math.inf < best < math.inf:
        return best
    return best + math.log(float(np.exp(np.maximum(logs - best, -745.0)).sum()))


def masses_of(logs: FloatArray) -> FloatArray:
    """Return what normalized logarithms stand for; 0 below the smallest double that has all its digits."""
    return np.asarray(np.exp(np.maximum(logs, _LOG_LEAST)) * (logs >= _LOG_LEAST))


def moved(transition: Callable[[FloatArray], FloatArray], logs: FloatArray) -> FloatArray:
    """Apply a linear map with entries of 0 or more to what logarithms stand for.

    Parameters
    ----------
    transition : callable
        Takes an array of the logarithms' shape, with entries 0 to e^600, and returns one.
    logs : FloatArray
        Any shape; -inf is zero.

    Returns
    -------
    FloatArray
        Logarithms of the result, of its shape.
    """
    result: FloatArray | None = None
    top = float(logs.max(initial=-np.inf))
    while result is None or top > -math.inf:
        floor = top - _BAND if top > -math.inf else 0.0
        inside = (logs > floor) & (logs <= top)
        scaled = np.exp(np.where(inside, logs - floor, 0.0)) * inside
        part = belief_array(transition(scaled), what="motion model's result", massless=True)
        with np.errstate(divide="ignore"):
            part = np.log(part) + floor
        result = part if result is None else np.logaddexp(result, part)
        top = float(logs.max(initial=-np.inf, where=logs <= floor))
    return result


class LogBelief:
    """Natural logarithms of a belief: an object that does not change.

    Parameters
    ----------
    logs : array_like
        Any shape; below infinity, -inf where impossible, and possible somewhere; is normalized.
    """

    __slots__ = ("logs",)

    logs: FloatArray
    """Normalized, read-only; all -inf only after a prediction that lost everything."""

    def __init__(self, logs: ArrayLike) -> None:
        values = np.array(logs, dtype=float)
        total = log_total(values)
        if not math.isfinite(total):
            raise ValueError(
                f"a belief in logarithms must be below infinity, not nan, and possible somewhere; "
                f"its greatest entry is {values.max(initial=-np.inf)}"
            )
        self._keep(values - total)

    def _keep(self, logs: FloatArray) -> None:
        logs.setflags(write=False)
        self.logs = logs

    @classmethod
    def _raw(cls, logs: FloatArray) -> LogBelief:
        result = cls.__new__(cls)
        result._keep(logs)
        return result

    @classmethod
    def of(cls, belief: ArrayLike) -> LogBelief:
        """Return a log belief from a belief, which need not sum to 1."""
        values = belief_array(belief, massless=True)
        with np.errstate(divide="ignore"):
            logs = np.log(values)
        return cls(logs) if values.any() else cls._raw(logs)

    @property
    def masses(self) -> FloatArray:
        """The belief itself; zero where a double cannot hold it."""
        return masses_of(self.logs)

    @property
    def beyond_doubles(self) -> int:
        """Number of states that are possible, but zero in `masses`."""
        return int(np.count_nonzero((self.logs < _LOG_LEAST) & (self.logs > -np.inf)))

    def update(
        self, log_likelihood: ArrayLike, *, on_impossible: ImpossiblePolicy = "raise"
    ) -> tuple[LogBelief, float]:
        """Correct the belief by a reading; parameters, results and errors as of `filtering.update`."""
        scores = log_likelihood_array(log_likelihood, self.logs.shape).astype(float)
        if not scores.max(initial=-np.inf) < np.inf:
            refuse_log_likelihood(scores)
        if on_impossible not in POLICIES:
            raise ValueError(
                f"no policy {on_impossible!r} for impossible readings; choose one of {', '.join(POLICIES)}"
            )
        joint = self.logs + scores
        log_evidence = log_total(joint)
        if log_evidence == -math.inf:
            return LogBelief._raw(recover_logs(self.logs, scores, on_impossible)), -math.inf
        return LogBelief._raw(joint - log_evidence), log_evidence

    def predict(
        self, transition: Callable[[FloatArray, Any], FloatArray], control: Any
    ) -> tuple[LogBelief, float]:
        """Apply a motion model, which must be linear in the belief, and normalize.

        Parameters and results as of `filtering.predict`. Models that leave out states below a fixed mass
        (`GaussianOdometry(skip_below=...)`) are not linear.
        """
        logs = moved(lambda masses: transition(masses, control), self.logs)
        if logs.shape != self.logs.shape:
            raise ValueError(
                f"the motion model's result has shape {logs.shape}, the belief {self.logs.shape}"
            )
        log_kept = log_total(logs)
        return LogBelief._raw(logs if log_kept == -math.inf else logs - log_kept), log_kept
