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

from agent.drives.base import Decision
from agent.drives.clearance import SAFE_CLEARANCE, PoseSample, arc_clearances, draw
from agent.drives.safety import Bumper
from ciberrato.arrays import Floats
from ciberrato.geometry.angles import short_turn
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.physics.kinematics import MAX_POWER, Command, filter_wheels
from ciberrato.protocol.messages import Measures

_TURN_POWER = 0.15
SPRINT = 1.5
"""Factor of the cruising speed where nothing is near."""
_CURVATURES = np.array([-1.2, -0.7, -0.35, -0.15, 0.0, 0.15, 0.35, 0.7, 1.2])
_LOOK_AHEAD = 0.8
_MOST_RISK = 0.04
"""Fraction of the likely poses that may touch a wall on the way looked at."""
_STRAIGHT = math.radians(3.0)
_BEND = math.radians(25.0)
"""Turns so small are made while driving, if nothing is near."""
_MOST_BEND = 0.08  # radians per cycle
_BACK_OFF = 3  # cycles after a collision
_BACKWARDS: Command = (-0.1, -0.1)
_PROGRESS = 0.15
"""Units; a leg that was shorter has failed."""
_BARRED = math.radians(40.0)
"""To both sides of the direction of a failed leg, where no other is tried until the robot has moved on."""
_MOST_FAILURES = 6
_LONGEST_GAP = 100
"""Cycles between two messages that are made up for; nothing is left of a leg that was so long without any."""
_ALL_ROUND = np.deg2rad(np.arange(0.0, 360.0, 15.0))
_BLIND_AFTER = 4
"""Failed legs in a row after which IR alone decides: where every way is risky, the belief is wrong."""


class LegPhase(StrEnum):
    """Activities of the robot."""

    CHOOSING = "choosing"
    TURNING = "turning"
    DRIVING = "driving"


class Barred:
    """Directions in which the robot has just tried in vain to drive.

    Whatever the belief says of the way ahead: where no leg could begin, none is begun again before the
    robot has left the place.
    """

    def __init__(self) -> None:
        self._headings: deque[float] = deque(maxlen=_MOST_FAILURES)
        self._turned = 0.0

    def turn(self, angle: float) -> None:
        """Update with a turn of the robot, in radians."""
        self._turned += angle

    def add(self) -> None:
        """Block the heading of the robot; if no heading is left open by that, only this one."""
        self._headings.append(self._turned)
        if all(self._bars(turn) for turn in _ALL_ROUND.tolist()):
            self._headings = deque([self._turned], maxlen=_MOST_FAILURES)

    def clear(self) -> None:
        """Clear everything: the robot is elsewhere."""
        self._headings.clear()

    def closed(self, turns: Floats, bumper: Bumper) -> NDArray[np.bool_]:
        """Return the turns after which no path is open.

        Parameters
        ----------
        turns : array
            Radians.
        bumper : Bumper

        Returns
        -------
        array of bool, same shape
        """
        barred = np.array([self._bars(turn) for turn in np.asarray(turns).tolist()], np.bool_)
        return np.asarray(barred | (np.abs(turns) < bumper.closed))

    def _bars(self, turn: float) -> bool:
        return any(abs(short_turn(turn + self._turned - heading)) < _BARRED for heading in self._headings)


