"""Pictures of a world as arrays: the lab drawn once, the robot upon it each time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import Lab

PIXELS = 20
"""A unit, in labs of up to `_MOST` pixels; less in larger ones."""
_MOST = 800
_MARGIN = 0.25
"""Units around the lab."""
# Colours of Okabe and Ito, which colour-blind people can distinguish.
_GROUND, _WALL, _LINE = (255, 255, 255), (60, 60, 60), (200, 200, 200)
_TARGET, _BEACON, _ROBOT, _NOSE = (0, 158, 115), (230, 159, 0), (0, 114, 178), (255, 255, 255)


class Picture:
    """Draws one lab and the robot in it, without any library.

    Parameters
    ----------
    lab : Lab
    """

    def __init__(self, lab: Lab) -> None:
        longest = max(lab.width, lab.height) + 2 * _MARGIN
        self._scale = min(float(PIXELS), _MOST / longest)
        width, height = (math.ceil((size + 2 * _MARGIN) * self._scale) for size in (lab.width, lab.height))
        self._x = (np.arange(width) + 0.5) / self._scale - _MARGIN
        self._y = ((np.arange(height) + 0.5) / self._scale - _MARGIN)[::-1]
        picture = self._lab = np.empty((height, width, 3), np.uint8)
        inside = self._between(self._x, lab.width) & self._between(self._y[:, np.newaxis], lab.height)
        picture[:] = np.where(inside[..., np.newaxis], _GROUND, _WALL)
        for target in lab.targets:
            picture[self._disc(target.x, target.y, target.radius)] = _TARGET
        for wall in lab.walls:
            picture[self._polygon(np.array(wall.corners))] = _WALL if wall.height > 0.0 else _LINE
        for beacon in lab.beacons:
            picture[self._disc(beacon.x, beacon.y, 0.2)] = _BEACON

    @staticmethod
    def _between(places: NDArray[np.floating], end: float) -> Booleans:
        return np.asarray((places >= 0.0) & (places <= end))

    def _disc(self, x: float, y: float, radius: float) -> Booleans:
        across, up = self._x - x, (self._y - y)[:, np.newaxis]
        return np.asarray(across * across + up * up <= radius * radius)

    def _polygon(self, corners: Floats) -> Booleans:
        """Return the pixels inside, by the even-odd rule."""
        inside = np.zeros((self._y.size, self._x.size), np.bool_)
        up = self._y[:, np.newaxis]
        for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if y0 != y1:
                crossing = x0 + (up - y0) * (x1 - x0) / (y1 - y0)
                inside ^= ((y0 > up) != (y1 > up)) & (self._x < crossing)
        return inside

    def draw(self, pose: Floats) -> NDArray[np.uint8]:
        """Draw the robot at a pose: x, y in units and heading in radians.

        Returns
        -------
        array of uint8, shape (height, width, 3)
        """
        x, y, heading = pose.tolist()
        picture = self._lab.copy()
        picture[self._disc(x, y, ROBOT_RADIUS)] = _ROBOT
        ahead = 0.6 * ROBOT_RADIUS
        picture[self._disc(x + ahead * math.cos(heading), y + ahead * math.sin(heading), 0.15)] = _NOSE
        return picture
