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

from ciberrato.bayes.angles import TURN, log_wrapped_normal
from ciberrato.bayes.arraytypes import FloatArray, IntArray
from ciberrato.bayes.checks import finite_array, positive, range_array, same_length, whole_array
from ciberrato.bayes.sensors.normal import LOG_SQRT_TWO_PI, log_upper_tail
from ciberrato.reprs import short_repr

# Of the coordinates: within so much of a landmark the state is on it, and rounding would make up a bearing.
_ON_IT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkSensor:
    """Ranges, and bearings if the poses have headings, to landmarks that the sensor distinguishes.

    Attributes
    ----------
    landmarks : tuple of (x, y)
        Their places; readings name them by index.
    range_sigma : float
        In units of length.
    bearing_sigma : float
        Radians.
    max_range : float or None
        Longest range. Readings of at least this, +inf among them, have the probability that the range is
        longer: the Gaussian's upper tail. None: there is no longest range, and +inf is an error.
    """

    __repr__ = short_repr

    landmarks: tuple[tuple[float, float], ...]
    range_sigma: float
    bearing_sigma: float = math.radians(5.0)
    max_range: float | None = None

    def __post_init__(self) -> None:
        places = finite_array(self.landmarks, what="landmarks")
        if places.ndim != 2 or places.shape[1] != 2 or not len(places):
            raise ValueError(f"landmarks need x and y each, and one at least; their shape is {places.shape}")
        positive(self.range_sigma, what="range_sigma")
        positive(self.bearing_sigma, what="bearing_sigma")
        if self.max_range is not None:
            positive(self.max_range, what="max_range")

    def log_likelihood(
        self,
        poses: ArrayLike,
        which: ArrayLike,
        ranges: ArrayLike,
        bearings: ArrayLike | None = None,
        *,
        deg: bool = False,
    ) -> FloatArray:
        """Compute log p(readings | pose).

        Parameters
        ----------
        poses : array_like, shape (..., 2) or (..., 3)
            x, y and, for bearings, the heading.
        which : array_like of int, shape (n,)
            The landmark of each reading, counted from 0.
        ranges : array_like, shape (n,)
            In units of length; nan where missing, +inf where it is beyond `max_range`.
        bearings : array_like, shape (n,), optional
            Relative to the heading, radians; nan where missing. Where the pose is on the landmark there is no
            bearing to expect, and all are alike likely, 1 / (2 pi).
        deg : bool
            Bearings, and the headings of the poses, are given in degrees.

        Returns
        -------
        FloatArray, shape (...)

        Raises
        ------
        ValueError
            If there is no such landmark, a range is negative, or the shapes do not fit.
        """
        poses = finite_array(poses, what="poses")
        least = 2 if bearings is None else 3
        if not poses.ndim or not least <= poses.shape[-1] <= 3:
            raise ValueError(
                f"poses need x, y{', heading' * (least - 2)} in the last axis, not {poses.shape}"
            )
        which = np.atleast_1d(whole_array(which, what="landmarks' indices"))
        ranges = np.atleast_1d(range_array(ranges, what="range"))
        if which.size and not 0 <= which.min() <= which.max() < len(self.landmarks):
            wrong = which[(which < 0) | (which >= len(self.landmarks))][0]
            raise ValueError(f"no landmark {wrong}; the landmarks are 0 to {len(self.landmarks) - 1}")
        if len(which) != len(ranges):
            same_length(landmarks=which, ranges=ranges)
        if self.max_range is None and math.inf in ranges:
            raise ValueError(
                f"range {int(np.argmax(np.isposinf(ranges)))} is inf, nothing within range, but there is no "
                "longest range: set max_range, or make the range nan to leave it out"
            )
        longest = math.inf if self.max_range is None else self.max_range
        scale = math.pi / 180.0 if deg else 1.0
        total = np.zeros(poses.shape[:-1])
        if bearings is not None:
            bearings = np.atleast_1d(np.asarray(bearings, dtype=float)) * scale
            same_length(landmarks=which, bearings=bearings)
            if np.isinf(bearings).any():
                raise ValueError(f"bearing {int(np.argmax(np.isinf(bearings)))} is infinite; nan is none")
        for k, index in enumerate(which):
            x, y = self.landmarks[index]
            dx, dy = x - poses[..., 0], y - poses[..., 1]
            distance = np.hypot(dx, dy)
            if ranges[k] < longest:
                total -= 0.5 * np.square((ranges[k] - distance) / self.range_sigma)
                total -= math.log(self.range_sigma) + LOG_SQRT_TWO_PI
            elif not np.isnan(ranges[k]):
                total += log_upper_tail((longest - distance) / self.range_sigma)
            if bearings is not None and not np.isnan(bearings[k]):
                off = bearings[k] - (np.arctan2(dy, dx) - poses[..., 2] * scale)
                on_it = distance <= _ON_IT * (abs(x) + abs(y) + self.range_sigma)
                total += np.where(on_it, -math.log(TURN), log_wrapped_normal(off, self.bearing_sigma))
        return total


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderedRanges:
    """Ranges to the landmarks ahead on a line, without names, matched in order.

    Attributes
    ----------
    landmarks : tuple of float
        Places along the line.
    sigma : float
        Standard deviation of a range, in units of length.
    max_range : float
        Landmarks farther ahead are not seen.
    unread : float
        Probability that a landmark within range gives no reading, in [0, 1).
    unexpected : float
        Density of a reading, per unit of length, that belongs to no landmark; 0 or more.
    """

    __repr__ = short_repr

    landmarks: tuple[float, ...]
    sigma: float
    max_range: float
    unread: float = 0.0
    unexpected: float = 0.0

    def __post_init__(self) -> None:
        finite_array(self.landmarks, what="landmarks")
        positive(self.sigma, what="sigma")
        positive(self.max_range, what="max_range")
        if not 0.0 <= self.unread < 1.0 or not 0.0 <= self.unexpected < math.inf:
            raise ValueError("unread is a probability below 1, unexpected a density of 0 or more")

    def log_likelihood(self, ranges: ArrayLike, places: ArrayLike) -> FloatArray:
        """Compute log p(ranges | place).

        Parameters
        ----------
        ranges : array_like, shape (n,)
            In any order; may be empty, which is a reading too: nothing is within range. An entry of +inf says
            just that, and is left out. One of nan (no reading) may stand for any landmark's range, or for
            none: a landmark that it may stand for is not held to be unread.
        places : array_like, shape (cells,)
            Along the line.

        Returns
        -------
        FloatArray, shape (cells,)

        Raises
        ------
        ValueError
            If a range is negative, or the places are not finite numbers in one dimension.
        """
        seen = range_array(ranges, what="range").ravel()
        gaps = int(np.count_nonzero(np.isnan(seen)))
        seen = np.sort(seen[seen < np.inf])  # nan neither
        places = finite_array(places, what="places")
        if places.ndim != 1:
            raise ValueError(f"places along a line have one axis, not shape {places.shape}")
        ahead = np.sort(np.asarray(self.landmarks, dtype=float)) - places[:, np.newaxis]
        ahead = np.sort(np.where((ahead >= 0.0) & (ahead <= self.max_range), ahead, np.inf), axis=1)
        expected = np.isfinite(ahead).sum(axis=1)
        matched = np.minimum(expected, len(seen))
        with np.errstate(divide="ignore"):
            log_unread, log_unexpected = np.log(self.unread), np.log(self.unexpected)
        total = matched * (np.log1p(-self.unread) - math.log(self.sigma) - LOG_SQRT_TWO_PI)
        used = np.minimum(expected, len(seen) + gaps)
        if gaps:
            total += self._matched_with_gaps(seen, ahead, used, gaps)
        else:
            for k, reading in enumerate(seen[: ahead.shape[1]]):
                total -= np.where(k < matched, 0.5 * np.square((reading - ahead[:, k]) / self.sigma), 0.0)
        # 0 times log 0 is nothing to add.
        missing, extra = expected - used, len(seen) - matched
        total[missing > 0] += missing[missing > 0] * log_unread
        total[extra > 0] += extra[extra > 0] * log_unexpected
        return np.asarray(total)

    def _matched_with_gaps(
        self, seen: FloatArray, ahead: FloatArray, used: IntArray, gaps: int
    ) -> FloatArray:
        """Sum over all choices of the landmarks, up to `gaps`, of which the reading is missing.

        Parameters
        ----------
        seen : FloatArray, shape (n,)
            Ranges, rising.
        ahead : FloatArray, shape (cells, landmarks)
            Distances, rising; inf beyond the last.
        used : IntArray, shape (cells,)
            Landmarks to be matched or left out.
        gaps : int

        Returns
        -------
        FloatArray, shape (cells,)
            Logarithms, without the factor of the Gaussians.
        """
        # score[s]: the landmarks so far hold the nearest s ranges.
        score = np.full((len(seen) + 1, len(ahead)), -np.inf)
        score[0] = 0.0
        for k in range(min(ahead.shape[1], len(seen) + gaps)):
            after = np.full_like(score, -np.inf)
            after[1:] = score[:-1] - 0.5 * np.square((seen[:, np.newaxis] - ahead[:, k]) / self.sigma)
            for s in range(max(0, k - gaps + 1), min(k, len(seen)) + 1):
                after[s] = np.logaddexp(after[s], score[s])
            score = np.where(k < used, after, score)
        return np.asarray(score[np.minimum(used, len(seen)), np.arange(len(ahead))])
