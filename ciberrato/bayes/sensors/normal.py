"""The logarithm of the standard normal distribution's tails and intervals, without loss far out.

With numpy alone: `scipy.special` takes longer to import than a short run takes to localize.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import where

LOG_SQRT_TWO_PI = 0.9189385332046727

# exp(x^2) erfc(x) (1 + 2 x) for x >= 0 as a Chebyshev series in t = (x - 4) / (x + 4), fitted for this module
# against scipy's erfcx: relative error below 3e-15 everywhere.
_SCALED_ERFC = np.array(
    [
        1.1774832005374491,
        -0.007260796620301739,
        -0.08126512323618491,
        0.0600921280412224,
        -0.0287539355802767,
        0.010595663363472996,
        -0.003136927294554399,
        0.0007456494372538782,
        -0.00013696965030098564,
        1.7183861600535043e-05,
        -7.158364625460685e-07,
        -2.426139942464742e-07,
        5.576570932159247e-08,
        -2.1057866369969236e-09,
        -1.1717890782224771e-09,
        1.9098364875181167e-10,
        1.4088808356234346e-11,
        -6.901166355428181e-12,
        9.18785118726523e-14,
        2.1454867896791083e-13,
        -1.4727946400679274e-14,
        -6.645349474740344e-15,
        7.482463829904098e-16,
    ]
)


def log_upper_tail(x: ArrayLike) -> FloatArray:
    """Return log P(X > x) for a standard normal X, any shape.

    Relative error of the logarithm below 1e-14 for x >= 0, absolute error below 1e-15 for x < 0. -inf at
    +inf.
    """
    x = np.asarray(x, dtype=float)
    scaled = np.abs(x) / np.sqrt(2.0)
    finite = np.minimum(scaled, 1e150)
    ratio = chebyshev.chebval((finite - 4.0) / (finite + 4.0), _SCALED_ERFC) / (2.0 + 4.0 * finite)
    with np.errstate(over="ignore"):
        far = np.where(np.isinf(scaled), -np.inf, np.log(ratio) - np.square(scaled))
    # Below 0 the tail is one minus the tail on the other side.
    return np.where(x >= 0.0, far, np.log1p(-np.exp(np.maximum(far, -740.0))))


def log_interval(low: ArrayLike, high: ArrayLike) -> FloatArray:
    """Return log P(low <= X < high) for a standard normal X.

    Parameters
    ----------
    low, high : array_like
        Broadcast against each other; may be infinite. Where high <= low the result is -inf.

    Returns
    -------
    FloatArray
        Good to about 12 digits, however narrow the interval and however far out.
    """
    low, high = np.broadcast_arrays(np.asarray(low, dtype=float), np.asarray(high, dtype=float))
    # Mirror intervals so that the nearer end is the lower one and both tails are the small ones.
    mirror = low < -high
    near, far = np.where(mirror, -high, low), np.where(mirror, -low, high)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        log_near, log_far = log_upper_tail(near), log_upper_tail(far)
        by_tails = log_near + np.log1p(-np.exp(np.maximum(log_far - log_near, -745.0)))
        # An interval over which the density hardly changes: differences of tails would cancel, so integrate
        # the series of the density about the middle.
        middle, width = 0.5 * (near + far), far - near
        m2, w2 = np.square(middle), np.square(width)
        # Hermite polynomials of even order: the odd ones integrate to nothing.
        series = w2 / 24.0 * (m2 - 1.0) + w2 * w2 / 1920.0 * (m2 * m2 - 6.0 * m2 + 3.0)
        by_series = np.log(width) - 0.5 * m2 - LOG_SQRT_TWO_PI + np.log1p(series)
        narrow = width * (1.0 + np.abs(middle)) < 0.05
        result = np.where(narrow, by_series, by_tails)
    return np.where(high > low, result, -np.inf)


def beyond_range(
    terms: FloatArray, reading: FloatArray, mean: FloatArray, sigma: ArrayLike, max_range: float | None
) -> None:
    """Replace the terms of readings at the maximum range by log P(value >= max_range).

    Parameters
    ----------
    terms : FloatArray, shape (..., beams)
        Log likelihoods, to be written to.
    reading : FloatArray
        Broadcasts against the terms. Those of at least the longest range are meant, +inf among them.
    mean, sigma : array_like
        Of the value, before noise; broadcast against the terms. Where sigma is 0 the value is certain.
    max_range : float or None
        Longest range; None if there is none.

    Raises
    ------
    ValueError
        If a reading is infinite and there is no longest range.
    """
    beyond = np.isposinf(reading) if max_range is None else reading >= max_range
    if not beyond.any():
        return
    if max_range is None:
        raise ValueError(
            f"beam {where(beyond)} reads inf, nothing within range, but the sensor has no longest range: set "
            "max_range, or make the beam nan to leave it out"
        )
    beyond = np.broadcast_to(beyond, terms.shape)
    expected, spread = (
        np.broadcast_to(v, terms.shape)[beyond] for v in (mean, np.asarray(sigma, dtype=float))
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        tail = log_upper_tail((max_range - expected) / spread)
    terms[beyond] = np.where(spread > 0.0, tail, np.where(expected >= max_range, 0.0, -np.inf))
