"""Cues about the robot's place from walls beside and ahead of it.

Labs are laid out in cells of 2 x 2 units. A wall between two cells is 0.2 thick, so its face is 0.9 from
the cell's centre; the border of the lab is a line, 1.0 from it. Nothing else is assumed: a reading that
fits neither is left alone.
"""

from __future__ import annotations

import math

from agent.drives.right.row_ekf import Explanation, Pose
from ciberrato.world.lab import CELL_SIZE

FACE = 0.9
"""Units from a cell's centre to the face of a wall between cells."""

BORDER = 1.0
"""Units from a cell's centre to the lab's border."""

_SENSOR_OFFSET = 0.5
_HALF_APERTURE = math.pi / 6.0
_ROUNDING_VARIANCE = 0.1**2 / 12.0
_MODEL_VARIANCE = 0.03**2
_PRIORS = ((FACE, 0.6), (BORDER, 0.2))
_LEAST_READING = 0.1  # less, or negative, is noise on top of nothing in sight
_NEAREST = 0.02  # units; nearer there is nothing but rounding
_CONE = math.radians(15.0)  # beyond, one of the outer rays is the shortest
_OPEN_READING = 0.6  # walls that do not face the sensor come to this in a corridor


def reading_variance(obstacle_noise: float) -> float:
    """Compute the variance of an IR reading around 1/distance.

    Parameters
    ----------
    obstacle_noise : float
        ObstacleNoise as announced.

    Returns
    -------
    float
        Noise, rounding and a little for what the walls are not.
    """
    return obstacle_noise**2 + _ROUNDING_VARIANCE + _MODEL_VARIANCE


def side_explanations(reading: float, side: int, pose: Pose, variance: float) -> list[Explanation]:
    """Explain a reading of a sensor that looks to the side by a wall along the row.

    Parameters
    ----------
    reading : float
    side : int
        1 = the sensor looks to the left, -1 = to the right.
    pose : Pose
        Pose of the robot at the reading.
    variance : float
        Variance of the reading.

    Returns
    -------
    list of Explanation
        In terms of the distance. Empty if there is no wall, or the robot stands too much across the row to
        tell.
    """
    if abs(pose.heading) > _CONE or reading < max(1.2, _OPEN_READING + 3.0 * math.sqrt(variance)):
        return []
    cosine = math.cos(pose.heading)
    measured = 1.0 / reading
    explanations = []
    for offset, prior in _PRIORS:
        distance = max((offset - side * pose.lateral) / cosine - _SENSOR_OFFSET, _NEAREST)
        # The difference of two reciprocals is that of the numbers, divided by both: so is its standard
        # deviation.
        deviation_squared = variance * (measured * distance) ** 2
        slope = (0.0, -side / cosine, 0.0)
        explanations.append(Explanation(prior, measured - distance, slope, deviation_squared))
    return explanations


def _beside(pose: Pose, deviations: tuple[float, float, float]) -> float:
    """Compute the greatest front reading of a wall along the row, which an outer ray of the cone meets."""
    angle = _HALF_APERTURE + abs(pose.heading) + deviations[2]
    free = max(FACE - abs(pose.lateral) - deviations[1], _SENSOR_OFFSET)
    return math.sin(angle) / free


def clutter(reading: float) -> float:
    """Compute the density, by distance, of a reading that no wall along or across the row explains.

    The ends of walls beyond the row's edge come to readings up to 2; nothing that is not in the way can be
    nearer.

    Parameters
    ----------
    reading : float

    Returns
    -------
    float
        Times the prior probability of that.
    """
    return 0.5 if reading < 2.3 else 0.002


class WallAhead:
    """Gathers evidence that a wall closes the cell in which the robot is, at its right side.

    The evidence is the logarithm of a likelihood ratio: a wall at the cell's edge, against none that the
    robot would have to stop for.
    """

    SURE = 3.0
    """Evidence that counts as certain (odds of 20 to 1)."""

    _MOST = 12.0

    def __init__(self, obstacle_noise: float) -> None:
        self._variance = reading_variance(obstacle_noise)
        self._cell = 0
        self._evidence = 0.0

    @property
    def cell(self) -> int:
        """Number of the cell that the evidence is about; the start cell is 0."""
        return self._cell

    @property
    def certain(self) -> bool:
        """Return whether there is a wall to stop for."""
        return self._evidence > self.SURE

    def observe(self, reading: float, pose: Pose, deviations: tuple[float, float, float]) -> None:
        """Process a reading of the front sensor.

        Parameters
        ----------
        reading : float
        pose : Pose
            Pose of the robot at the reading.
        deviations : (float, float, float)
            Its standard deviations.
        """
        cell = max(round(pose.along / CELL_SIZE), 0)
        if cell > self._cell:
            self._cell, self._evidence = cell, 0.0
        remaining = CELL_SIZE * self._cell - pose.along
        if abs(pose.heading) > _CONE or remaining > BORDER:
            return
        measured = 1.0 / max(reading, _LEAST_READING)
        misfits = []
        for face, _ in _PRIORS:
            distance = max(remaining + face - _SENSOR_OFFSET, _NEAREST)
            variance = self._variance * (measured * distance) ** 2 + deviations[0] ** 2
            # Nearer than the wall would be is as good a reason to stop as the wall itself.
            misfits.append(max(measured - distance, 0.0) ** 2 / variance)
        open_misfit = max(reading - _beside(pose, deviations), 0.0) ** 2 / self._variance
        gain = 0.5 * (open_misfit - min(misfits))
        self._evidence = min(max(self._evidence + min(max(gain, -4.0), 4.0), -self._MOST), self._MOST)
