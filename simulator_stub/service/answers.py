"""Answers of one robot to its Measures: their times and counts.

Lockstep learns from it how long to wait; `counts` goes into the result file.
"""

from __future__ import annotations

from simulator_stub.service.client_process import ClientProcess

SETTLE = 0.002
"""Least number of seconds to wait for the rest of an answer, where the simulator has to go by time."""

SHORTEST_PATIENCE = 0.002
"""Least number of seconds until the process of a robot without an answer is examined (`ClientProcess`)."""

BLIND_PATIENCE = 0.01
"""Least number of seconds to wait for a robot that left Measures unanswered, where it has to go by time."""

FACTOR = 4.0
"""So many times its usual answer time a robot is waited for."""

FORGETTING = 0.05
"""Share of the difference by which what is usual follows answers that are faster, with each of them."""

TALKATIVE = 100
"""Answers for which a robot counts as one that sends several commands, after it did."""


class Answers:
    """Record of a robot's answers.

    Parameters
    ----------
    robot_id : int

    Attributes
    ----------
    process : ClientProcess or None
        The client's process, if it can be watched.
    usual : float or None
        Seconds from Measures to the first message that answers them: the longest of late, forgotten
        exponentially. None before the first answer.
    fastest : float
        The shortest, drifting upwards.
    arrived : int
        `RobotClient.arrived` when it was last looked at, and
    arrived_at, answered_at : float
        when that was, and when the first message of the answer was seen.
    waited : float
        Seconds waited in vain since the last answer.
    strikes : int
        Number of times in a row that the process was not at rest before time was up.
    unanswered, several, late : int
        Counts that `counts` returns.
    """

    __slots__ = (
        "answered_at",
        "arrived",
        "arrived_at",
        "fastest",
        "gap",
        "in_doubt",
        "late",
        "process",
        "robot_id",
        "several",
        "strikes",
        "talkative",
        "unanswered",
        "usual",
        "waited",
    )

    def __init__(self, robot_id: int) -> None:
        self.robot_id = robot_id
        self.process: ClientProcess | None = None
        self.usual: float | None = None
        self.fastest = 0.0
        self.gap = 0.0
        self.arrived = 0
        self.arrived_at = 0.0
        self.answered_at: float | None = None
        self.in_doubt = False
        self.talkative = 0
        self.waited = 0.0
        self.strikes = 0
        self.unanswered = 0
        self.several = 0
        self.late = 0

    def counts(self) -> dict[str, int]:
        """Return the counts for the result file.

        Returns
        -------
        dict of str to int
            ``unanswered``: Measures of running cycles that no message answered in time; ``superseded``: motor
            commands that another one followed in answer to the same Measures; ``late``: motor commands that
            came when their cycle had been computed, and were replaced by the answer to the next Measures.
        """
        return {"unanswered": self.unanswered, "superseded": self.several, "late": self.late}

    def take(self, delay: float | None, now: float) -> None:
        """Register that messages have come: the first one of an answer, or more.

        Parameters
        ----------
        delay : float or None
            Seconds since the Measures went out; None while the simulator does not run, when it is not looked
            at at once.
        now : float
            Seconds on the same clock as ever.
        """
        if self.answered_at is not None:
            self.gap = max(now - self.arrived_at, self.gap * (1.0 - FORGETTING))
            self.arrived_at = now
            return
        self.answered_at = self.arrived_at = now
        self.waited = 0.0
        if delay is None:
            return
        if self.usual is None:
            self.usual = self.fastest = delay
            return
        # Much faster than ever before: it may belong to the Measures before these.
        if delay < 0.5 * self.fastest:
            self.in_doubt = True
        if delay > self.usual:
            self.usual = delay
        else:
            self.usual += FORGETTING * (delay - self.usual)
        if delay < self.fastest:
            self.fastest = delay
        else:
            self.fastest += FORGETTING * (delay - self.fastest)

    def settle(self, *, companion_likely: bool, longest: float) -> float:
        """Compute how long it must be quiet until an answer counts as complete, where only time tells.

        Parameters
        ----------
        companion_likely : bool
            Whether the last message looks as if another one followed.
        longest : float
            Seconds.

        Returns
        -------
        float
            Seconds.
        """
        if self.talkative or self.in_doubt:
            # Longer than the robot takes to answer: so nothing that it has not answered yet is left over.
            return min(max(SETTLE, 2.0 * self.gap, 2.0 * (self.usual or 0.0)), longest)
        return SETTLE if companion_likely else 0.0

    def patience(self, period: float) -> float:
        """Compute how long the robot is waited for before its Measures count as unanswered.

        Parameters
        ----------
        period : float
            CycleTime in seconds.

        Returns
        -------
        float
            Seconds; where the process can be watched, until it is asked whether it is at rest.
        """
        if self.usual is None:
            return period
        if self.process is not None:
            least = SHORTEST_PATIENCE
        else:
            least = BLIND_PATIENCE if self.unanswered else period
        return max(least, min(FACTOR * self.usual, max(period, 2.0 * self.usual)))

    def finish(self, commands: int) -> int:
        """Close the account of an answer.

        Parameters
        ----------
        commands : int
            Motor commands in it.

        Returns
        -------
        int
            Number of them that did not count.
        """
        surplus = max(commands - 1, 0)
        self.several += surplus
        if surplus:
            self.talkative = TALKATIVE
        elif self.talkative:
            self.talkative -= 1
        return surplus
