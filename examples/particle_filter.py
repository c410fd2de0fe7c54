"""A particle filter for the full pose, to be judged beside the project's own filter.

Monte Carlo localization with random particles where the readings do not fit (Thrun, Burgard, Fox,
*Probabilistic Robotics*, tables 4.4, 8.2 and 8.3)::

    ciberrato-evaluate --lab maze --filter built-in examples.particle_filter:make

It shows what a filter of one's own needs: `make`, which gets a `ciberrato.evaluation.judged.FilterSetup`, and
a class with `observe` and `estimate`. IR sensors, compass and collisions are weighed; readings that come late
are not made up for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ciberrato.evaluation.judged import FilterSetup
from ciberrato.geometry.angles import short_turns
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.cone_arrays import many_cone_distances
from ciberrato.infrared.face_tables import tables_of, touching
from ciberrato.infrared.model import SENSOR_OFFSET, ideal_reading, reading_log_likelihood
from ciberrato.physics.kinematics import ROBOT_RADIUS, advance, clamp_power, filter_power
from ciberrato.protocol import Measures

Floats = NDArray[np.float64]

MOST, LEAST = 8000, 800
"""Particles while the pose is unknown, and once it is known."""
SPREAD_PLACE, SPREAD_TURN = 0.012, math.radians(0.4)
"""Noise added to every particle in every cycle, in units and radians, so that copies part."""
VAGUE = 0.25
"""Noise added to that of the IR sensors, in 1/units, while particles are far apart."""
TRUST = 0.3
"""Power to which likelihoods are taken: neighbouring cycles see the same walls."""
SLOW, FAST = 0.01, 0.1
"""Rates of the two running means of the readings' likelihood that decide on random particles (table 8.3)."""
MISFIT = 2.0
"""Nats by which the faster one is below the slower one before there are any."""
NEAR, TURNED = 0.5, math.radians(10.0)
"""Distance and turn within which poses count for the probability of an estimate."""


class Estimate(NamedTuple):
    """Pose of the robot: units, radians, and the weight of the particles around."""

    x: float
    y: float
    heading: float
    probability: float


