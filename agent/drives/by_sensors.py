"""Legs by the IR sensors alone: what a robot does while nothing is known, neither its pose nor the map.

Straight on where nothing is near, away from what is beside, a turn in place towards the opener side before
what is ahead. It needs no tables and no belief, draws no random numbers, and lets a filter that begins later
make up for what was driven.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from agent.drives.base import Decision
from agent.drives.safety import Bumper
from ciberrato.physics.kinematics import MAX_POWER, Command, filter_wheels
from ciberrato.protocol.messages import Measures

_BACK_OFF = 3  # cycles after a collision
_BACKWARDS: Command = (-0.1, -0.1)
_LEAST_TURN = math.radians(50.0)
_MOST_TURN = math.radians(360.0)
_ROOM = 3.0  # reading behind up to which there is room to back off from what is beside
_OFF = 0.02
_SIDE = 0.2
"""Least difference of the sides' readings to turn away from one; else all turns have the same sense."""


class SensorDrive:
    """Keeps away from walls by IR, and turns in the open.

    Parameters
    ----------
    angles : sequence of float
        Mounting angles of the IR sensors in degrees.
    obstacle_noise : float
    cruise : float
        Motor command for driving straight on, in units per cycle.
    """

    def __init__(self, angles: Sequence[float], obstacle_noise: float, *, cruise: float = 0.1) -> None:
        self._bumper = Bumper(angles, obstacle_noise, remembers=True)
        self._cruise = min(cruise, MAX_POWER)
        self._wheels: Command = (0.0, 0.0)
        self._last: Command = (0.0, 0.0)
        self._heard: set[int] = set()
        self._backing = 0
        self._direction = 0
        """Of the turn in place that the robot is in: 1 to the left, -1 to the right, 0 none."""
        self._turned = 0.0

    def decide(self, measures: Measures, motion: tuple[float, float] | None = None) -> Decision:
        """Decide what to do in answer to a message.

        Parameters
        ----------
        measures : Measures
        motion : (float, float) or None
            Units driven and radians turned since the message before; None: as the last command says.
        """
        self._wheels = filter_wheels(self._last, self._wheels)
        if motion is None:
            motion = (self._wheels[0] + self._wheels[1]) / 2.0, self._wheels[1] - self._wheels[0]
        self._bumper.move(*motion)
        self._bumper.observe(measures.infrared)
        self._heard.update(n for n, reading in enumerate(measures.infrared) if reading is not None)
        self._turned += abs(motion[1])
        left, right = self._next(measures)
        self._last = (round(left, 4), round(right, 4))
        return Decision(command=self._last)

    def _next(self, measures: Measures) -> Command:
        if len(self._heard) < len(measures.infrared):
            return 0.0, 0.0  # a sensor that has never been heard may be the one that sees the wall
        if measures.collision and self._backing == 0 and self._direction == 0:
            self._backing = _BACK_OFF
            self._bumper.bumped = True
        if self._backing > 0:
            self._backing -= 1
            return _BACKWARDS
        if self._direction != 0 and self._goes_on():
            self._direction = 0
            self._bumper.bumped = False
        if self._direction == 0:
            speed = self._bumper.speed
            if speed > 0.0 and not self._bumper.bumped and not self._bumper.brushes:
                turn = self._bumper.steer
                power = min(self._cruise * speed, MAX_POWER - abs(turn) / 2.0)
                return power - turn / 2.0, power + turn / 2.0
            self._direction = -1 if self._bumper.left > self._bumper.right + _SIDE else 1
            self._turned = 0.0
        off = self._bumper.retreat
        if off == 0.0 and self._bumper.brushes and self._bumper.behind < _ROOM:
            # The wheels run on by half of their motion in each cycle; the opposite command stops them in one.
            off = -max(_OFF, (self._wheels[0] + self._wheels[1]) / 2.0)
        return off - self._direction * MAX_POWER, off + self._direction * MAX_POWER

    def _goes_on(self) -> bool:
        """Return whether the turn in place has gone far enough."""
        ahead = self._bumper.speed > 0.0 and not self._bumper.brushes and self._turned >= _LEAST_TURN
        return ahead or self._turned >= _MOST_TURN
