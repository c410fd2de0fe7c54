"""Compare the readings of a recorded run with the lab: log evidence against what the model expects.

The filter runs on the exact model of `agent.offline.localizer` (`calibrated`), reading by reading. The
surprise of a reading is the negative natural logarithm of its probability given all before it; the model
itself says what surprise it expects and with which variance: the entropy of the prediction and that of its
logarithm. In the right lab the surprises less their expectations are all but martingale differences, and
their sum over the root of the variances has a mean of about 0 and a deviation of about 1, whatever lab and
noise. In a wrong one it is large.

A reading that the model all but excludes (the robot was farther off the centre than it should be) counts as
an outlier of small probability: one of them is no reason to doubt the lab.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agent.offline.localizer import LEAST_NOISE
from ciberrato.arrays import Floats
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.infrared.model import reading_log_likelihood

if TYPE_CHECKING:
    from agent.offline.expected_readings import ExpectedReadings

DOUBT, MOST_DOUBT = 4.5, 7.0
"""Deviations above the expected surprise at which the lab is called wrong: in short runs, and in long ones,
in which the errors of the pose last from cell to cell (`benchmarks.wrong_map`)."""
_OUTLIER = 0.02
_STRAY, _BESIDE = 0.1, 0.15
"""Probability that a robot is farther off the centre than its error at a crossing, as errors last from cell
to cell; and by how many units: a reading 1/distance is off by that times its square."""
_LEAST_VARIANCE = 0.25  # of the surprise of a reading
_LASTING = 0.9
"""Share of a pose error that is the same at the next crossing."""
_STEP = 0.1  # of the readings
_FINE = 0.01  # expected readings are distinguished to this
_BLOCKED = 0.01
"""Share of the belief that must have had its way open for the motion to be no surprise."""
_MOST = 9.0


class Fit(NamedTuple):
    """Fit of the readings.

    Attributes
    ----------
    score : float
        Deviations by which the surprise is above its expectation; 0 without readings.
    steps : int
    """

    score: float
    steps: int

    @property
    def is_doubtful(self) -> bool:
        """Return whether the lab is likely to be another one."""
        return self.score > min(max(DOUBT + 0.5 * (self.steps - 4), DOUBT), MOST_DOUBT)


def map_fit(
    readings: Sequence[Sequence[float | None]], expected: ExpectedReadings, obstacle_noise: float = 0.1
) -> Fit:
    """Compute how well the recorded steps fit the lab.

    Parameters
    ----------
    readings : sequence of shape (steps, sensors)
        As for `agent.offline.localizer.localize`.
    expected : ExpectedReadings
    obstacle_noise : float
        Standard deviation that the simulator announced, in 1/units.

    Returns
    -------
    Fit
    """
    noise = max(obstacle_noise, LEAST_NOISE)
    free = expected.free if expected.free.any() else np.ones(expected.free.shape, bool)
    prior = free / free.sum()
    motion = BlockedShift(openings=Openings(east=expected.east, north=expected.north), blocked="lose")
    fresh = expected.weights[:, np.newaxis, np.newaxis]
    errors = len(expected.weights)
    # Of cells and pose errors at the crossing; the robot begins in a centre, without any.
    weights = prior[np.newaxis]
    surprise, variance, count = 0.0, 0.0, 0
    for step, reading in enumerate(np.array(readings, dtype=float)):  # None becomes nan
        ideal = expected.readings[np.newaxis]
        if step > 0:
            moved = np.array([motion.predict(each, "east") for each in weights])
            open_share = float(moved.sum())
            if open_share < _BLOCKED:
                surprise += min(-math.log(max(open_share, 1e-9)), _MOST)
            moved = moved / open_share if open_share > 1e-9 else np.broadcast_to(prior / errors, moved.shape)
            weights = moved.sum(axis=0) * fresh
            if len(moved) == errors:
                weights = _LASTING * moved + (1.0 - _LASTING) * weights
            if expected.spread is not None:
                ideal = expected.spread
        for sensor, value in enumerate(reading):
            if math.isnan(value):
                continue
            told = _Prediction(ideal[..., sensor], weights, noise)
            surprise += -math.log(told.probability(value)) - told.entropy
            variance += told.variance
            count += 1
            weights = weights * told.likelihood(value)
            weights = weights / weights.sum()
    # The deviation of an exact reading may be all but 0; none is ever more certain than this.
    deviation = math.sqrt(variance + _LEAST_VARIANCE * count)
    return Fit(surprise / deviation if count else 0.0, len(readings))


class _Prediction:
    """Predicted distribution of a reading."""

    def __init__(self, ideal: Floats, weights: Floats, noise: float) -> None:
        levels, self._level = np.unique(np.round(ideal / _FINE).astype(np.int64), return_inverse=True)
        self._levels: Floats = np.asarray(levels * _FINE, np.float64)
        self._noise = noise
        self._level = self._level.reshape(ideal.shape)
        shares = np.bincount(self._level.ravel(), np.broadcast_to(weights, ideal.shape).ravel())
        used = shares > 1e-9
        lowest, highest = self._levels[used][[0, -1]]
        steps = np.arange(
            math.floor((lowest - 5.0 * noise) / _STEP) - 1, math.ceil((highest + 5.0 * noise) / _STEP) + 2
        )
        self._background = 1.0 / (len(steps) + 20)
        masses = self._masses(steps * _STEP, self._levels[used][:, np.newaxis])  # (levels, readings)
        predicted = (1.0 - _OUTLIER) * (shares[used] / shares[used].sum()) @ masses
        predicted += _OUTLIER * self._background
        predicted /= predicted.sum()
        self._shares = shares
        logs = np.log(predicted)
        self.entropy = -float(predicted @ logs)
        self.variance = max(float(predicted @ logs**2) - self.entropy**2, 0.0)

    def _masses(self, values: Floats | float, levels: Floats) -> Floats:
        """Return the probability of readings where the ideal ones are known, but for a stray of the robot."""
        beside = np.hypot(self._noise, _BESIDE * levels**2)
        exact = np.exp(reading_log_likelihood(values, levels, self._noise))
        wide = np.exp(reading_log_likelihood(values, levels, beside))
        return np.asarray((1.0 - _STRAY) * exact + _STRAY * wide)

    def likelihood(self, value: float) -> Floats:
        """Return the likelihood of every state; shape of the ideal readings."""
        exact = self._masses(value, self._levels)
        return np.asarray(((1.0 - _OUTLIER) * exact + _OUTLIER * self._background)[self._level])

    def probability(self, value: float) -> float:
        """Return the probability of a reading."""
        exact = self._masses(value, self._levels)
        share = float(self._shares @ exact) / float(self._shares.sum())
        return (1.0 - _OUTLIER) * share + _OUTLIER * self._background


def wrong_map(lab: str) -> str:
    """Return the message about readings that do not fit.

    Parameters
    ----------
    lab : str
        Name of the lab's file.
    """
    return (
        f"the readings do not fit {lab}: if the simulator runs another lab, what is said of cell and pose is "
        "worth nothing (-m gives the lab; other robots in view count against it, too)"
    )
