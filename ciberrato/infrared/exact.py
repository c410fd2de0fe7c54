"""IR distances to the last bit of the real simulator, where a reading hangs on it.

A reading is rounded to 0.1. Where one over the distance lies half way between two such values, the last bit
of the distance decides, and only the arithmetic of the real simulator gives that
(`ciberrato.infrared.on_face`). The fast paths give the distance within rounding; noise, where there is any,
makes the difference meaningless.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.geometry.angles import wrap_once
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.on_face import distance_by_angles

CLOSE = 1e-9
"""A reading nearer to a tie than this, in tenths, hangs on rounding errors."""


def exact_distance(walls: WallMap, x: float, y: float, direction: float, offset: float) -> float:
    """Compute the distance that a sensor measures, by the arithmetic of the real simulator; slow.

    Parameters
    ----------
    walls : WallMap
    x, y : float
        Centre of the robot, in units.
    direction : float
        Axis of the sensor in the lab's frame in radians: heading plus mounting angle, not wrapped.
    offset : float
        Units from the centre to the sensor.

    Returns
    -------
    float
        Units from the sensor; infinite where no wall is seen.
    """
    place = x + offset * math.cos(direction), y + offset * math.sin(direction)
    return distance_by_angles(walls.nearby, *place, wrap_once(direction))


def hangs_on_rounding(distance: float) -> bool:
    """Return whether a distance reads as another value if it is a little greater or smaller."""
    tenths = 10.0 / distance if distance > 0.0 else 0.0
    return abs(tenths - math.floor(tenths) - 0.5) < CLOSE


def hang_on_rounding(distances: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find them among many; shapes are those of `distances`."""
    tenths = np.divide(10.0, distances, out=np.zeros(distances.shape), where=distances > 0.0)
    return np.asarray(np.abs(tenths - np.floor(tenths) - 0.5) < CLOSE)
