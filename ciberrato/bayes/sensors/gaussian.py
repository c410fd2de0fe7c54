r"""A reading with Gaussian noise, mean and sigma given per cell and beam.

.. math:: \log p(z | x) = \sum_b -\frac{(z_b - \mu_b(x))^2}{2 \sigma_b(x)^2} - \log(\sigma_b(x) \sqrt{2\pi})

Probabilistic Robotics, section 2.2 (eq. 2.3) and the `hit` part of the beam model (eq. 6.4, 6.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import finite_array, positive, range_array, refuse_map, refuse_negative_map
from ciberrato.bayes.sensors.normal import LOG_SQRT_TWO_PI, beyond_range
from ciberrato.reprs import short_repr


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
    max_range : float or None
        Longest range. Readings of at least this, +inf among them, have the probability that the range is
        longer: the Gaussian's upper tail. None: there is no longest range, and +inf is an error.
    signed : bool
        Readings, and those expected, may be negative: they are no ranges. Angles want `AngleSensor`.
    """

    __repr__ = short_repr

    sigma: float | FloatArray
    normalized: bool = True
    max_range: float | None = None
    signed: bool = False

    def __post_init__(self) -> None:
        positive(self.sigma, what="sigma")
        if self.max_range is not None:
            positive(self.max_range, what="max_range")

    def log_likelihood(self, reading: ArrayLike, mean: ArrayLike) -> FloatArray:
        """Compute log p(reading | cell), summed over the beams.

        Parameters
        ----------
        reading : array_like, shape (beams,)
            Missing beams are nan and say nothing; +inf is nothing within `max_range`.
        mean : array_like, shape (..., beams)
            Expected reading per cell; +inf where nothing is expected.

        Returns
        -------
        FloatArray, shape (...)

        Raises
        ------
        ValueError
            If shapes do not fit, a reading or a mean is negative (unless `signed`), a reading infinite
            (without `max_range`), or a mean nan.
        """
        mean = np.asarray(mean, dtype=float)
        if not self.signed:
            refuse_negative_map(mean)
        reading = range_array(reading, beams=mean.shape[-1] if mean.ndim else 0, signed=self.signed)
        longest = np.inf if self.max_range is None else self.max_range
        # Most scans are whole: no beam is missing, none beyond the longest range.
        whole = bool(reading.size) and bool(reading.max() < longest)
        # What overflows is infinitely far off: a log density of -inf.
        with np.errstate(over="ignore"):
            terms = (reading if whole else np.where(np.isfinite(reading), reading, 0.0)) - mean
            try:
                terms /= self.sigma
            except ValueError as error:
                raise ValueError(
                    f"sigma has shape {np.shape(self.sigma)}, which does not fit means {mean.shape}"
                ) from error
            np.square(terms, out=terms)
            terms *= -0.5
        if self.normalized:
            terms -= np.log(self.sigma) + LOG_SQRT_TWO_PI
        if not whole:
            terms[..., np.isnan(reading)] = 0.0
            beyond_range(terms, reading, mean, self.sigma, self.max_range)
        result = np.asarray(terms.sum(axis=-1))
        # nan in the map shows in the least of all sums, unless the beam is missing.
        if (result.size and math.isnan(result.min())) or (not whole and np.isnan(mean).any()):
            refuse_map(np.isnan(mean))
        return result

    def prepare(self, mean: ArrayLike) -> PreparedGaussian:
        """Precompute what does not depend on the reading, for many readings in one map.

        Parameters
        ----------
        mean : array_like, shape (..., beams)
            Expected reading per cell, finite; 0 or more unless the sensor is signed.

        Returns
        -------
        PreparedGaussian
        """
        return PreparedGaussian(self, mean)


_UNPREPARED = "use GaussianSensor.log_likelihood itself"


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
        Expected reading per cell, finite; 0 or more unless the sensor is signed.
    """

    def __init__(self, sensor: GaussianSensor, mean: ArrayLike) -> None:
        mean = finite_array(mean, what="the means of a prepared sensor")
        if not mean.ndim:
            raise ValueError("the means of a prepared sensor need an axis for the beams")
        if not sensor.signed:
            refuse_negative_map(mean)
        self._signed, self._longest = sensor.signed, sensor.max_range
        beams = mean.shape[-1]
        with np.errstate(all="ignore"):
            weight = np.broadcast_to(1.0 / np.square(sensor.sigma), mean.shape).reshape(-1, beams)
        if not ((weight > 0.0) & (weight < np.inf)).all():
            raise ValueError(f"sigma {sensor.sigma} has no square in doubles; {_UNPREPARED}")
        flat = mean.reshape(-1, beams)
        self._shape = mean.shape[:-1]
        same = bool((weight == weight[0]).all())
        # With one sigma the squares of the reading are the same for all cells.
        self._weight = weight[0].copy() if same else np.ascontiguousarray(weight)
        with np.errstate(over="ignore"):
            self._linear = np.ascontiguousarray(weight * flat)
            self._constant = -0.5 * (self._linear * flat).sum(axis=1)
        if not np.isfinite(self._constant).all():
            raise ValueError(f"the means over sigma have no squares in doubles; {_UNPREPARED}")
        if sensor.normalized:
            self._constant += 0.5 * np.log(weight).sum(axis=1) - beams * LOG_SQRT_TWO_PI

    def log_likelihood(self, reading: ArrayLike) -> FloatArray:
        """Compute log p(reading | cell), shape (...), for a reading of shape (beams,) with all beams.

        Missing beams (nan) and ranges beyond the longest are for `GaussianSensor.log_likelihood` itself.
        """
        reading = range_array(reading, beams=self._linear.shape[1], signed=self._signed)
        longest = np.inf if self._longest is None else self._longest
        if not reading.max() < longest:  # nan neither
            wrong = int(np.argmax(~(reading < longest)))
            raise ValueError(
                f"beam {wrong} reads {reading[wrong]}: a prepared sensor takes {len(reading)} finite beams "
                "below the longest range; use GaussianSensor.log_likelihood for this reading"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            result = self._linear @ reading
            result += self._constant
            result -= 0.5 * (self._weight @ np.square(reading))
        if result.size and not math.isfinite(result.sum()) and np.isnan(result).any():
            raise ValueError(f"the reading over sigma has no square in doubles; {_UNPREPARED}")
        return np.asarray(result.reshape(self._shape))
