"""Drives along legs: a turn in place, then straight on, keeping clear of walls, until the way ends.

This is what `explore` and `active` have in common; they differ in which leg comes next.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from agent.drives.base import Command, Decision
from agent.drives.outlook import SAFE_CLEARANCE, PoseSample, arc_clearances, draw
from agent.drives.safety import Bumper
from agent.pose_filter.posefilter import PoseFilter
from ciberrato.kinematics import filter_power
from ciberrato.protocol.messages import Measures

Floats = NDArray[np.float64]

_TURN_POWER = 0.1
_CURVATURES = np.array([-1.2, -0.7, -0.35, -0.15, 0.0, 0.15, 0.35, 0.7, 1.2])
_LOOK_AHEAD = 0.8
_MOST_RISK = 0.04
"""Fraction of the likely poses that may touch a wall on the way looked at."""


class LegPhase(StrEnum):
    """What the robot is doing."""

    CHOOSING = "choosing"
    TURNING = "turning"
    DRIVING = "driving"


ChooseLeg = Callable[[PoseFilter, PoseSample, Bumper], tuple[float, float]]
"""Gives the angle to turn by in radians, and the way to go at most in units."""


class Roamer:
    """Drives legs chosen by a function.

    Parameters
    ----------
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    obstacle_noise : float
    choose : callable
    cruise : float
        Motor command for driving straight on.
    """

    def __init__(
        self, angles: tuple[float, ...], obstacle_noise: float, choose: ChooseLeg, *, cruise: float = 0.1
    ) -> None:
        self._bumper = Bumper(angles, obstacle_noise)
        self._choose = choose
        self._cruise = cruise
        self.phase = LegPhase.CHOOSING
        self._to_turn = 0.0
        self._to_drive = 0.0
        self._wheels: Command = (0.0, 0.0)
        self._last: Command = (0.0, 0.0)
        self.legs: deque[tuple[float, float]] = deque(maxlen=16)

    @property
    def bumper(self) -> Bumper:
        """The IR readings as smoothed for safety."""
        return self._bumper

    def decide(self, measures: Measures, pose_filter: PoseFilter) -> Decision:
        """See `agent.drives.base.Drive`."""
        self._bumper.observe(measures.infrared)
        self._dead_reckon()
        command = self._next(measures, pose_filter)
        self._last = (round(command[0], 4), round(command[1], 4))
        return Decision(command=self._last)

    def stand(self) -> None:
        """Take note that the robot stands, whatever leg it was on."""
        self._last = (0.0, 0.0)
        self.phase = LegPhase.CHOOSING

    def _dead_reckon(self) -> None:
        left, right = (filter_power(c, w) for c, w in zip(self._last, self._wheels, strict=True))
        self._wheels = left, right
        if self.phase is LegPhase.TURNING:
            self._to_turn -= right - left
        elif self.phase is LegPhase.DRIVING:
            self._to_drive -= (right + left) / 2.0

    def _next(self, measures: Measures, pose_filter: PoseFilter) -> Command:
        if measures.collision and self.phase is LegPhase.DRIVING:
            self.phase = LegPhase.CHOOSING
            self._bumper.bumped = True
        if self.phase is LegPhase.DRIVING:
            command = self._drive(pose_filter)
            if command is not None:
                return command
            self.phase = LegPhase.CHOOSING
        if self.phase is LegPhase.CHOOSING:
            sample = draw(pose_filter.belief)
            self._to_turn, self._to_drive = self._choose(pose_filter, sample, self._bumper)
            self._bumper.bumped = False
            self.legs.append((self._to_turn, self._to_drive))
            # What the wheels still run on turns the robot, too.
            self._to_turn -= self._wheels[1] - self._wheels[0]
            self.phase = LegPhase.TURNING
        if abs(self._to_turn) < math.radians(3.0):
            self.phase = LegPhase.DRIVING
            command = self._drive(pose_filter)
            return (0.0, 0.0) if command is None else command
        return self._turn()

    def _turn(self) -> Command:
        """Turn in place; what the wheels run on by is part of the angle to come."""
        coming = self._to_turn - (self._wheels[1] - self._wheels[0])
        rate = min(max(coming, -2.0 * _TURN_POWER), 2.0 * _TURN_POWER)
        return -rate / 2.0, rate / 2.0

    def _drive(self, pose_filter: PoseFilter) -> Command | None:
        """Go on along the clearest arc; None when the leg is over."""
        speed = self._bumper.speed
        if self._to_drive <= 0.05 or speed <= 0.0:
            return None
        lattice = pose_filter.tables.lattice
        least, mean = arc_clearances(lattice, draw(pose_filter.belief, 64), _CURVATURES, _LOOK_AHEAD)
        risk = (least < SAFE_CLEARANCE).mean(axis=1)
        score = mean.mean(axis=1) - 4.0 * risk - 0.04 * np.abs(_CURVATURES)
        best = int(score.argmax())
        if risk[best] > _MOST_RISK:
            near, _ = arc_clearances(lattice, draw(pose_filter.belief, 64), _CURVATURES[best : best + 1], 0.3)
            if (near < SAFE_CLEARANCE).mean() > _MOST_RISK and not self._lost(pose_filter):
                return None
            speed *= 0.5
        power = self._cruise * speed
        turn = float(np.clip(_CURVATURES[best] * power, -0.05, 0.05)) + self._bumper.steer
        return power - turn / 2.0, power + turn / 2.0

    def _lost(self, pose_filter: PoseFilter) -> bool:
        """Whether the belief is too wide to forbid anything."""
        return pose_filter.belief.states > 20_000
