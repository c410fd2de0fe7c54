"""The speed of a robot with late answers.

A drive decides as if each command acted for the one cycle that follows. If answers are late, or messages are
overtaken by newer ones before they are answered, a command acts for several cycles, and on a robot that has
moved on: a turn in place swings past its end, and back, without end. A loop that is n times slower than the
one that the drive was made for is as stable as that one if the robot is n times slower, too.
"""

from __future__ import annotations

import dataclasses

from agent.drives.base import Decision

_MEMORY = 0.85  # of the slowness, from answer to answer: one answer in time is no reason for full speed
_IN_TIME = 1.05  # cycles an answer takes


class Throttle:
    """Slows a robot down by how many cycles its answers take."""

    def __init__(self) -> None:
        self._answered: int | None = None
        self._cycles = 1.0

    def slow(self, decision: Decision, time: int, under_way: int) -> Decision:
        """Return a decision with the speeds that are safe.

        Parameters
        ----------
        decision : Decision
        time : int
            Time of the message that it answers, in simulated cycles.
        under_way : int
            Earlier answers that had not left when the message arrived.

        Returns
        -------
        Decision
            The same while every message is answered in its cycle.
        """
        gap = 1 if self._answered is None else max(time - self._answered, 1)
        self._answered = time
        # Earlier answers under way act first, each for as long as the robot is not heard.
        self._cycles = max(float(gap + max(under_way - 1, 0)), 1.0 + _MEMORY * (self._cycles - 1.0))
        if self._cycles < _IN_TIME:
            self._cycles = 1.0
            return decision
        left, right = decision.command
        command = round(left / self._cycles, 4), round(right / self._cycles, 4)
        return dataclasses.replace(decision, command=command)