class ParticleFilter:
    """Follows the pose by weighted samples.

    Parameters
    ----------
    setup : FilterSetup
    """

    def __init__(self, setup: FilterSetup) -> None:
        self.parameters = setup.parameters
        self.angles = np.radians(setup.angles)
        self.generator = setup.generator
        self.lab, self.told = setup.lab, setup.start
        self.tables = tables_of(WallMap.from_lab(setup.lab))
        self.restarts: list[int] = []
        self.slow = self.fast = 0.0
        self.pose = self.sample(MOST)
        self.wheels = np.zeros((2, MOST))
        self.weights = np.full(MOST, 1.0 / MOST)
        self.first = True

    def sample(self, number: int) -> Floats:
        """Draw poses from what is known at the start; shape (3, number): x, y, heading."""
        chosen: list[Floats] = []
        for place in self._places(number):
            chosen.append(place[:, ~touching(self.tables, place[0], place[1])])
            if sum(part.shape[1] for part in chosen) >= number:
                break
        places = np.concatenate(chosen, axis=1)[:, :number]
        if self.told == "centres":
            headings = self.generator.integers(4, size=number) * (math.pi / 2.0)
        else:
            headings = self.generator.uniform(-math.pi, math.pi, number)
        return np.vstack([places, headings])

    def _places(self, number: int) -> Iterator[Floats]:
        size = np.array([[self.lab.width], [self.lab.height]])
        for _ in range(1000):
            place = ROBOT_RADIUS + self.generator.random((2, 2 * number)) * (size - 2.0 * ROBOT_RADIUS)
            if self.told == "centres":
                place = 2.0 * np.floor(place / 2.0) + 1.0
            yield place

    def observe(self, measures: Measures, command: tuple[float, float] | None) -> None:
        """Process a message and the command that was in force before it."""
        if self.first and measures.compass is not None and self.told != "centres":
            # No particle need be spent on headings that the compass rules out.
            noise = math.radians(self.parameters.compass_noise + 0.5)
            self.pose[2] = math.radians(measures.compass) + noise * self.generator.standard_normal(MOST)
        elif command is not None and measures.time > 0:
            self._move(command, collided=bool(measures.collision))
        self.first = False
        self._weigh(measures)
        if 1.0 / (self.weights**2).sum() < 0.5 * len(self.weights):
            self._resample(measures)

    def _move(self, command: tuple[float, float], *, collided: bool) -> None:
        """Sample the motion model: motors with noise; what would be in a wall stays, as the robot does."""
        count = self.pose.shape[1]
        factors = 1.0 + self.parameters.motors_noise / 100.0 * self.generator.standard_normal((2, count))
        for wheel, power in enumerate(command):
            told = np.full(count, clamp_power(power))
            self.wheels[wheel] = filter_power(told, self.wheels[wheel], factors[wheel])
        x, y, heading = advance(*self.pose, *self.wheels)
        x = x + SPREAD_PLACE * self.generator.standard_normal(count)
        y = y + SPREAD_PLACE * self.generator.standard_normal(count)
        inside = touching(self.tables, x, y)
        stays = inside | collided
        self.pose[0] = np.where(stays, self.pose[0], x)
        self.pose[1] = np.where(stays, self.pose[1], y)
        self.pose[2] = heading + SPREAD_TURN * self.generator.standard_normal(count)
        # A collision is felt: a particle that meets a wall where the robot met none is hardly right.
        self.weights = self.weights * np.where(inside == collided, 1.0, 0.3)
        self.weights /= self.weights.sum()

    def _weigh(self, measures: Measures) -> None:
        """Weigh the particles by the readings."""
        x, y, heading = self.pose
        log_weight = np.zeros(len(x))
        for angle, reading in zip(self.angles, measures.infrared, strict=True):
            if reading is None:
                continue
            axis = short_turns(heading + angle)
            across, up = np.cos(axis), np.sin(axis)
            edge = x + SENSOR_OFFSET * across, y + SENSOR_OFFSET * up  # where the sensor sits
            distance = many_cone_distances(self.tables, *edge, axis, across, up)
            sigma = math.hypot(self.parameters.obstacle_noise, VAGUE if len(x) == MOST else 0.03)
            told = reading_log_likelihood(reading, ideal_reading(distance), sigma)
            log_weight += np.logaddexp(told, math.log(1e-4))  # other robots, and what no model knows
        if measures.compass is not None:
            off = short_turns(math.radians(measures.compass) - heading)
            log_weight -= 0.5 * (off / math.radians(math.hypot(self.parameters.compass_noise, 0.5))) ** 2
        # How well the readings fit, whatever the particles' number: a mean over the weights before.
        peak = log_weight.max()
        fit = peak + math.log((self.weights * np.exp(log_weight - peak)).sum() + 1e-300)
        self.slow = fit if self.slow == 0.0 else self.slow + SLOW * (fit - self.slow)
        self.fast = fit if self.fast == 0.0 else self.fast + FAST * (fit - self.fast)
        weights = self.weights * np.exp(TRUST * (log_weight - peak))
        self.weights = weights / weights.sum()

    def _resample(self, measures: Measures) -> None:
        """Draw particles anew with little variance (table 4.4), fewer once the pose is known."""
        known = self.estimate().probability > 0.95
        count = max(LEAST, self.pose.shape[1] * 3 // 4) if known else MOST
        steps = (np.arange(count) + self.generator.random()) / count
        kept = np.minimum(np.searchsorted(np.cumsum(self.weights), steps), len(self.weights) - 1)
        self.pose, self.wheels = self.pose[:, kept], self.wheels[:, kept]
        # Readings that fit worse than they did for long: the robot may be elsewhere.
        doubt = max(0.0, 1.0 - math.exp(min(self.fast - self.slow + MISFIT, 0.0)))
        strangers = int(min(doubt, 0.2) * count)
        if strangers:
            self.restarts.append(measures.time)
            self.pose[:, :strangers] = self.sample(strangers)
        self.weights = np.full(count, 1.0 / count)

    def estimate(self) -> Estimate:
        """Return the mean of the particles around the fullest place, and their weight."""
        x, y, heading = self.pose
        # Particles by squares of a unit and twelfths of a turn: where most weight is, the search begins.
        turns = np.floor(heading / (math.pi / 6.0)) % 12.0
        squares = ((np.floor(y) * 4096.0 + np.floor(x)) * 12.0 + turns).astype(np.int64)
        _, place = np.unique(squares, return_inverse=True)
        fullest = np.bincount(place, self.weights).argmax() == place
        centre = self._mean(fullest)
        for _ in range(3):
            centre = self._mean(self._around(centre, 1.5))
        probability = float(self.weights[self._around(centre, 1.0)].sum())
        return Estimate(*centre, min(probability, 1.0))

    def probability_near(self, x: float, y: float, heading: float) -> float:
        """Return the weight of the particles around a pose."""
        return float(self.weights[self._around((x, y, heading), 1.0)].sum())

    def _around(self, centre: tuple[float, float, float], reach: float) -> NDArray[np.bool_]:
        near = np.hypot(self.pose[0] - centre[0], self.pose[1] - centre[1]) <= reach * NEAR
        return np.asarray(near & (np.abs(short_turns(self.pose[2] - centre[2])) <= reach * TURNED))

    def _mean(self, chosen: NDArray[np.bool_]) -> tuple[float, float, float]:
        weights = self.weights[chosen]
        if not weights.sum() > 0.0:
            chosen, weights = (
                self.weights == self.weights.max(),
                self.weights[self.weights == self.weights.max()],
            )
        x, y, heading = self.pose[:, chosen]
        turn = math.atan2((weights * np.sin(heading)).sum(), (weights * np.cos(heading)).sum())
        return float((weights * x).sum() / weights.sum()), float((weights * y).sum() / weights.sum()), turn


def make(setup: FilterSetup) -> ParticleFilter:
    """Create the filter: what ``--filter examples.particle_filter:make`` names."""
    return ParticleFilter(setup)
