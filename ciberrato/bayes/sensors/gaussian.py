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
