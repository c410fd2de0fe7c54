"""Evidence of a GPS that reads the position plus an unknown offset.

It does not say where the robot is, but how it has moved. That is worth three things:

* The way by GPS, compared with the way by dead reckoning, gives the *heading*. For every heading that the
  robot may have, a Kalman filter follows its place in the GPS's own coordinates; how well it foresees the
  next reading is the likelihood of that heading (Rao-Blackwellized: Thrun, Burgard, Fox, *Probabilistic
  Robotics*, section 13.3, with a histogram in place of the particles). The likelihoods of successive
  readings, each given all before it, may be multiplied: nothing is counted twice.
* A reading far from what all of them foresee is a *jump*: the robot has been moved by hand.
* While the pose is known, reading less pose is the *offset*; after a jump it gives the position.
"""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.belief.reweight import multiply
from ciberrato.localization.evidence.gps_position import PlaceDensity, weigh_place
from ciberrato.localization.records import Motion

Place = tuple[float, float]

_BINS = 144
_WIDTH = 2.0 * math.pi / _BINS
_ROUNDING = 0.1**2 / 12.0  # readings come in steps of 0.1 units
_TURN_FLOOR = math.radians(0.1)  # a cycle of motion, as is the next
_PLACE_FLOOR = 0.005
_LEAST_VARIANCE = 0.03**2  # rounding's error stays as long as a robot stands
_SLACK = 3.0  # a right model's misfit is distributed exponentially, with mean 1 at most
_JUMP = 15.0
_SUSPECT = 4.0
_LEAST_LIKELIHOOD = 1e-5
_UNTRUSTED = 0.5  # weight of "the headings say nothing", after the belief was found to be wrong
_ENOUGH = 30  # readings from which an offset is worth something
_MOST = 400
_POSE_ERROR = 0.1  # units; of a pose that is known, and it does not average out
_AFTER_JUMP = 60  # readings for which the offset known before a jump is used; then the infrared knows better

EXPONENT = 0.8
"""Power to which the likelihood of a heading is raised."""


