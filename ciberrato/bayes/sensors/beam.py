r"""A range beam: hit, short, max and random, mixed.

.. math::
   P(z | z^*) = \Delta \left( w_{hit} \frac{N(z; z^*, \sigma^2)}{\eta} + w_{short} \frac{\lambda e^{-\lambda
   z}}{1 - e^{-\lambda z^*}} [z \le z^*]
     + \frac{w_{rand}}{z_{max}} \right) + w_{max} [z \ge z_{max}]

with :math:`z^*` the range to the map and :math:`\eta` the Gaussian's mass within [0, z_max]. A reading at
z_max has a probability of its own, others a density; the sensor's resolution :math:`\Delta` makes them
comparable. Probabilistic Robotics, section 6.3, eq. 6.4 to 6.12, table 6.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.sensors.normal import log_interval


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamModel:
    """Parameters of one kind of beam.

    Attributes
    ----------
    hit, short, longest, random : float
        Weights of the four parts (`longest`: readings of z_max whatever the map), 0 or more, summing to 1.
    sigma : float
        Standard deviation of a hit, in units of length.
    decay : float
        Rate of short readings, per unit of length.
    max_range : float
        Longest reading, z_max; readings of at least this are taken for it.
    resolution : float
        Step between readings, in units of length.
    """

    hit: float
    short: float
    longest: float
    random: float
    sigma: float
    decay: float
    max_range: float
    resolution: float = 0.01

    def __post_init__(self) -> None:
        weights = (self.hit, self.short, self.longest, self.random)
        if min(weights) < 0.0 or abs(sum(weights) - 1.0) > 1e-9:
            raise ValueError(f"beam weights must be 0 or more and sum to 1, not {weights}")
        for name in ("sigma", "decay", "max_range", "resolution"):
            if not (getattr(self, name) > 0.0 and math.isfinite(getattr(self, name))):
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")

    def parts(self, reading: ArrayLike, expected: ArrayLike) -> FloatArray:
        """Give the probability of a reading by each part, weights included.

        Parameters
        ----------
        reading, expected : array_like
            Ranges 0 or more, broadcast against each other.

        Returns
        -------
        FloatArray, shape (4, ...)
            Hit, short, longest, random; their sum is the beam's likelihood.
        """
        z: FloatArray = np.minimum(np.asarray(reading, dtype=float), self.max_range)
        ahead: FloatArray = np.minimum(np.asarray(expected, dtype=float), self.max_range)
        z, ahead = np.broadcast_arrays(z, ahead)
        result = np.empty((4, *z.shape))
        within = log_interval(-ahead / self.sigma, (self.max_range - ahead) / self.sigma)
        log_hit = -0.5 * np.square((z - ahead) / self.sigma) - math.log(self.sigma * math.sqrt(2.0 * math.pi))
        # Below -700 the exponential would be a denormal number, a thousand orders of magnitude under the
        # random part.
        result[0] = self.hit * self.resolution * np.exp(np.maximum(log_hit - within, -700.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            density = self.decay * np.exp(-self.decay * z) / -np.expm1(-self.decay * ahead)
        result[1] = np.where((z <= ahead) & (ahead > 0.0), self.short * self.resolution * density, 0.0)
        result[2] = np.where(z >= self.max_range, self.longest, 0.0)
        result[3] = self.random * self.resolution / self.max_range
        return result

    def beam_log_likelihood(self, reading: ArrayLike, expected: ArrayLike) -> FloatArray:
        """Give log P(reading | expected) per beam, broadcast; -inf where no part explains the reading."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.parts(reading, expected).sum(axis=0)))

    def log_likelihood(self, reading: ArrayLike, expected: ArrayLike) -> FloatArray:
        """Give log P(scan | cell), beams independent (table 6.1).

        Parameters
        ----------
        reading : array_like, shape (beams,)
            nan where missing.
        expected : array_like, shape (..., beams)
            Ranges to the map from each cell.

        Returns
        -------
        FloatArray, shape (...)
        """
        reading = np.asarray(reading, dtype=float)
        present = ~np.isnan(reading)
        expected = np.asarray(expected, dtype=float)[..., present]
        return np.asarray(self.beam_log_likelihood(reading[present], expected).sum(axis=-1))

    def sample(self, expected: ArrayLike, rng: np.random.Generator) -> FloatArray:
        """Draw a reading for each expected range, not rounded."""
        ranges: FloatArray = np.minimum(np.asarray(expected, dtype=float), self.max_range)
        part = rng.choice(4, size=ranges.shape, p=[self.hit, self.short, self.longest, self.random])
        hit = ranges + self.sigma * rng.standard_normal(ranges.shape)
        while (outside := (hit < 0.0) | (hit > self.max_range)).any():
            hit[outside] = ranges[outside] + self.sigma * rng.standard_normal(int(outside.sum()))
        chance = rng.random(ranges.shape)
        short = -np.log1p(chance * np.expm1(-self.decay * ranges)) / self.decay
        anywhere = self.max_range * rng.random(ranges.shape)
        return np.choose(part, [hit, short, np.full(ranges.shape, self.max_range), anywhere])