Closed = Callable[[Floats], NDArray[np.bool_]]
"""Says of turns, in radians, after which there is no way to go on."""
ChooseLeg = Callable[[GridFilter, PoseSample, Closed], tuple[float, float]]
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
        self._driven = 0.0
        self._bend = 0.0
        self._backing = 0
        self._barred = Barred()
        self._failures = 0
        self._wheels: Command = (0.0, 0.0)
        self._last: Command = (0.0, 0.0)
        self._time: int | None = None
        self.legs: deque[tuple[float, float]] = deque(maxlen=16)

    @property
    def bumper(self) -> Bumper:
        """The IR readings as smoothed for safety."""
        return self._bumper

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        """Decide on a command, see `agent.drives.base.Drive`."""
        self._bumper.observe(measures.infrared)
        self._dead_reckon(measures, pose_filter)
        command = self._next(measures, pose_filter)
        self._last = (round(command[0], 4), round(command[1], 4))
        return Decision(command=self._last)

    def follow(self, measures: Measures, pose_filter: GridFilter, command: Command) -> None:
        """Process a message that another drive has answered, and the answer.

        Parameters
        ----------
        measures : Measures
        pose_filter : GridFilter
        command : (float, float)
        """
        self._bumper.observe(measures.infrared)
        self.phase = LegPhase.CHOOSING
        self._dead_reckon(measures, pose_filter)
        self._barred.clear()
        self._last = command

    def reconsider(self) -> None:
        """End the leg that the robot is on; the next may go on straight ahead."""
        if self.phase is LegPhase.DRIVING and self._driven > _PROGRESS:
            self.phase = LegPhase.CHOOSING

    def stand(self) -> None:
        """Reset the leg: the robot stands."""
        self._last = (0.0, 0.0)
        self.phase = LegPhase.CHOOSING

    def _dead_reckon(self, measures: Measures, pose_filter: GridFilter) -> None:
        """Update the pose by the motion since the last message: by the command in effect, not the answer."""
        cycles = 1 if self._time is None else measures.time - self._time
        self._time = measures.time
        acted = pose_filter.command_before(measures.time)
        for _ in range(min(max(cycles, 1), _LONGEST_GAP)):
            self._move(self._last if acted is None else acted)

    def _move(self, command: Command) -> None:
        self._wheels = filter_wheels(command, self._wheels)
        left, right = self._wheels
        self._barred.turn(right - left)
        if self.phase is LegPhase.TURNING:
            self._to_turn -= right - left
        elif self.phase is LegPhase.DRIVING:
            self._to_drive -= (right + left) / 2.0
            self._driven += (right + left) / 2.0
            if self._driven > _PROGRESS:
                self._barred.clear()
                self._failures = 0

    def _next(self, measures: Measures, pose_filter: GridFilter) -> Command:
        if measures.collision and self.phase is LegPhase.DRIVING:
            self.phase = LegPhase.CHOOSING
            self._bumper.bumped = True
            self._backing = _BACK_OFF
        if self._backing > 0:
            # The wheels run on against the wall; a turn in place would begin with another bump.
            self._backing -= 1
            return _BACKWARDS
        if self.phase is LegPhase.DRIVING:
            command = self._drive(pose_filter)
            if command is not None:
                return command
            if self._driven <= _PROGRESS:
                self._barred.add()
                self._failures += 1
            self.phase = LegPhase.CHOOSING
        if self.phase is LegPhase.CHOOSING:
            self._begin_leg(pose_filter)
        if abs(self._to_turn) < (_BEND if self._bumper.open else _STRAIGHT):
            self._bend = self._to_turn
            self.phase = LegPhase.DRIVING
            command = self._drive(pose_filter)
            return (0.0, 0.0) if command is None else command
        return self._turn()

    def _begin_leg(self, pose_filter: GridFilter) -> None:
        self._to_turn, self._to_drive = self._choose(
            pose_filter,
            draw(pose_filter.belief),
            lambda turns: self._barred.closed(turns, self._bumper),
        )
        self._bumper.bumped = False
        self._driven = 0.0
        self.legs.append((self._to_turn, self._to_drive))
        # What the wheels still run on turns the robot, too.
        self._to_turn -= self._wheels[1] - self._wheels[0]
        self.phase = LegPhase.TURNING

    def _turn(self) -> Command:
        """Turn in place; the motion after the command is part of the remaining angle."""
        coming = self._to_turn - (self._wheels[1] - self._wheels[0])
        rate = min(max(coming, -2.0 * _TURN_POWER), 2.0 * _TURN_POWER)
        # Noisy motors move a robot that turns: off what it all but touches.
        return self._bumper.retreat - rate / 2.0, self._bumper.retreat + rate / 2.0

    def _drive(self, pose_filter: GridFilter) -> Command | None:
        """Continue along the clearest arc; return None when the leg is over."""
        speed = self._bumper.speed
        if self._to_drive <= 0.05 or speed <= 0.0:
            return None
        lattice = pose_filter.tables.everywhere.lattice
        least, mean = arc_clearances(lattice, draw(pose_filter.belief, 64), _CURVATURES, _LOOK_AHEAD)
        risk = (least < SAFE_CLEARANCE).mean(axis=1)
        score = mean.mean(axis=1) - 4.0 * risk - 0.04 * np.abs(_CURVATURES)
        best = int(score.argmax())
        power = self._cruise * speed
        if risk[best] > _MOST_RISK:
            near, _ = arc_clearances(lattice, draw(pose_filter.belief, 64), _CURVATURES[best : best + 1], 0.3)
            risky = (near < SAFE_CLEARANCE).mean() > _MOST_RISK
            # Where the sensors see nothing near there is nothing, whatever the belief says.
            blind = self._failures >= _BLIND_AFTER or self._lost(pose_filter)
            if risky and not self._bumper.open and not blind:
                return None
            power *= 0.5
        elif self._bumper.open:
            power *= SPRINT
        turn = float(np.clip(_CURVATURES[best] * power, -0.05, 0.05)) + self._bumper.steer
        bend = min(max(0.5 * self._bend, -_MOST_BEND), _MOST_BEND)
        self._bend -= bend
        turn += bend
        power = min(power, MAX_POWER - abs(turn) / 2.0)
        return power - turn / 2.0, power + turn / 2.0

    def _lost(self, pose_filter: GridFilter) -> bool:
        """Return whether the belief is too wide to forbid anything."""
        return pose_filter.belief.states > 20_000
