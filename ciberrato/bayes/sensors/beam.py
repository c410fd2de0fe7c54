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
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import positive, range_array, refuse_map
from ciberrato.bayes.sensors.normal import log_interval
from ciberrato.reprs import short_repr

# Of so many expected ranges what depends on them alone is kept: a scan table asks for the same each time.
_FEW = 256


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
        Longest reading, z_max; readings of at least this, including +inf, count as this.
    resolution : float
        Step between readings, in units of length.
    unknown : {"raise", "uniform"}
        Meaning of an expected range of nan: an error in the map, or a beam that comes to a cell of which it
        is not known whether it is full (`OccupancyGrid.cast`). All readings are alike likely then, 1 / z_max,
        as section 6.4.3 has it for places that are not explored.
    """

    __repr__ = short_repr

    hit: float
    short: float
    longest: float
    random: float
    sigma: float
    decay: float
    max_range: float
    resolution: float = 0.01
    unknown: Literal["raise", "uniform"] = "raise"

    def __post_init__(self) -> None:
        weights = (self.hit, self.short, self.longest, self.random)
        if not (min(weights) >= 0.0 and abs(sum(weights) - 1.0) <= 1e-9):  # nan fails, too
            raise ValueError(f"beam weights must be 0 or more and sum to 1, not {weights}")
        for name in ("sigma", "decay", "max_range", "resolution"):
            positive(getattr(self, name), what=name)
        if self.unknown not in ("raise", "uniform"):
            raise ValueError(f"unknown cells raise or are uniform, not {self.unknown!r}")

    def parts(self, reading: ArrayLike, expected: ArrayLike) -> FloatArray:
        """Compute the probability of a reading by each part, weights included.

        Parameters
        ----------
        reading, expected : array_like
            Ranges 0 or more, broadcast against each other; an expected one may be nan where
            `unknown` is "uniform".

        Returns
        -------
        FloatArray, shape (4, ...)
            Hit, short, longest, random; their sum is the beam's likelihood. nan where the reading is.

        Raises
        ------
        ValueError
            If a range is negative, or an expected one nan where that is an error.
        """
        return np.stack(np.broadcast_arrays(*self._parts(reading, expected)))

    def _parts(self, reading: ArrayLike, expected: ArrayLike) -> list[FloatArray]:
        """Return what `parts` does, each no larger than what it depends on."""
        z: FloatArray = np.minimum(range_array(reading), self.max_range)
        ahead: FloatArray = np.minimum(range_array(expected, what="expected range"), self.max_range)
        unknown = np.isnan(ahead)
        if unknown.any():
            if self.unknown == "raise":
                refuse_map(unknown)
            ahead = np.where(unknown, self.max_range, ahead)
        # Below -700 the exponential would be a denormal number, far under the random part if there is one.
        hit = self._log_hit(z, ahead)
        np.maximum(hit, -700.0, out=hit)
        hit = self.hit * self.resolution * np.exp(hit)
        with np.errstate(divide="ignore", invalid="ignore"):
            short = self.decay * np.exp(-self.decay * z) / -np.expm1(-self.decay * ahead)
            short = np.where((z <= ahead) & (ahead > 0.0), self.short * self.resolution * short, 0.0)
        longest = np.where(z >= self.max_range, self.longest, 0.0)
        result = [hit, short, longest, np.array(self.random * self.resolution / self.max_range)]
        if unknown.any():
            result = [np.where(unknown, 0.0, part) for part in result[:3]] + [
                np.where(unknown, self.resolution / self.max_range, result[3])
            ]
        if (missing := np.isnan(z)).any():
            result = [np.where(missing, np.nan, part) for part in result]
        return result

    def beam_log_likelihood(self, reading: ArrayLike, expected: ArrayLike) -> FloatArray:
        """Compute log P(reading | expected) per beam, broadcast; -inf where no part explains the reading.

        0 where the reading is nan. Errors as of `parts`.
        """
        hit, *others = self._parts(reading, expected)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.random > 0.0 or self.hit == 0.0:
                result = np.log(hit + others[0] + others[1] + others[2])
            else:
                # Nothing else holds up a hit that is far off: its own logarithm does.
                z, ahead = (
                    np.minimum(np.asarray(v, dtype=float), self.max_range) for v in (reading, expected)
                )
                log_hit = math.log(self.hit * self.resolution) + self._log_hit(z, ahead)
                result = np.logaddexp(
                    np.where(np.isnan(log_hit), -np.inf, log_hit), np.log(others[0] + others[1] + others[2])
                )
        missing = np.isnan(reading)
        return np.where(missing, 0.0, result) if missing.any() else result

    def _log_hit(self, z: FloatArray, ahead: FloatArray) -> FloatArray:
        """Compute the logarithm of the Gaussian's density within [0, max_range]."""
        within = _log_within(self.sigma, self.max_range, ahead)
        log_hit = -0.5 * np.square((z - ahead) / self.sigma) - math.log(self.sigma * math.sqrt(2.0 * math.pi))
        return np.asarray(log_hit - within)

    def log_likelihood(self, reading: ArrayLike, expected: ArrayLike) -> FloatArray:
        """Compute log P(scan | cell), beams independent (table 6.1).

        Parameters
        ----------
        reading : array_like, shape (beams,)
            nan where missing, +inf where nothing is within range.
        expected : array_like, shape (..., beams)
            Ranges to the map from each cell.

        Returns
        -------
        FloatArray, shape (...)

        Raises
        ------
        ValueError
            If shapes do not fit, a range is negative, or an expected one nan where that is an error.
        """
        expected = np.asarray(expected, dtype=float)
        reading = range_array(reading, beams=expected.shape[-1] if expected.ndim else 0)
        present = ~np.isnan(reading)
        return np.asarray(self.beam_log_likelihood(reading[present], expected[..., present]).sum(axis=-1))

    def sample(self, expected: ArrayLike, rng: np.random.Generator) -> FloatArray:
        """Draw a reading for each expected range, not rounded."""
        ranges: FloatArray = np.minimum(range_array(expected, what="expected range"), self.max_range)
        if np.isnan(ranges).any():
            refuse_map(np.isnan(ranges))
        part = rng.choice(4, size=ranges.shape, p=[self.hit, self.short, self.longest, self.random])
        hit = ranges + self.sigma * rng.standard_normal(ranges.shape)
        while (outside := (hit < 0.0) | (hit > self.max_range)).any():
            hit[outside] = ranges[outside] + self.sigma * rng.standard_normal(int(outside.sum()))
        chance = rng.random(ranges.shape)
        short = -np.log1p(chance * np.expm1(-self.decay * ranges)) / self.decay
        anywhere = self.max_range * rng.random(ranges.shape)
        return np.choose(part, [hit, short, np.full(ranges.shape, self.max_range), anywhere])


def _log_within(sigma: float, max_range: float, ahead: FloatArray) -> FloatArray:
    """Return the logarithm of the mass of a Gaussian about each range within [0, max_range]."""
    if ahead.size <= _FEW:
        return np.frombuffer(_log_within_few(sigma, max_range, ahead.tobytes())).reshape(ahead.shape)
    return log_interval(-ahead / sigma, (max_range - ahead) / sigma)


@lru_cache(maxsize=8)
def _log_within_few(sigma: float, max_range: float, ranges: bytes) -> bytes:
    ahead: FloatArray = np.frombuffer(ranges)
    return log_interval(-ahead / sigma, (max_range - ahead) / sigma).tobytes()
