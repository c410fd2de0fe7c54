r"""Noticing that the belief is wrong, and starting over.

A filter that is sure of the wrong place cannot find out by itself: every reading is explained as well as that
place allows. But the readings' evidence drops. `EvidenceMonitor` compares a fast and a slow running mean of
the log evidence per reading, as augmented Monte Carlo localization does (Probabilistic Robotics, section
8.3.5, table 8.3, with means of logarithms in the place of means, so that one bad reading does not weigh a
thousandfold), and `inject` mixes a fresh belief in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import belief_array, whole
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceMonitor:
    """Running means of the log evidence.

    `seen` gives a new monitor: this one does not change.

    Attributes
    ----------
    fast, slow : float
        Rates of the means, 0 < slow < fast <= 1: after 1 / rate readings two thirds of a change are in.
    threshold : float
        Alarm when the fast mean is below the slow one by this much, in nats a reading.
    floor : float
        Limit of one reading's weight, in nats below the slow mean, also for impossible ones (evidence -inf).
    warm_up : int
        No alarm before so many readings since the start or the last restart: at first the belief is still
        finding its place.
    fast_mean, slow_mean : float
        Present means, nats a reading.
    readings : int
        Seen in all.
    since_restart : int
        Seen since the start or the last restart.
    """

    __repr__ = short_repr

    fast: float = 0.3
    slow: float = 0.02
    threshold: float = 2.5
    floor: float = 20.0
    warm_up: int = 10
    fast_mean: float = 0.0
    slow_mean: float = 0.0
    readings: int = 0
    since_restart: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.slow < self.fast <= 1.0:
            raise ValueError(f"rates need 0 < slow < fast <= 1, not {self.slow}, {self.fast}")
        if not (0.0 < self.threshold < math.inf and 0.0 < self.floor < math.inf):
            raise ValueError(f"threshold and floor must be positive, not {self.threshold}, {self.floor}")
        if not (math.isfinite(self.fast_mean) and math.isfinite(self.slow_mean)):
            raise ValueError(f"the means must be finite, not {self.fast_mean}, {self.slow_mean}")
        for name in ("warm_up", "readings", "since_restart"):
            object.__setattr__(self, name, whole(getattr(self, name), what=name, least=0))

    def seen(self, log_evidence: float) -> EvidenceMonitor:
        """Return the monitor after one reading's log evidence, as `update` returns it: -inf if impossible."""
        if not log_evidence < math.inf:  # nan neither
            raise ValueError(f"a log evidence is a number below infinity, not {log_evidence}")
        count = self.readings + 1
        if self.readings == 0:
            value = 0.0 if log_evidence == -math.inf else log_evidence
            return replace(self, fast_mean=value, slow_mean=value, readings=1, since_restart=1)
        value = max(log_evidence, self.slow_mean - self.floor)
        # While the slow mean is young it is a plain mean, so that it does not hang on the first reading.
        slow = max(self.slow, 1.0 / count)
        fast = max(self.fast, 1.0 / count)
        return replace(
            self,
            fast_mean=self.fast_mean + fast * (value - self.fast_mean),
            slow_mean=self.slow_mean + slow * (value - self.slow_mean),
            readings=count,
            since_restart=self.since_restart + 1,
        )

    @property
    def deficit(self) -> float:
        """Distance of the fast mean below the slow one, in nats per reading; 0 if it is above."""
        return max(0.0, self.slow_mean - self.fast_mean)

    @property
    def alarm(self) -> bool:
        """Return whether the belief has probably lost its place."""
        return self.since_restart > self.warm_up and self.deficit > self.threshold

    @property
    def fraction(self) -> float:
        """Share of the belief to give up: max(0, 1 - w_fast / w_slow) of table 8.3, in logarithms."""
        return -math.expm1(-self.deficit)

    def restarted(self) -> EvidenceMonitor:
        """Return a monitor that keeps what is normal for the evidence and is silent until warmed up again."""
        return replace(self, fast_mean=self.slow_mean, since_restart=0)


def inject(belief: ArrayLike, fraction: float, fresh: ArrayLike | None = None) -> FloatArray:
    """Mix the belief with a fresh one.

    Parameters
    ----------
    belief : array_like
        Any shape; is normalized.
    fraction : float
        Share of the fresh one, in [0, 1].
    fresh : array_like, optional
        Same shape; is normalized. Uniform if left out.

    Returns
    -------
    FloatArray
        Sums to 1.

    Raises
    ------
    ValueError
        If one of the beliefs is none, the shapes differ, or the fraction is not in [0, 1].
    """
    belief = belief_array(belief)
    belief = np.asarray(belief / belief.sum())
    if not 0.0 <= fraction <= 1.0:
        raise ValueError(f"a fraction is in [0, 1], not {fraction}")
    if fresh is None:
        return np.asarray((1.0 - fraction) * belief + fraction / belief.size)
    other = belief_array(fresh, what="fresh belief", shape=belief.shape)
    return np.asarray((1.0 - fraction) * belief + fraction * (other / other.sum()))
