r"""A reading with Gaussian noise that is then rounded to a step: its exact probability.

.. math:: P(z | x) = \Phi\frac{z + q/2 - \mu(x)}{\sigma} - \Phi\frac{z - q/2 - \mu(x)}{\sigma}

for a sensor that reports `q floor(value / q + 1/2)`. For q much below sigma this is q times the Gaussian
density of Probabilistic Robotics, eq. 6.5; for q of the size of sigma or above, the density is wrong and this
is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import map_array, positive, range_array, whole
from ciberrato.bayes.sensors.normal import LOG_SQRT_TWO_PI, beyond_range, log_interval
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantizedGaussian:
    """Independent Gaussian beams, each rounded to the nearest step.

    Attributes
    ----------
    sigma : float or array_like
        Standard deviation before rounding, 0 or more; broadcasts against the means. 0: rounding alone, so
        that a mean either explains a reading or does not.
    step : float
        Step of which readings are multiples; positive.
    outlier : float
        Probability that a beam reads something else altogether, in [0, 1).
    outlier_readings : int
        Number of different readings that an outlier is equally likely to give.
    max_range : float or None
        Longest range. Readings of at least this, +inf among them, have the probability that the value before
        rounding is longer. None: there is no longest range, and +inf is an error.
    signed : bool
        Readings may be negative: they are no ranges.
    """

    __repr__ = short_repr

    sigma: float | FloatArray
    step: float
    outlier: float = 0.0
    outlier_readings: int = 1
    max_range: float | None = None
    signed: bool = False

    def __post_init__(self) -> None:
        sigma = np.asarray(self.sigma, dtype=float)
        if not ((sigma >= 0.0) & (sigma < np.inf)).all():
            raise ValueError(f"sigma must be 0 or more and finite, not {self.sigma}")
        positive(self.step, what="the step")
        if self.max_range is not None:
            positive(self.max_range, what="max_range")
        if not 0.0 <= self.outlier < 1.0:
            raise ValueError(f"the probability of an outlier is in [0, 1), not {self.outlier}")
        count = whole(self.outlier_readings, what="the number of readings of an outlier", least=1)
        object.__setattr__(self, "outlier_readings", count)

    def beam_log_likelihood(self, reading: ArrayLike, mean: ArrayLike) -> FloatArray:
        """Compute log P(reading | mean) per beam.

        Parameters
        ----------
        reading : array_like
            Multiples of the step; nan (missing) counts 0, +inf is nothing within `max_range`. Readings off
            the lattice by rounding error count as on it.
        mean : array_like
            Expected value before noise; broadcasts against the reading.

        Returns
        -------
        FloatArray
            The broadcast shape. Accurate in relative terms down to log probabilities of -1e300.

        Raises
        ------
        ValueError
            If a reading or a mean is negative (unless `signed`), a reading infinite (without `max_range`), or
            a mean nan.
        """
        reading, mean = range_array(reading, signed=self.signed), map_array(mean, signed=self.signed)
        known = np.where(np.isfinite(reading), reading, 0.0)
        sigma = np.asarray(self.sigma, dtype=float)
        # What overflows is infinitely far off: a log probability of -inf.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            multiple = np.round(known / self.step)
            counted = np.isfinite(multiple)
            middle = np.where(counted, multiple * self.step, known)
            low = np.where(counted, (multiple - 0.5) * self.step, known) - mean
            high = np.where(counted, (multiple + 0.5) * self.step, known) - mean
            # 0 / 0 (the mean exactly on a rounding edge, no noise) is settled by the line after.
            below, above = low / sigma, high / sigma
            result = log_interval(below, above)
            # So far off, or steps so fine, that both edges are the same number: the density times the step.
            density = -0.5 * np.square((middle - mean) / sigma) - LOG_SQRT_TWO_PI
            density += np.log(self.step) - np.log(sigma)
            result = np.where((below == above) & (sigma > 0.0), np.minimum(density, 0.0), result)
            # Both tails are 0: the leading term of the one at the nearer edge.
            nearer = -0.5 * np.square(np.minimum(np.abs(below), np.abs(above)))
            result = np.where(np.isnan(result) & (sigma > 0.0), nearer, result)
            result = np.where(np.isneginf(below) & np.isposinf(above), 0.0, result)
        certain = np.where((low <= 0.0) & (high > 0.0), 0.0, -np.inf)
        result = np.where(sigma > 0.0, result, certain)
        beyond_range(result, reading, mean, sigma, self.max_range)
        if self.outlier > 0.0:
            other = np.log(self.outlier / self.outlier_readings)
            result = np.logaddexp(np.log1p(-self.outlier) + result, other)
        return np.where(np.isnan(reading), 0.0, result)

    def log_likelihood(self, reading: ArrayLike, mean: ArrayLike) -> FloatArray:
        """Compute log P(reading | cell), summed over the beams.

        Parameters
        ----------
        reading : array_like, shape (beams,)
            Multiples of the step; nan where missing.
        mean : array_like, shape (..., beams)
            Expected values per cell.

        Returns
        -------
        FloatArray, shape (...)

        Raises
        ------
        ValueError
            As `beam_log_likelihood`, and if shapes do not fit.
        """
        mean = np.asarray(mean, dtype=float)
        reading = range_array(reading, beams=mean.shape[-1] if mean.ndim else 0, signed=self.signed)
        return np.asarray(self.beam_log_likelihood(reading, mean).sum(axis=-1))
