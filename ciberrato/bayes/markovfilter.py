"""A belief that is predicted and corrected in turn: a thin holder around the filter's two steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import belief_array
from ciberrato.bayes.filtering import predict, update
from ciberrato.bayes.logbelief import LogBelief
from ciberrato.bayes.recovery import ImpossiblePolicy


class MarkovFilter:
    """A belief that is predicted and corrected in turn.

    Readings between two predictions are taken together exactly, however far apart the states are: where a
    double cannot hold a state's probability the logarithms are kept until the next prediction. That needs
    probabilities again: states below 2.2e-308 are then lost, and counted. With `log=True` the belief is a
    `LogBelief` throughout, and nothing is ever lost.

    Parameters
    ----------
    prior : array_like or LogBelief
        Initial belief; is normalized.
    motion : callable
        A motion model's `predict`. With `log=True` it must be linear in the belief.
    on_impossible : {"raise", "keep", "uniform", "likelihood"}
        Policy for impossible readings.
    log : bool
        Keep logarithms through predictions, too. One prediction then calls `motion` once for every 600 nats
        that the possible states lie apart.
    dtype : {float64, float32}
        Precision of the belief. float32 halves memory, and time on large grids: masses are right to 1e-5 of
        each after an update, and a state below 1e-25 may come to be zero (`lost`).

    Attributes
    ----------
    log_evidence : float
        Sum of the log evidence of all possible readings so far, mass lost in predictions included.
    recoveries : int
        Number of readings that were impossible, so that the policy decided.
    lost : int
        Number of states that a prediction has set to zero, because their probability was below the
        smallest double, although a later reading could have favoured them; 0 with `log=True`.
    """

    def __init__(
        self,
        prior: ArrayLike | LogBelief,
        motion: Callable[[FloatArray, Any], FloatArray],
        *,
        on_impossible: ImpossiblePolicy = "raise",
        log: bool = False,
        dtype: DTypeLike = np.float64,
    ) -> None:
        self._dtype = np.dtype(dtype)
        if self._dtype not in (np.float32, np.float64):
            raise ValueError(f"the belief is of float64 or float32, not {self._dtype}")
        if self._dtype == np.float32 and (log or isinstance(prior, LogBelief)):
            raise ValueError("logarithms are kept in float64: leave out dtype, or log")
        self.log_evidence = 0.0
        self.recoveries = 0
        self.lost = 0
        self._motion = motion
        self._policy: ImpossiblePolicy = on_impossible
        self._keeps_logs = log
        # The belief is here or, if that is not None, there.
        self._masses: FloatArray = np.empty(0)
        self._logs: LogBelief | None = None
        if isinstance(prior, LogBelief):
            self._logs = prior
        else:
            self._set(belief_array(prior, what="prior"))

    def _set(self, masses: FloatArray) -> None:
        self._masses = (masses / masses.sum()).astype(self._dtype, copy=False)
        self._logs = LogBelief.of(self._masses) if self._keeps_logs else None

    @property
    def belief(self) -> FloatArray:
        """Current belief, sums to 1; may be set, to any array that has some mass."""
        return self._masses if self._logs is None else self._logs.masses

    @belief.setter
    def belief(self, belief: ArrayLike) -> None:
        self._set(belief_array(belief))

    @property
    def log_belief(self) -> FloatArray:
        """Natural logarithm of the current belief, of states below the smallest double, too; -inf: none."""
        if self._logs is not None:
            return self._logs.logs
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self._masses))

    def predict(self, control: Any) -> FloatArray:
        """Move the belief by a control and return it; mass lost over edges counts in the evidence."""
        if self._keeps_logs and self._logs is not None:
            self._logs, log_kept = self._logs.predict(self._motion, control)
        else:
            if self._logs is not None:
                self.lost += self._logs.beyond_doubles
                self._masses, self._logs = self._logs.masses, None
            self._masses, log_kept = predict(self._motion, self._masses, control)
        if log_kept > -math.inf:
            self.log_evidence += log_kept
        return self.belief

    def update(self, log_likelihood: ArrayLike) -> FloatArray:
        """Correct the belief by a reading's log likelihood, same shape, and return it."""
        if self._logs is None:
            result = update(self._masses, log_likelihood, on_impossible=self._policy)
            log_evidence = result.log_evidence
            if self._dtype == np.float32:
                self._masses = result.posterior
                self.lost += result.lost
            elif result.lost:
                self._logs, _ = LogBelief.of(self._masses).update(log_likelihood)
            else:
                self._masses = result.posterior
        else:
            self._logs, log_evidence = self._logs.update(log_likelihood, on_impossible=self._policy)
        if self._logs is not None and not self._keeps_logs and not self._logs.beyond_doubles:
            self._masses, self._logs = self._logs.masses, None
        if log_evidence > -math.inf:
            self.log_evidence += log_evidence
        else:
            self.recoveries += 1
        return self.belief
