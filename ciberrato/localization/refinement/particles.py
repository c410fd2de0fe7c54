"""Particles around a pose that the lattice has found: the estimate, finer than any square.

The belief on the lattice is to be trusted about *which* place it is, and its readings are tempered for
that. Within its squares it knows little. Monte Carlo localization (Thrun, Burgard, Fox, *Probabilistic
Robotics*, table 8.2), begun where the belief has its mass, has the opposite gifts: over a whole lab it
loses the true place among its copies, around one pose it is exact, with expected readings computed where
each particle is. As many particles are kept as the spread of the cloud asks for (KLD-sampling, table 8.4).

Particles are points, and the nearest one may be a little off where a reading changes fast. So the
deviation of a reading is widened by what it changes over the distance between particles, and resampled
particles are moved by as much.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.face_tables import tables_of, touching
from ciberrato.infrared.model import CONTACT, SATURATION, SENSOR_OFFSET, reading_log_likelihood
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.records import FilterStep, Motion
from ciberrato.localization.refinement.cones import cone_distances
from ciberrato.world.coordinates import Pose
from ciberrato.world.parameters import Parameters

_FIRST = 600
_LEAST, _MOST = 150, 600
_SPACING = 0.02
_SPACING_TURN = math.radians(1.0)
_STEP = 0.01
_STEP_TURN = math.radians(0.4)
_FLOOR = 0.002  # units and radians of a cycle in motion, besides the motors' noise
_FLOOR_TURN = math.radians(0.1)
_OUTLIER = 0.02
_ROUNDING = 0.1
_EXPONENT = 1.25
"""Exponent of a reading, as a multiple of the one on the fine lattice, at most 0.5 there."""
_CONTRADICTED = 0.1
_ERROR, _QUANTILE = 0.1, 2.33
"""Of KLD-sampling: the error in nats that is kept to with a probability of 99 %."""
_BIN, _BIN_TURN = 0.1, math.radians(5.0)


class ParticleCloud:
    """A robot's pose, followed by particles.

    Parameters
    ----------
    walls : WallMap
    angles : tuple of float
        Mounting angles of the IR sensors in radians.
    parameters : Parameters
        As announced.
    generator : numpy.random.Generator
    """

    def __init__(
        self,
        walls: WallMap,
        angles: tuple[float, ...],
        parameters: Parameters,
        generator: np.random.Generator,
    ) -> None:
        self._tables = tables_of(walls)
        self._angles = np.array(angles)
        self._parameters = parameters
        self._generator = generator
        self._pose = np.zeros((3, 0))
        self._wheels = np.zeros((2, 0))  # what noise has left in the motors' filters: left, right
        self._weight = np.zeros(0)
        self._log_weight = np.zeros(0)

    @property
    def size(self) -> int:
        """Number of particles; 0 while nothing is followed."""
        return len(self._weight)

    def clear(self) -> None:
        """Follow nothing any more."""
        self._pose, self._wheels, self._weight = np.zeros((3, 0)), np.zeros((2, 0)), np.zeros(0)

    def begin(self, belief: PoseBelief, centre: Pose, reach: Pose) -> None:
        """Initialize with the part of a belief around a pose.

        Parameters
        ----------
        belief : PoseBelief
            A list of states.
        centre : (float, float, float)
            Units and radians.
        reach : (float, float, float)
            Distance from it within which poses count, along each axis.
        """
        bins, squares, weights = belief.listed()
        lattice = belief.lattice
        poses = np.stack([*belief.places(bins, squares), belief.headings()[bins]])
        away = poses - np.array(centre)[:, np.newaxis]
        away[2] = np.remainder(away[2] + math.pi, 2.0 * math.pi) - math.pi
        inside = (np.abs(away) <= np.array(reach)[:, np.newaxis]).all(axis=0)
        if not inside.any():
            self.clear()
            return
        chosen = self._systematic(weights * inside, _FIRST)
        width = np.array([[lattice.resolution], [lattice.resolution], [belief.bin_width]])
        self._pose = poses[:, chosen] + self._generator.uniform(-0.5, 0.5, (3, _FIRST)) * width
        self._wheels = np.zeros((2, _FIRST))
        self._weight = np.full(_FIRST, 1.0 / _FIRST)

    def mean(self) -> tuple[Pose, Pose]:
        """Return the mean pose and its standard deviations, in units and radians."""
        x, y, heading = self._pose
        first = float(heading[int(self._weight.argmax())])
        turned = np.remainder(heading - first + math.pi, 2.0 * math.pi) - math.pi
        columns = np.stack([x, y, turned])
        middle = columns @ self._weight
        deviation = np.sqrt(((columns - middle[:, np.newaxis]) ** 2) @ self._weight)
        return (
            (float(middle[0]), float(middle[1]), float(middle[2]) + first),
            (float(deviation[0]), float(deviation[1]), float(deviation[2])),
        )

    def follow(self, step: FilterStep, share: float) -> None:
        """Update with a step.

        Parameters
        ----------
        step : FilterStep
        share : float
            The step's exponent as a part of the greatest on its lattice.
        """
        self._log_weight = np.zeros(self.size)
        for motion in step.motions:
            self._move(motion)
        if share > 0.0:
            self._log_weight += share * 0.5 * self._log_likelihood(step.infrared, step.compass)
        if not self._log_weight.any():
            return
        weight = self._weight * np.exp(self._log_weight - self._log_weight.max())
        total = float(weight.sum())
        if not total > 0.0:
            self.clear()
            return
        self._weight = weight / total
        if float((self._weight**2).sum()) * self.size > 2.0:  # the effective number is below half
            self._resample()

    def _move(self, motion: Motion) -> None:
        left, right, collision = motion
        noise = self._parameters.motors_noise / 100.0 * self._generator.standard_normal(self._wheels.shape)
        nominal = np.array([[left], [right]])
        # What noise added in the cycle before is halved by the motors' filter, as all their power is.
        self._wheels = (nominal + self._wheels / 2.0) * (1.0 + noise) - nominal
        powers = nominal + self._wheels
        moving = min((abs(left) + abs(right)) / 0.2, 1.0)
        x, y, heading = self._pose
        way = (powers[0] + powers[1]) / 2.0
        floor = _FLOOR * moving * self._generator.standard_normal((2, self.size))
        new_x, new_y = x + way * np.cos(heading) + floor[0], y + way * np.sin(heading) + floor[1]
        touches = touching(self._tables, new_x, new_y)
        if collision is not None:
            self._log_weight[touches != collision] += math.log(_CONTRADICTED)
        if collision or (collision is None and touches.any()):
            stays = np.ones_like(touches) if collision else touches
            new_x, new_y = np.where(stays, x, new_x), np.where(stays, y, new_y)
        turn = powers[1] - powers[0] + _FLOOR_TURN * moving * self._generator.standard_normal(self.size)
        self._pose = np.stack([new_x, new_y, heading + turn])

    def _log_likelihood(self, infrared: tuple[float | None, ...], compass: float | None) -> Floats:
        result = np.zeros(self.size)
        taken = [number for number, reading in enumerate(infrared) if reading is not None]
        if taken:
            expected, slope, turn_slope = self._expected(self._angles[taken])
            spread = (_SPACING * slope) ** 2 + (_SPACING_TURN * turn_slope) ** 2
            sigma = np.maximum(np.sqrt(spread + self._parameters.obstacle_noise**2), 1e-3)
            reading = np.array([infrared[number] for number in taken], np.float64)
            mass = np.exp(reading_log_likelihood(reading, expected, sigma))
            background = np.maximum(1.0 / (1.0 + np.maximum(reading, 0.0)) ** 2, 1e-4) * _ROUNDING
            result += np.log((1.0 - _OUTLIER) * mass + _OUTLIER * background).sum(axis=1)
        if compass is not None:
            off = self._pose[2] - math.radians(compass)
            off = np.remainder(off + math.pi, 2.0 * math.pi) - math.pi
            variance_turn = (self._parameters.compass_noise**2 + 1.0 / 12.0) * math.radians(1.0) ** 2
            result -= np.minimum(0.5 * off**2 / (variance_turn + _SPACING_TURN**2), 20.0)
        return result

    def _expected(self, angles: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the expected readings and their change by unit and by radian; shape (size, sensors)."""
        x, y, heading = self._pose
        direction = np.remainder(heading[:, np.newaxis] + angles + math.pi, 2.0 * math.pi) - math.pi
        cosine, sine = np.cos(direction), np.sin(direction)
        distance = cone_distances(
            self._tables,
            (x[:, np.newaxis] + SENSOR_OFFSET * cosine).ravel(),
            (y[:, np.newaxis] + SENSOR_OFFSET * sine).ravel(),
            direction.ravel(),
            cosine.ravel(),
            sine.ravel(),
        ).reshape(direction.shape)
        near = ~((distance > CONTACT) & (distance < np.inf))
        distance = np.where(near, CONTACT, distance)
        expected = np.where(near, SATURATION, 1.0 / distance)
        slope = 1.0 / np.maximum(distance, 0.05) ** 2
        return expected, slope, slope * distance

    def _resample(self) -> None:
        chosen = self._systematic(self._weight, self._enough())
        count = len(chosen)
        step = np.array([[_STEP], [_STEP], [_STEP_TURN]])
        self._pose = self._pose[:, chosen] + step * self._generator.standard_normal((3, count))
        self._wheels = self._wheels[:, chosen]
        self._weight = np.full(count, 1.0 / count)

    def _enough(self) -> int:
        """Return how many particles a cloud of this spread needs (KLD-sampling)."""
        probable = self._weight > 0.1 / self.size
        width = np.array([[_BIN], [_BIN], [_BIN_TURN]])
        bins = len(np.unique(np.round(self._pose[:, probable] / width), axis=1).T)
        if bins < 2:
            return _LEAST
        part = 2.0 / (9.0 * (bins - 1))
        count = (bins - 1) / (2.0 * _ERROR) * (1.0 - part + math.sqrt(part) * _QUANTILE) ** 3
        return int(min(max(count, _LEAST), _MOST))

    def _systematic(self, weights: Floats, count: int) -> NDArray[np.intp]:
        """Draw by the low-variance sampler (table 4.4)."""
        sums = np.cumsum(weights)
        at = (np.arange(count) + self._generator.uniform()) * (sums[-1] / count)
        return np.asarray(np.minimum(np.searchsorted(sums, at), len(sums) - 1))
