"""Settings of the pose filter, and its records of messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import BeaconReading, Measures
from ciberrato.reprs import short_repr

"""Left and right motor command, units per cycle."""
Input = tuple[Measures, Command | None]
"""A message, and the command in effect since the one before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSettings:
    """Settings of the pose filter. The defaults were chosen on other labs than those of its evaluation.

    Attributes
    ----------
    exponent : float
        Power to which the likelihood of a cycle is raised at most, in the long run.
    first_exponent : float
        The same of the first readings after all poses were possible.
    settling : float
        Cycles of motion in which the difference between the two falls to 1/e.
    least_exponent : float
        The same for a robot that stands.
    place_spread : float
        Distances spread over a square by this many resolutions (even distribution).
    turn_spread : float
        Distances spread over a bin by this many times distance and bin width.
    outlier : float
        Probability that a reading has nothing to do with the expected one.
    place_floor, turn_floor : float
        Standard deviation added per cycle of motion, in units and degrees, besides the motors' noise.
    diffusion_period : int
        Cycles between two spreadings of the belief.
    prune : float
        Weight of the states that may be given up at once.
    alarm : float
        Evidence (natural logarithm of a likelihood ratio) that the robot is elsewhere at which the filter
        starts anew.
    alarm_slack : float
        Evidence for the belief that a cycle must bring, so as not to count against it.
    """

    __repr__ = short_repr

    exponent: float = 0.4
    first_exponent: float = 1.0
    settling: float = 10.0
    least_exponent: float = 0.02
    place_spread: float = 1.5
    turn_spread: float = 0.6
    outlier: float = 0.02
    place_floor: float = 0.02
    turn_floor: float = 0.4
    diffusion_period: int = 6
    prune: float = 1e-5
    alarm: float = 10.0
    alarm_slack: float = 0.0


class Motion(NamedTuple):
    """Motion of the wheels in a cycle, in units, and whether a wall was in the way (None: not known)."""

    left: float
    right: float
    collision: bool | None

    def __repr__(self) -> str:
        return short_repr(self)


class FilterStep(NamedTuple):
    """Interpretation of a message: the motions before it, what was sensed, and how far to trust it."""

    motions: tuple[Motion, ...]
    infrared: tuple[float | None, ...]
    compass: float | None
    ground: int | None
    exponent: float
    time: int
    beacons: tuple[BeaconReading, ...] = ()

    def __repr__(self) -> str:
        return short_repr(self)