class GpsTracker:
    """Follows the robot in the GPS's coordinates, for every heading it may have.

    Parameters
    ----------
    noise : float
        Standard deviation of a reading along each axis, in units (GPSLinNoise).
    motors_noise : float
        In percent (MotorsNoise).
    """

    def __init__(self, noise: float, motors_noise: float) -> None:
        self.reading_variance = noise**2 + _ROUNDING
        self._motors_noise = motors_noise / 100.0
        self._offset = 0.0
        self.variance = self.reading_variance
        """Of the place in the GPS's coordinates along each axis, in units squared."""
        self._turn_variance = 0.0
        self._mean: Floats | None = None
        self._weight = np.full(_BINS, 1.0 / _BINS)
        self.suspicion = 0.0
        """Evidence (natural logarithm) that the robot has been moved by hand."""

    def headings(self) -> Floats:
        """Return the headings of the bins in radians, not wrapped; shape (bins,)."""
        return np.asarray(np.arange(_BINS) * _WIDTH + self._offset)

    def weights(self) -> Floats:
        """Compute the probability of each bin, by the GPS alone; shape (bins,)."""
        return self._weight

    def forget(self) -> None:
        """Reset: any heading, any place."""
        self._mean = None
        self._weight = np.full(_BINS, 1.0 / _BINS)
        self.suspicion = 0.0

    def doubt(self) -> None:
        """Mix in, with half the weight, the belief without the readings so far."""
        self._weight = (1.0 - _UNTRUSTED) * self._weight + _UNTRUSTED / _BINS

    def move(self, motion: Motion) -> None:
        """Update with the motion of the wheels in a cycle.

        Parameters
        ----------
        motion : Motion
        """
        left, right, collision = motion
        way = (left + right) / 2.0
        wheels = (2.0 * self._motors_noise) ** 2 * (left**2 + right**2)
        moving = min((abs(left) + abs(right)) / 0.2, 1.0)
        if self._mean is not None and not collision:
            headings = self.headings()
            self._mean += way * np.stack([np.cos(headings), np.sin(headings)], axis=1)
            self.variance += wheels / 8.0 + _PLACE_FLOOR**2 * moving
            if collision is None:  # a wall may have been in the way
                self.variance += way**2
        self._offset += right - left
        self._turn_variance += wheels + _TURN_FLOOR**2 * moving
        share = self._turn_variance / _WIDTH**2 / 2.0
        if share > 0.02:
            self._turn_variance = 0.0
            self._diffuse(min(share, 0.3))

    def _diffuse(self, share: float) -> None:
        """Mix each bin with its neighbours: the mean of a mixture, and its spread for the variance of all."""
        parts = [(1.0 - 2.0 * share) * self._weight]
        parts += [share * np.roll(self._weight, step) for step in (1, -1)]
        weight = parts[0] + parts[1] + parts[2]
        if self._mean is not None:
            means = [self._mean, np.roll(self._mean, 1, axis=0), np.roll(self._mean, -1, axis=0)]
            shares = [(part / weight)[:, np.newaxis] for part in parts]
            mixed = shares[0] * means[0] + shares[1] * means[1] + shares[2] * means[2]
            spread = sum(
                (part * ((mean - mixed) ** 2).sum(axis=1)).sum()
                for part, mean in zip(parts, means, strict=True)
            )
            self._mean = mixed
            self.variance += float(spread)  # sideways mostly: all of it, not half, along each axis
        self._weight = weight

    def observe(self, reading: Place) -> tuple[Floats, bool]:
        """Update with a reading.

        Parameters
        ----------
        reading : (float, float)
            Units.

        Returns
        -------
        likelihood : array, shape (bins,)
            Likelihood of the reading for every heading, given all before; the greatest is 1.
        jumped : bool
            Whether the robot must have been moved by hand. The tracker has begun anew then.
        """
        place = np.array(reading, np.float64)
        if self._mean is None:
            self._mean = np.tile(place, (_BINS, 1))
            self.variance = self.reading_variance
            return np.ones(_BINS), False
        variance = self.variance + self.reading_variance
        innovation = place - self._mean
        likelihood = np.exp(-0.5 * (innovation**2).sum(axis=1) / variance)
        foreseen = float(self._weight @ likelihood)
        misfit = min(-math.log(max(foreseen, 1e-300)), 200.0)
        self.suspicion = max(self.suspicion + misfit - _SLACK, 0.0)
        if self.suspicion > _JUMP:
            self.forget()
            self.observe(reading)
            return np.ones(_BINS), True
        likelihood = (likelihood + _LEAST_LIKELIHOOD) / (likelihood.max() + _LEAST_LIKELIHOOD)
        weight = self._weight * likelihood + 1e-12
        self._weight = weight / weight.sum()
        gain = self.variance / variance
        self._mean += gain * innovation
        self.variance = max((1.0 - gain) * self.variance, _LEAST_VARIANCE)
        return likelihood, False

    def mean_at(self, headings: Floats) -> Floats | None:
        """Return the place in the GPS's coordinates for other headings, those of the nearest bins.

        Parameters
        ----------
        headings : array, shape (n,)
            Radians.

        Returns
        -------
        array, shape (n, 2), or None
            Units; None without a reading.
        """
        if self._mean is None:
            return None
        nearest = np.round((headings - self._offset) / _WIDTH).astype(np.int64) % _BINS
        return np.asarray(self._mean[nearest])

    def at(self, values: Floats, headings: Floats) -> Floats:
        """Interpolate a value of each bin at other headings, averaged over 5 degrees.

        Parameters
        ----------
        values : array, shape (bins,)
        headings : array
            Radians.

        Returns
        -------
        array, shape of headings
        """
        padded = np.append(values, values[0])
        total = np.zeros(headings.shape)
        for shift in (-2.0 / 3.0, 0.0, 2.0 / 3.0):
            position = np.remainder((headings - self._offset) / _WIDTH + shift, _BINS)
            low = np.minimum(position.astype(np.int64), _BINS - 1)
            part = position - low
            total += (1.0 - part) * padded[low] + part * padded[low + 1]
        return np.asarray(total / 3.0)


