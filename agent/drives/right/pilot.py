"""Steers the robot: turns it to the right, keeps it on the row's middle line, and stops it before a wall.

The simulator's wheel filter answers a command u with (u + v) / 2 if the wheel gave v before, and once the
command is 0 the wheel runs on by v in all. So a command of r - v lets the robot come to rest after r units,
neither short nor beyond.
"""

from __future__ import annotations

import math

from agent.drives.right.tracker import CellTracker
from ciberrato.physics.kinematics import MAX_POWER, STANDSTILL, Command
from ciberrato.world.lab import CELL_SIZE

_HEADING_GAIN = 0.4
_LATERAL_GAIN = 0.2
_TURNING_POWER = 0.1
_CLOSE_ENOUGH = 0.01  # units before the stop at which no more commands are worth while
_DECIMALS = 6  # what is commanded is what the wire carries
_ADJUSTMENT = 0.1  # how far the cruising speed may be adjusted to land on cell centres


class Pilot:
    """Turns a tracker's estimate into motor commands.

    Parameters
    ----------
    cruise : float
        Motor command for driving straight on, units per cycle.
    """

    def __init__(self, cruise: float) -> None:
        self._cruise = cruise

    def align(self, tracker: CellTracker) -> Command:
        """Turn in place towards heading 0."""
        turn = -tracker.pose.heading - tracker.turn
        if abs(tracker.pose.heading) < math.radians(0.3) and abs(tracker.turn) < math.radians(0.3):
            return STANDSTILL
        limit = 2.0 * _TURNING_POWER
        turn = min(max(turn, -limit), limit)
        return _command(-turn / 2.0, turn / 2.0)

    def drive(self, tracker: CellTracker) -> Command:
        """Drive to the right along the middle line, slowing down before a wall."""
        left = tracker.distance_left
        if left < _CLOSE_ENOUGH and tracker.speed < _CLOSE_ENOUGH:
            return STANDSTILL
        pose = tracker.pose
        turn = -_HEADING_GAIN * pose.heading - _LATERAL_GAIN * pose.lateral
        turn = min(max(turn, -MAX_POWER), MAX_POWER)
        most = MAX_POWER - abs(turn) / 2.0
        speed = min(self._landing_speed(tracker, most), max(left - tracker.speed, 0.0))
        return _command(speed - turn / 2.0, speed + turn / 2.0)

    def _landing_speed(self, tracker: CellTracker, most: float) -> float:
        """Return a command, near cruising speed, with which a cycle ends exactly at the next cell's centre.

        With a command u, n cycles from the speed v lead over n u + (v - u)(1 - 2^-n).
        """
        missing = CELL_SIZE * tracker.next_step - tracker.pose.along
        cycles = round((missing + self._cruise - tracker.speed) / self._cruise)
        if cycles < 2:
            return self._cruise
        fastest = min((1.0 + _ADJUSTMENT) * self._cruise, most)
        for candidate in (cycles, cycles + 1):
            run_up = 1.0 - 0.5**candidate
            speed = (missing - tracker.speed * run_up) / (candidate - run_up)
            if speed <= fastest:
                break
        return min(max(speed, (1.0 - _ADJUSTMENT) * self._cruise), fastest)


def _command(left: float, right: float) -> Command:
    return round(left, _DECIMALS), round(right, _DECIMALS)
