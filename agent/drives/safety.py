"""Keeps the robot off the walls: what the IR sensors say always wins over what the belief says."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ciberrato.physics.kinematics import MAX_POWER

_SLOW = 1.6  # reading ahead at which to slow down
_HALT = 2.2  # and at which to stop
_IN_THE_WAY = 1.8
_SIDE_NEAR = 3.2  # reading to the side from which on to keep away
_SIDE_HALT = 9.0
_CLOSING = 5.0  # reading to the side, two cycles ahead, from which on to slow down
_IN_THE_CONE = 1.15
"""Reading at which something that leaves a cone of 60 degrees sideways is within the robot's width."""
_FAR = 0.1  # the least reading that tells a distance
_LOST = 0.25
"""Units farther than what was seen before: that is not seen any more."""
_TURNS = math.radians(1.5)
_TRUST = 0.3  # in a distance that is greater than the remembered one
_TURNED_AWAY = math.radians(35.0)
_PASSED = 0.6  # units
_BRUSH = 5.0  # reading to the side from which on to go no further ahead, where there is room to turn
_SLOWEST = 0.4  # of the cruising speed, before a wall ahead
_CREEP = 0.25  # and between walls that are very near
_MOST_STEER = 0.03
_TOUCHING = 12.0  # reading ahead or behind from which on a turn in place is not safe
_RETREAT = 0.015
STOP_SHORT = 0.12  # units


