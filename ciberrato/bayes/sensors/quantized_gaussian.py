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
from ciberrato.bayes.sensors.normal import log_interval


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantizedGaussian:
    """Independent Gaussian beams, each rounded to the nearest step.

    Attributes
    ----------
    sigma : float or array_like
        Standard deviation before rounding, 0 or more; broadcasts against the means. 0: rounding alone, so
        that a mean either explains a reading or does not.
    step : float
        What readings are multiples of; positive.
    outlier : float
        Probability that a beam reads something else altogether, in [0, 1).
    outlier_readings : int
        Number of different readings that an outlier is equally likely to give.
    """

    sigma: float | FloatArray
    step: float
    outlier: float = 0.0
    outlier_readings: int = 1

    def __post_init__(self) -> None:
        if not np.all(np.asarray(self.sigma) >= 0.0):
            raise ValueError("sigma must be 0 or more")
        if not self.step > 0.0:
            raise ValueError(f"the step must be positive, not {self.step}")
        if not 0.0 <= self.outlier < 1.0 or self.outlier_readings < 1:
            raise ValueError("outliers need a probability in [0, 1) and at least one reading")

    def beam_log_likelihood(self, reading: ArrayLike, mean: ArrayLike) -> FloatArray:
        """Give log P(reading | mean) per beam.

        Parameters
        ----------
        reading : array_like
            Multiples of the step; nan (missing) gives 0. Readings off the lattice by rounding error count as
            on it.
        mean : array_like
            Expected value before noise; broadcasts against the reading. nan makes the beam impossible.

        Returns
        -------
        FloatArray
            The broadcast shape. Accurate in relative terms down to log probabilities of -1e300.
        """
        reading, mean = np.asarray(reading, dtype=float), np.asarray(mean, dtype=float)
        multiple = np.round(reading / self.step)
        low = (multiple - 0.5) * self.step - mean
        high = (multiple + 0.5) * self.step - mean
        sigma = np.asarray(self.sigma, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            # 0 / 0 (the mean exactly on a rounding edge, no noise) is settled by the line after.
            result = log_interval(low / sigma, high / sigma)
        certain = np.where((low <= 0.0) & (high > 0.0), 0.0, -np.inf)
        result = np.where(sigma > 0.0, result, certain)
        result = np.where(np.isnan(mean), -np.inf, result)
        if self.outlier > 0.0:
            other = np.log(self.outlier / self.outlier_readings)
            result = np.logaddexp(np.log1p(-self.outlier) + result, other)
        return np.where(np.isnan(reading), 0.0, result)

    def log_likelihood(self, reading: ArrayLike, mean: ArrayLike) -> FloatArray:
        """Give log P(reading | cell), summed over the beams.

        Parameters
        ----------
        reading : array_like, shape (beams,)
            Multiples of the step; nan where missing.
        mean : array_like, shape (..., beams)
            Expected values per cell.

        Returns
        -------
        FloatArray, shape (...)
        """
        return np.asarray(self.beam_log_likelihood(reading, mean).sum(axis=-1))
