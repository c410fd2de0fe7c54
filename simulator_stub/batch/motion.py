"""Wheels and walls for many robots, each alone in its world, with numpy, to the last bit as for one."""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Floats


def cosines_and_sines(angles: Floats) -> tuple[Floats, Floats]:
    """Compute them as `math` does: numpy's may differ in the last bit.

    Parameters
    ----------
    angles : array
        Radians.

    Returns
    -------
    cosines, sines : array
        Cosines and sines of the same shape.
    """
    numbers = angles.ravel().tolist()
    cosines = np.fromiter(map(math.cos, numbers), np.float64, len(numbers))
    sines = np.fromiter(map(math.sin, numbers), np.float64, len(numbers))
    return cosines.reshape(angles.shape), sines.reshape(angles.shape)
