"""Angles on the circle: wrapping, and the normal distribution wound round it. Radians."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import positive

TURN = 2.0 * math.pi


def wrap(angle: ArrayLike) -> FloatArray:
    """Wrap angles to [-pi, pi]; half a turn may become either end."""
    angle = np.asarray(angle, dtype=float)
    return np.asarray(angle - TURN * np.rint(angle / TURN))


def wrapped_normal(angle: ArrayLike, sigma: float) -> FloatArray:
    """Return the density of a normal distribution of mean 0, wound round the circle.

    Parameters
    ----------
    angle : array_like
        Any shape, any number of turns.
    sigma : float
        Positive; may be many turns.

    Returns
    -------
    FloatArray
        Per radian; integrates to 1 over a turn. Right to 1e-14 of the greatest density.
    """
    if not sigma > 0.0:
        raise ValueError(f"sigma of a wrapped normal distribution must be positive, not {sigma}")
    angle = wrap(angle)
    if sigma > TURN / 2.0:
        # Wide: the Fourier series converges at once.
        result = np.full(angle.shape, 1.0 / TURN)
        order = 1
        while (size := math.exp(-0.5 * (order * sigma) ** 2)) > 1e-17:
            result += size / math.pi * np.cos(order * angle)
            order += 1
        return result
    scale = 1.0 / (sigma * math.sqrt(TURN))
    result = np.asarray(np.square(angle / sigma))
    result *= -0.5
    np.exp(result, out=result)
    turns = math.ceil((8.5 * sigma - math.pi) / TURN)
    for turn in range(1, turns + 1):
        for side in (-turn, turn):
            result += np.exp(-0.5 * np.square((angle + side * TURN) / sigma))
    result *= scale
    return result


def log_wrapped_normal(angle: ArrayLike, sigma: ArrayLike) -> FloatArray:
    """Compute the logarithm of `wrapped_normal`, right to 1e-13 however far out.

    Parameters
    ----------
    angle : array_like
        Any shape, any number of turns.
    sigma : array_like
        Positive; broadcasts against the angle.

    Returns
    -------
    FloatArray
        The broadcast shape.
    """
    positive(sigma, what="sigma of a wrapped normal distribution")
    angle, sigma = np.broadcast_arrays(wrap(angle), np.asarray(sigma, dtype=float))
    nearest = -0.5 * np.square(angle / sigma) - np.log(sigma * math.sqrt(TURN))
    # The other turns' densities, relative to the nearest one's.
    greatest = float(np.max(sigma, initial=0.0))
    others = np.zeros(angle.shape)
    if greatest <= TURN / 2.0:
        for turn in range(1, math.ceil((8.5 * greatest + math.pi) / TURN) + 1):
            for shift in (-turn * TURN, turn * TURN):
                others += np.exp(np.maximum(-0.5 * shift * (shift + 2.0 * angle) / np.square(sigma), -745.0))
        return np.asarray(nearest + np.log1p(others))
    wide = sigma > TURN / 2.0
    result = np.empty(angle.shape)
    result[~wide] = log_wrapped_normal(angle[~wide], sigma[~wide])
    # Wide: the Fourier series converges at once.
    series = np.zeros(int(np.count_nonzero(wide)))
    for order in range(1, 4):
        series += 2.0 * np.exp(-0.5 * np.square(order * sigma[wide])) * np.cos(order * angle[wide])
    result[wide] = np.log1p(series) - math.log(TURN)
    return result
