"""Angles on the circle: wrapping, and the normal distribution wound round it. Radians."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray

TURN = 2.0 * math.pi


def wrap(angle: ArrayLike) -> FloatArray:
    """Bring angles to [-pi, pi]; either end may stand for half a turn."""
    angle = np.asarray(angle, dtype=float)
    return np.asarray(angle - TURN * np.rint(angle / TURN))


def wrapped_normal(angle: ArrayLike, sigma: float) -> FloatArray:
    """Give the density of a normal distribution of mean 0, wound round the circle.

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