class Bumper:
    """Smoothed IR readings by direction, and the speed that they allow.

    Parameters
    ----------
    angles : sequence of float
        Mounting angles of the IR sensors in degrees.
    noise : float
        Standard deviation of a reading.
    remembers : bool
        Whether what was ahead and is not seen any more counts as still there: a corner that leaves the
        sensor's cone so near is in the way of a robot that is a unit wide. It takes `move`.
    """

    def __init__(self, angles: Sequence[float], noise: float, *, remembers: bool = False) -> None:
        turned = [math.remainder(angle, 360.0) for angle in angles]
        self._ahead = [i for i, angle in enumerate(turned) if abs(angle) <= 35.0]
        self._left = [i for i, angle in enumerate(turned) if 35.0 < angle <= 100.0]
        self._right = [i for i, angle in enumerate(turned) if -100.0 <= angle < -35.0]
        self._behind = [i for i, angle in enumerate(turned) if abs(angle) >= 145.0]
        self._noise = noise
        self._memory = 0.0 if noise < 0.2 else 0.5
        self._smooth: list[float] | None = None
        self._beside = (0.0, 0.0)
        self._closing = 0.0
        self._remembers = remembers
        self._corner = math.inf
        """Distance to what was ahead, in units."""
        self._corner_turned = 0.0
        self._turned = 0.0
        """Radians, positive to the left, since the last readings."""
        self._sides = [math.inf, math.inf]
        """Distances to what is to the left and to the right, in units."""
        self.bumped = False
        """Return whether the last leg ended in a collision."""

    def observe(self, infrared: Sequence[float | None]) -> None:
        """Store the readings of a message; sensors that were not sent keep their last."""
        if self._smooth is None:
            self._smooth = [reading or 0.0 for reading in infrared]
            self._beside = self.left, self.right
            self._remember()
            return
        for number, reading in enumerate(infrared):
            if reading is not None:
                old = self._smooth[number]
                # What grows is believed at once where it is large: noise is the same far and near.
                memory = self._memory if reading < 2.0 * _HALT else 0.0
                self._smooth[number] = memory * old + (1.0 - memory) * reading
        self._remember()
        before, self._beside = self._beside, (self.left, self.right)
        # A corner that the robot will brush shows as a reading beside that grows from cycle to cycle.
        self._closing = max(3.0 * new - 2.0 * old for new, old in zip(self._beside, before, strict=True))

    def move(self, way: float, turn: float) -> None:
        """Update what is remembered with the motion before the next message.

        Parameters
        ----------
        way : float
            Units.
        turn : float
            Radians.
        """
        self._corner -= way
        self._corner_turned += turn
        self._turned += turn

    def _remember(self) -> None:
        seen = self._most(self._ahead)
        distance = 1.0 / seen if seen > _IN_THE_CONE else math.inf
        forgotten = self._corner < -_PASSED or abs(self._corner_turned) > _TURNED_AWAY
        if forgotten or distance < self._corner:
            self._corner, self._corner_turned = distance, 0.0
        elif distance < self._corner + 2.0 * self._noise * distance**2:
            # The same within its noise. What is farther is something else, behind it or beside: a wall that
            # the robot drives along shows at the edge of the cone, always at the same distance, while its end
            # comes nearer, unseen.
            self._corner += _TRUST * (distance - self._corner)
        for side, (reading, towards) in enumerate(((self.left, self._turned), (self.right, -self._turned))):
            distance, known = 1.0 / max(reading, _FAR), self._sides[side]
            if distance < known:
                self._sides[side] = distance
            elif distance < known + _LOST:
                self._sides[side] += _TRUST * (distance - known)
            else:
                self._sides[side] = distance
                hides = 1.0 / max(seen, _FAR) > known + _LOST
                if towards > _TURNS and hides and known < min(1.0 / _IN_THE_CONE, self._corner):
                    # Between the cones of two sensors nothing is seen.
                    self._corner, self._corner_turned = known, 0.0
        self._turned = 0.0

    def _most(self, sensors: list[int]) -> float:
        return max((self._smooth[i] for i in sensors), default=0.0) if self._smooth else 0.0

    @property
    def ahead(self) -> float:
        """Reading ahead."""
        remembered = 1.0 / max(self._corner, 0.1) if self._remembers and self._corner < math.inf else 0.0
        return max(self._most(self._ahead), remembered)

    @property
    def left(self) -> float:
        """Reading to the left."""
        return self._most(self._left)

    @property
    def right(self) -> float:
        """Reading to the right."""
        return self._most(self._right)

    @property
    def behind(self) -> float:
        """Reading behind."""
        return self._most(self._behind)

    @property
    def closed(self) -> float:
        """Radians to both sides of straight ahead in which no path is open."""
        if self.bumped:
            return math.radians(80.0)
        return math.radians(40.0) if self.ahead > _IN_THE_WAY else 0.0

    @property
    def speed(self) -> float:
        """Fraction of the cruising speed that is safe, from 0 to 1."""
        ahead = min(max((_HALT - self.ahead) / (_HALT - _SLOW), 0.0), 1.0)
        return min(_SLOWEST + (1.0 - _SLOWEST) * ahead if ahead > 0.0 else 0.0, self._beside_speed)

    @property
    def _beside_speed(self) -> float:
        sides = max(self.left, self.right)
        # A wall that the robot touches with its side is no reason to stay there forever.
        beside = min(max((_SIDE_HALT - sides) / (_SIDE_HALT - _SIDE_NEAR), _CREEP), 1.0)
        return min(beside, _SLOWEST) if self._closing > _CLOSING else beside

    @property
    def brushes(self) -> bool:
        """Whether the robot would brush what is beside, if it went on: corners leave the cones at last."""
        return self._closing > _CLOSING or max(self.left, self.right) > _BRUSH

    def limit(self, moved: float) -> float:
        """Return the fastest command from which the robot still stops before what is ahead.

        Parameters
        ----------
        moved : float
            Units by which the wheels run on.

        Returns
        -------
        float
            Units per cycle, not below 0.
        """
        free = 1.0 / max(self.ahead, 1e-3) - STOP_SHORT
        return min(max(free - moved, 0.0), self._beside_speed * MAX_POWER)

    @property
    def open(self) -> bool:
        """Whether the sensors see nothing near, ahead or beside."""
        return self.ahead < _SLOW and max(self.left, self.right) < _SIDE_NEAR and self._closing < _CLOSING

    @property
    def retreat(self) -> float:
        """Motor command that takes the robot off a wall that it almost touches ahead or behind."""
        ahead, behind = self.ahead, self.behind
        if max(ahead, behind) < _TOUCHING or max(ahead, behind) < 2.0 * min(ahead, behind):
            return 0.0
        return -_RETREAT if ahead > behind else _RETREAT

    @property
    def steer(self) -> float:
        """Turn away from a wall beside, in radians per cycle (positive to the left)."""
        push = max(self.right - _SIDE_NEAR, 0.0) - max(self.left - _SIDE_NEAR, 0.0)
        return min(max(0.02 * push, -_MOST_STEER), _MOST_STEER)
