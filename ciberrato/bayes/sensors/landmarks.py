r"""Ranges and bearings to landmarks at known places.

With known correspondence (Probabilistic Robotics, table 6.4)

.. math:: \log p(r, \phi | x) = \sum_i \log N(r_i - |m_i - x|; \sigma_r^2)
   + \log W(\phi_i - b(m_i, x); \sigma_\phi^2),

b being the bearing; and, along a line, ranges to the landmarks ahead matched in order, nearest with nearest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import wrapped_normal
from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.sensors.normal import LOG_SQRT_TWO_PI


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkSensor:
    """Ranges, and bearings if the poses have headings, to landmarks that the sensor tells apart.

    Attributes
    ----------
    landmarks : tuple of (x, y)
        Their places; readings name them by index.
    range_sigma : float
        In units of length.
    bearing_sigma : float
        Radians.
    """

    landmarks: tuple[tuple[float, float], ...]
    range_sigma: float
    bearing_sigma: float = math.radians(5.0)

    def __post_init__(self) -> None:
        if not self.landmarks or not (self.range_sigma > 0.0 and self.bearing_sigma > 0.0):
            raise ValueError("need at least one landmark and positive sigmas")

    def log_likelihood(
        self, poses: ArrayLike, which: ArrayLike, ranges: ArrayLike, bearings: ArrayLike | None = None
    ) -> FloatArray:
        """Give log p(readings | pose).

        Parameters
        ----------
        poses : array_like, shape (..., 2) or (..., 3)
            x, y and, for bearings, the heading.
        which : array_like of int, shape (n,)
            The landmark of each reading.
        ranges : array_like, shape (n,)
            In units of length.
        bearings : array_like, shape (n,), optional
            Relative to the heading, radians.

        Returns
        -------
        FloatArray, shape (...)
        """
        poses = np.asarray(poses, dtype=float)
        total = np.zeros(poses.shape[:-1])
        ranges = np.asarray(ranges, dtype=float)
        for k, index in enumerate(np.asarray(which)):
            dx = self.landmarks[index][0] - poses[..., 0]
            dy = self.landmarks[index][1] - poses[..., 1]
            total -= 0.5 * np.square((ranges[k] - np.hypot(dx, dy)) / self.range_sigma)
            total -= math.log(self.range_sigma) + LOG_SQRT_TWO_PI
            if bearings is not None:
                off = np.asarray(bearings, dtype=float)[k] - (np.arctan2(dy, dx) - poses[..., 2])
                total += np.log(np.maximum(wrapped_normal(off, self.bearing_sigma), 1e-300))
        return total


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderedRanges:
    """Ranges to the landmarks ahead on a line, without names, matched in order.

    Attributes
    ----------
    landmarks : tuple of float
        Places along the line.
    sigma : float
        Of a range, in units of length.
    max_range : float
        Landmarks farther ahead are not seen.
    unread : float
        Probability that a landmark within range gives no reading, in [0, 1).
    unexpected : float
        Density of a reading, per unit of length, that belongs to no landmark; 0 or more.
    """

    landmarks: tuple[float, ...]
    sigma: float
    max_range: float
    unread: float = 0.0
    unexpected: float = 0.0

    def __post_init__(self) -> None:
        if not (self.sigma > 0.0 and self.max_range > 0.0):
            raise ValueError("sigma and the longest range must be positive")
        if not 0.0 <= self.unread < 1.0 or not self.unexpected >= 0.0:
            raise ValueError("unread is a probability below 1, unexpected a density of 0 or more")

    def log_likelihood(self, ranges: ArrayLike, places: ArrayLike) -> FloatArray:
        """Give log p(ranges | place).

        Parameters
        ----------
        ranges : array_like, shape (n,)
            In any order; may be empty, which is a reading too.
        places : array_like, shape (cells,)
            Along the line.

        Returns
        -------
        FloatArray, shape (cells,)
        """
        seen = np.sort(np.asarray(ranges, dtype=float))
        places = np.asarray(places, dtype=float)
        ahead = np.sort(np.asarray(self.landmarks, dtype=float)) - places[:, np.newaxis]
        ahead = np.sort(np.where((ahead >= 0.0) & (ahead <= self.max_range), ahead, np.inf), axis=1)
        expected = np.isfinite(ahead).sum(axis=1)
        matched = np.minimum(expected, len(seen))
        with np.errstate(divide="ignore"):
            log_unread, log_unexpected = np.log(self.unread), np.log(self.unexpected)
        total = matched * (np.log1p(-self.unread) - math.log(self.sigma) - LOG_SQRT_TWO_PI)
        for k, reading in enumerate(seen[: ahead.shape[1]]):
            total -= np.where(k < matched, 0.5 * np.square((reading - ahead[:, k]) / self.sigma), 0.0)
        # 0 times log 0 is nothing to add.
        missing, extra = expected - matched, len(seen) - matched
        total[missing > 0] += missing[missing > 0] * log_unread
        total[extra > 0] += extra[extra > 0] * log_unexpected
        return np.asarray(total)
