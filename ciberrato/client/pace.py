"""Whether messages come at the pace of real time, and for how long none has come."""

from __future__ import annotations

import os
from collections import deque

LOCKSTEP_VARIABLE = "CIBERRATO_LOCKSTEP"
"""If set, programs treat the simulator as in lockstep, however slow others that it waits for are."""
MISSED = 3
"""Cycles without Measures after which motors are to stand."""
_LOOKED_AT = 20
"""Messages."""
_LEAST = 4


class Pace:
    """Times messages.

    A simulator in lockstep, or faster than real time, is known by its messages. It waits for the robot, not
    the robot for it: then no clock is to have a say in what the robot does.

    Parameters
    ----------
    cycle_time : float
        Milliseconds, as announced.
    lockstep : bool
        Whether the simulator has said that it waits for every answer.
    presumed : bool
        Whether a simulator that has not said so keeps real time, until its messages show another pace: the
        real simulator always does. Otherwise the first messages tell nothing.
    """

    def __init__(self, cycle_time: float, *, lockstep: bool = False, presumed: bool = False) -> None:
        self.seconds = cycle_time / 1000.0
        """A cycle takes."""
        self._lockstep = lockstep or bool(os.environ.get(LOCKSTEP_VARIABLE))
        self._presumed = presumed
        self._heard: deque[tuple[float, int]] = deque(maxlen=_LOOKED_AT)

    def heard(self, now: float, time: int) -> None:
        """Register a message of a simulator that runs.

        Parameters
        ----------
        now : float
            Seconds.
        time : int
            Simulated cycles; less than before begins anew.
        """
        if self._heard and time < self._heard[-1][1]:
            self._heard.clear()
        if not self._heard or time > self._heard[-1][1]:
            self._heard.append((now, time))

    @property
    def is_known(self) -> bool:
        """Return whether enough messages have been heard to tell real time from any other pace."""
        return self._lockstep or self._presumed or len(self._heard) >= _LEAST

    @property
    def is_real_time(self) -> bool:
        """Return whether cycles take about as long as announced; what is presumed before that is known."""
        if self._lockstep or len(self._heard) < _LEAST:
            return self._presumed and not self._lockstep
        (first, begin), (last, end) = self._heard[0], self._heard[-1]
        nominal = self.seconds * (end - begin)
        return 0.5 * nominal <= last - first <= 2.0 * nominal

    @property
    def patience(self) -> float:
        """Seconds without Measures after which motors are to stand; infinite where no clock counts."""
        return MISSED * self.seconds if self.is_real_time else float("inf")
