r"""Learning a beam model's parameters from readings and the ranges that the map gives for them.

Expectation maximization as in Probabilistic Robotics, table 6.2 (learn_intrinsic_parameters): each reading is
shared among the four parts in proportion to their probabilities; then weights and sigma follow as weighted
means. The rate of short readings is the maximum for the truncated exponential: the book's ratio of sums is
that of an exponential without end, and comes out too large.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import map_array, range_array, whole
from ciberrato.bayes.sensors.beam import BeamModel
from ciberrato.reprs import short_repr


class Learned(NamedTuple):
    """Result of learning.

    Attributes
    ----------
    model : BeamModel
        Best parameters.
    log_likelihood : FloatArray, shape (iterations + 1,)
        Mean per reading before each iteration and after the last.
    """

    model: BeamModel
    log_likelihood: FloatArray

    def __repr__(self) -> str:
        return short_repr(self)


def learn_beam_model(
    reading: ArrayLike,
    expected: ArrayLike,
    start: BeamModel,
    *,
    iterations: int = 200,
    tolerance: float = 1e-9,
) -> Learned:
    """Fit weights, sigma and decay.

    Parameters
    ----------
    reading, expected : array_like, shape (n,)
        Ranges in units of length; pairs without a reading (nan) are left out.
    start : BeamModel
        First guess; its max_range and resolution are kept. A weight of 0 stays 0.
    iterations : int
        At most so many.
    tolerance : float
        Stop when the mean log likelihood grows by less.

    Returns
    -------
    Learned

    Raises
    ------
    ValueError
        If there is no reading, one that the first guess holds impossible, or ranges that are none.
    """
    iterations = whole(iterations, what="the number of iterations", least=0)
    z = np.minimum(range_array(reading).ravel(), start.max_range)
    range_ = np.minimum(range_array(map_array(expected), what="expected range").ravel(), start.max_range)
    if z.shape != range_.shape:
        raise ValueError(f"need as many expected ranges as readings: {range_.shape}, {z.shape}")
    z, range_ = z[~np.isnan(z)], range_[~np.isnan(z)]
    if not z.size:
        raise ValueError("there is no reading to learn from")
    model, history = start, []
    for _ in range(iterations + 1):
        parts = model.parts(z, range_)
        total = parts.sum(axis=0)
        if not (total > 0.0).all():
            raise ValueError("the first guess holds a reading impossible; give it some random weight")
        history.append(float(np.log(total).mean()))
        if len(history) > 1 and history[-1] - history[-2] < tolerance:
            break
        if len(history) <= iterations:
            model = _maximize(model, z, range_, parts / total)
    return Learned(model, np.array(history))


def _maximize(model: BeamModel, z: FloatArray, expected: FloatArray, shares: FloatArray) -> BeamModel:
    hit, short, longest, random = (float(v) for v in shares.mean(axis=1))
    scale = hit + short + longest + random
    sigma, decay = model.sigma, model.decay
    if hit > 0.0:
        # Never finer than what rounding to the resolution leaves, or a lucky few readings would have all of
        # the likelihood.
        spread = float(np.sqrt((shares[0] * np.square(z - expected)).sum() / shares[0].sum()))
        sigma = max(spread, model.resolution / np.sqrt(12.0))
    if short > 0.0:
        decay = _decay(shares[1], z, expected, model.decay)
    return replace(
        model,
        hit=hit / scale,
        short=short / scale,
        longest=longest / scale,
        random=random / scale,
        sigma=sigma,
        decay=decay,
    )


def _decay(share: FloatArray, z: FloatArray, expected: FloatArray, guess: float) -> float:
    """Solve for the rate at which the truncated exponentials have the mean that the readings have."""
    used = (share > 0.0) & (expected > 0.0)
    share, z, expected = share[used], z[used], expected[used]

    def excess(rate: float) -> float:
        mean = 1.0 / rate - expected / np.expm1(np.minimum(rate * expected, 700.0))
        return float((share * (mean - z)).sum())

    low, high = guess * 1e-3, guess * 1e3
    if excess(low) <= 0.0:
        return low  # rather more long readings than short ones: as flat as allowed
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return float(np.sqrt(low * high))