class GpsOffset:
    """Offset that the GPS adds to the place, learnt while the pose is known.

    Parameters
    ----------
    reading_variance : float
        Reading variance of a reading along each axis, in units squared.
    """

    def __init__(self, reading_variance: float) -> None:
        self._reading_variance = reading_variance + _POSE_ERROR**2
        self.forget()

    def forget(self) -> None:
        """Reset."""
        self.value: Place = (0.0, 0.0)
        self._count = 0
        self._doubt = 0.0

    @property
    def is_known(self) -> bool:
        """Return whether enough has been learnt."""
        return self._count >= _ENOUGH

    @property
    def variance(self) -> float:
        """Variance along each axis, in units squared."""
        return self._reading_variance / max(self._count, 1) + _POSE_ERROR**2

    def learn(self, reading: Place, x: float, y: float) -> None:
        """Update with a reading at a known pose; begin anew if it contradicts what was learnt.

        Parameters
        ----------
        reading : (float, float)
        x, y : float
            The place, in units.
        """
        off = reading[0] - x - self.value[0], reading[1] - y - self.value[1]
        if self._count:
            squared = (off[0] ** 2 + off[1] ** 2) / (self.variance + self._reading_variance)
            self._doubt = max(self._doubt + 0.5 * squared - _SLACK, 0.0)
            if self._doubt > _JUMP:
                self.forget()
                off = reading[0] - x, reading[1] - y
        self._count = min(self._count + 1, _MOST)
        share = 1.0 / self._count
        self.value = self.value[0] + share * off[0], self.value[1] + share * off[1]


class GpsSense:
    """All that the pose filter makes of a GPS.

    Parameters
    ----------
    noise : float
        Standard deviation of a reading along each axis, in units (GPSLinNoise).
    motors_noise : float
        In percent (MotorsNoise).
    """

    def __init__(self, noise: float, motors_noise: float) -> None:
        self.tracker = GpsTracker(noise, motors_noise)
        self.offset = GpsOffset(self.tracker.reading_variance)
        self._reading: Place | None = None
        self._jumped = False
        self._before_jump: tuple[Place, float] | None = None  # offset, and its variance
        self._since_jump = 0

    def weigh(self, belief: PoseBelief, reading: Place) -> tuple[float, float] | None:
        """Multiply a belief by the likelihood of a reading, and normalize it.

        Parameters
        ----------
        belief : PoseBelief
        reading : (float, float)
            Units.

        Returns
        -------
        (float, float) or None
            The evidence, and the natural logarithm of what is to be expected of it if nothing is known of
            the heading. None: the robot has been moved, and the belief is as it was (see `begin_anew`).
        """
        self._reading = reading
        headings = belief.headings()
        weights = self.tracker.weights()
        foreseen = self._place(headings)
        likelihood, self._jumped = self.tracker.observe(reading)
        if self._jumped:
            return None
        by_bin = self.tracker.at(likelihood, headings) ** EXPONENT
        multiply(belief, [], by_bin.astype(np.float32))
        evidence = belief.normalize()
        self._since_jump += 1
        found = self._place(headings)
        if foreseen is not None and found is not None:
            weigh_place(belief, foreseen, found)
            belief.normalize()
        expected = float(weights @ likelihood)
        return evidence, EXPONENT * math.log(max(expected, 1e-30))

    def _place(self, headings: Floats) -> PlaceDensity | None:
        """Return the place for each heading, some time after a jump, by the offset known before it."""
        if self._before_jump is None or self._since_jump > _AFTER_JUMP:
            return None
        offset, variance = self._before_jump
        mean = self.tracker.mean_at(headings)
        if mean is None:
            return None
        return PlaceDensity(mean - np.array(offset), variance + self.tracker.variance)

    def begin_anew(self, belief: PoseBelief) -> None:
        """Weigh a uniform belief, after a restart, by what is known in any case.

        After a jump that is the place, by the offset, if it was known. Without a jump the belief was wrong,
        hence the offset too, and it is the heading.

        Parameters
        ----------
        belief : PoseBelief
        """
        jumped = self._jumped or self.tracker.suspicion > _SUSPECT
        self._jumped = False
        self._before_jump = None
        if not jumped:
            self.offset.forget()
            self.tracker.doubt()
            by_bin = self.tracker.at(self.tracker.weights(), belief.headings())
            multiply(belief, [], (by_bin / by_bin.max()).astype(np.float32))
            belief.normalize()
            return
        self.tracker.forget()
        if self._reading is None:
            return
        self.tracker.observe(self._reading)
        if not self.offset.is_known:
            return
        self._before_jump, self._since_jump = (self.offset.value, self.offset.variance), 0
        place = self._place(belief.headings())
        assert place is not None
        if place.probability(belief) < 0.2:  # outside the lab: the offset was learnt at a wrong pose
            self.offset.forget()
            self._before_jump = None
            return
        weigh_place(belief, None, place)
        belief.normalize()
