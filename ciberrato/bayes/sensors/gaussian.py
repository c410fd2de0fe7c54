r"""A reading with Gaussian noise, mean and sigma given per cell and beam.

.. math:: \log p(z | x) = \sum_b -\frac{(z_b - \mu_b(x))^2}{2 \sigma_b(x)^2} - \log(\sigma_b(x) \sqrt{2\pi})

Probabilistic Robotics, section 2.2 (eq. 2.3) and the `hit` part of the beam model (eq. 6.4, 6.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.sensors.normal import LOG_SQRT_TWO_PI


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussianSensor:
    """Independent Gaussian beams.

    Attributes
    ----------
    sigma : float or array_like
        Standard deviation, positive; broadcasts against the readings' means, so it may depend on cell and
        beam.
    normalized : bool
        Whether to include the density's factor 1 / (sigma sqrt(2 pi)). It matters where sigma differs between
        cells, and for the evidence; without it the greatest log likelihood is 0.
    """

    sigma: float | FloatArray
    normalized: bool = True

    def __post_init__(self) -> None:
        if not np.all(np.asarray(self.sigma) > 0.0):
            raise ValueError("sigma must be positive")

    def log_likelihood(self, reading: ArrayLike, mean: ArrayLike) -> FloatArray:
        """Give log p(reading | cell), summed over the beams.

        Parameters
        ----------
        reading : array_like, shape (beams,)
            Missing beams are nan and say nothing.
        mean : array_like, shape (..., beams)
            Expected reading per cell; nan (a cell where no reading can be taken) makes the cell impossible.

        Returns
        -------
        FloatArray, shape (...)
        """
        reading, mean = np.asarray(reading, dtype=float), np.asarray(mean, dtype=float)
        terms = np.square((reading - mean) / self.sigma)
        terms *= -0.5
        if self.normalized:
            terms -= np.log(self.sigma) + LOG_SQRT_TWO_PI
        missing = np.isnan(reading)
        if np.isnan(mean).any():
            terms[np.isnan(mean) & ~missing] = -np.inf
        if missing.any():
            terms[..., missing] = 0.0
        return np.asarray(terms.sum(axis=-1))

    def prepare(self, mean: ArrayLike) -> PreparedGaussian:
        """Work out what does not depend on the reading, for many readings in one map.

        Parameters
        ----------
        mean : array_like, shape (..., beams)
            Expected reading per cell, finite.

        Returns
        -------
        PreparedGaussian
        """
        return PreparedGaussian(self, mean)


class PreparedGaussian:
    r"""A Gaussian sensor in one map: a reading costs a matrix product, or two if sigma differs between cells.

    .. math:: \sum_b \frac{(z_b - \mu_b)^2}{\sigma_b^2}
       = \sum_b \frac{z_b^2}{\sigma_b^2} - 2 \sum_b \frac{\mu_b}{\sigma_b^2} z_b + \sum_b
       \frac{\mu_b^2}{\sigma_b^2}

    The difference of large sums costs about log10(mean squared reading over sigma) digits of 16.

    Parameters
    ----------
    sensor : GaussianSensor
        Its sigma.
    mean : array_like, shape (..., beams)
        Expected reading per cell, finite.
    """

    def __init__(self, sensor: GaussianSensor, mean: ArrayLike) -> None:
        mean = np.asarray(mean, dtype=float)
        if not np.isfinite(mean).all():
            raise ValueError(
                "a prepared sensor needs finite means; leave impossible cells out of the belief instead"
            )
        beams = mean.shape[-1]
        weight = np.broadcast_to(1.0 / np.square(sensor.sigma), mean.shape).reshape(-1, beams)
        flat = mean.reshape(-1, beams)
        self._shape = mean.shape[:-1]
        same = bool((weight == weight[0]).all())
        # With one sigma the squares of the reading are the same for all cells.
        self._weight = weight[0].copy() if same else np.ascontiguousarray(weight)
        self._linear = np.ascontiguousarray(weight * flat)
        self._constant = -0.5 * (self._linear * flat).sum(axis=1)
        if sensor.normalized:
            self._constant += 0.5 * np.log(weight).sum(axis=1) - beams * LOG_SQRT_TWO_PI

    def log_likelihood(self, reading: ArrayLike) -> FloatArray:
        """Give log p(reading | cell), shape (...), for a reading of shape (beams,) without missing beams."""
        reading = np.asarray(reading, dtype=float)
        if reading.shape != self._linear.shape[1:] or not np.isfinite(reading).all():
            raise ValueError(
                f"a prepared sensor takes {self._linear.shape[1]} finite beams, not shape {reading.shape}"
            )
        result = self._linear @ reading
        result += self._constant
        result -= 0.5 * (self._weight @ np.square(reading))
        return np.asarray(result.reshape(self._shape))
