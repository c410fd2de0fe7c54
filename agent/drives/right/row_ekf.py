"""Pose of the robot relative to its start: a Kalman filter over place and heading.

The state is (along, lateral, heading): the way driven to the right, the distance to the left of the row's
middle line, both in units, and the heading in radians. It is moved by the motor commands through the wheel
filter that the simulator applies, and corrected by whatever the sensors say. Without motor noise and
initial uncertainty the covariance stays zero, no correction has any effect, and the filter is plain dead
reckoning, exact.

References
----------
Thrun, Burgard, Fox, *Probabilistic Robotics*, section 3.3 (extended Kalman filter). Several explanations of
one reading are weighed as in probabilistic data association: Bar-Shalom, Fortmann, *Tracking and Data
Association*, section 6.4.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ciberrato.physics.kinematics import advance, clamp_power, filter_power

Vector = tuple[float, float, float]

_BLOCKED_VARIANCE = 0.02**2
"""Units squared; a robot that runs into something is not on the line that it thinks it is on."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A place and heading relative to the start.

    Attributes
    ----------
    along, lateral : float
        Units: to the right, and to the left of the direction of travel.
    heading : float
        Radians, 0 = to the right.
    """

    along: float = 0.0
    lateral: float = 0.0
    heading: float = 0.0


class Explanation(NamedTuple):
    """One way to explain a reading.

    Attributes
    ----------
    prior : float
        Probability before the reading.
    innovation : float
        The reading less what it should be.
    slope : (float, float, float)
        Derivative of the expected reading by the state.
    variance : float
        Variance of the reading, the state being known.
    """

    prior: float
    innovation: float
    slope: Vector
    variance: float


class RowKalmanFilter:
    """Kalman filter over (along, lateral, heading).

    Parameters
    ----------
    motors_noise : float
        Standard deviation of the motor factor, in percent.
    memory : int
        Greatest age of a reading at its arrival, in cycles.
    """

    def __init__(self, motors_noise: float, memory: int = 0) -> None:
        self._wheel_variance = (2.0 * motors_noise / 100.0) ** 2
        self.left = self.right = 0.0
        self.covariance = [[0.0] * 3 for _ in range(3)]
        self._past: deque[Vector] = deque([(0.0, 0.0, 0.0)], maxlen=memory + 1)

    @property
    def speed(self) -> float:
        """Units per cycle in the last cycle simulated, according to the commands."""
        return (self.left + self.right) / 2.0

    @property
    def turn(self) -> float:
        """Radians per cycle in the last cycle simulated, according to the commands."""
        return self.right - self.left

    def pose(self, age: int = 0) -> Pose:
        """Return the pose `age` cycles ago, given everything known now."""
        return Pose(*self._past[max(-1 - age, -len(self._past))])

    def deviations(self) -> Vector:
        """Return the standard deviations along, lateral (units) and of the heading (radians)."""
        along, lateral, heading = (math.sqrt(max(self.covariance[axis][axis], 0.0)) for axis in range(3))
        return along, lateral, heading

    def place(self, pose: Pose, deviations: Vector) -> None:
        """Return where the robot is, with independent errors of the standard deviations given."""
        self._past.extend([(pose.along, pose.lateral, pose.heading)] * (self._past.maxlen or 1))
        self.covariance = [
            [deviations[row] ** 2 if row == column else 0.0 for column in range(3)] for row in range(3)
        ]

    def widen_heading(self, variance: float) -> None:
        """Add variance (radians squared) to the heading."""
        self.covariance[2][2] += variance

    def stand(self) -> None:
        """Predict over a cycle in which nothing moves."""
        self._past.append(self._past[-1])

    def move(self, command: tuple[float, float], *, blocked: bool = False) -> None:
        """Simulate a cycle.

        The noise of one cycle lives on in the wheel filter and adds up to twice itself; it is taken as if
        it came at once, with twice the standard deviation.

        Parameters
        ----------
        command : (float, float)
            Left and right motor command in effect, in units per cycle.
        blocked : bool
            Whether a collision kept the robot in its place; it turns all the same.
        """
        self.left = filter_power(clamp_power(command[0]), self.left)
        self.right = filter_power(clamp_power(command[1]), self.right)
        along, lateral, heading = self._past[-1]
        moved = advance(along, lateral, heading, self.left, self.right)
        squares = self.left**2, self.right**2
        turn_variance = self._wheel_variance * (squares[0] + squares[1])
        if blocked:
            self._past.append((along, lateral, moved[2]))
            self.covariance[2][2] += turn_variance
            self.covariance[1][1] += _BLOCKED_VARIANCE
            return
        self._past.append(moved)
        cosine, sine = math.cos(heading), math.sin(heading)
        transition = ((1.0, 0.0, -self.speed * sine), (0.0, 1.0, self.speed * cosine), (0.0, 0.0, 1.0))
        way_variance = turn_variance / 4.0
        mixed = self._wheel_variance * (squares[1] - squares[0]) / 2.0
        noise = (
            (way_variance * cosine * cosine, way_variance * cosine * sine, mixed * cosine),
            (way_variance * cosine * sine, way_variance * sine * sine, mixed * sine),
            (mixed * cosine, mixed * sine, turn_variance),
        )
        old = self.covariance
        half = [[_dot(transition[row], column) for column in zip(*old, strict=True)] for row in range(3)]
        self.covariance = [
            [_dot(half[row], transition[column]) + noise[row][column] for column in range(3)]
            for row in range(3)
        ]

    def correct(self, explanations: Sequence[Explanation], clutter: float = 0.0) -> None:
        """Correct with a reading.

        Each explanation is a Kalman update of its own; the result is the normal distribution with mean and
        covariance of their mixture.

        Parameters
        ----------
        explanations : sequence of Explanation
        clutter : float
            Probability density of the reading if none of them is true (times the prior of that).
        """
        gains: list[tuple[float, list[float], list[float], float]] = []
        total = clutter
        for prior, innovation, slope, variance in explanations:
            reach = [_dot(row, slope) for row in self.covariance]
            spread = _dot(reach, slope) + variance
            likelihood = prior * math.exp(-0.5 * innovation**2 / spread) / math.sqrt(2.0 * math.pi * spread)
            shift = [value * innovation / spread for value in reach]
            gains.append((likelihood, shift, reach, spread))
            total += likelihood
        if total <= 0.0:
            return
        mean = [
            sum(likelihood * shift[axis] for likelihood, shift, _, _ in gains) / total for axis in range(3)
        ]
        for row in range(3):
            for column in range(3):
                self.covariance[row][column] += (
                    sum(
                        likelihood * (shift[row] * shift[column] - reach[row] * reach[column] / spread)
                        for likelihood, shift, reach, spread in gains
                    )
                    / total
                    - mean[row] * mean[column]
                )
        corrected = [
            (along + mean[0], lateral + mean[1], heading + mean[2]) for along, lateral, heading in self._past
        ]
        self._past.extend(corrected)


def _dot(first: Sequence[float], second: Sequence[float]) -> float:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
