"""Order of Measures: a message delayed, doubled or spoilt by a network must not end a run or move a pose."""

from __future__ import annotations

from enum import Enum

from ciberrato.protocol.messages import Measures

LATE = 50
"""Cycles that a message may be late; one of an earlier time is of another run, or spoilt."""
LEAP = 10
"""Cycles missing in a row from which on a second message must agree with the first: digits may be spoilt."""
_AGREEING = 3
"""Messages in a row, of times that follow one another, that show that the simulator has begun again."""
_STUBBORN = 10
"""The same where they may as well be late: more than any network holds back in a row."""


class News(Enum):
    """Kinds of messages to their receiver, by order of arrival."""

    FRESH = "newer than all before"
    STALE = "late, doubled or spoilt: to be ignored"
    HELD = "ahead by so much that the next one has to agree"
    BEGUN_AGAIN = "of another run, as were those before it"


class MessageOrder:
    """Judges messages one by one.

    Parameters
    ----------
    sim_time : int
        Cycles that the run takes at most; 0 = without end.
    """

    def __init__(self, sim_time: int = 0) -> None:
        self.time: int | None = None
        """Of the newest message that counts, in simulated cycles."""
        self.stale = 0
        """Messages that were late, doubled or spoilt."""
        self._sim_time = sim_time
        self._newest: Measures | None = None
        self._doubtful: list[int] = []
        self._held: int | None = None

    def judge(self, measures: Measures) -> News:
        """Return what a message is, and note it if it is fresh."""
        held = self._held
        news = self._judge(measures)
        if news is News.FRESH:
            self.stale += held is not None and held >= measures.time
            self.accept(measures)
        elif news is News.STALE:
            self.stale += 1
        return news

    def accept(self, measures: Measures) -> None:
        """Note a message as the newest, without a judgement."""
        self._held = None
        self.time, self._newest = measures.time, measures
        self._doubtful.clear()

    def _judge(self, measures: Measures) -> News:
        time, newest = measures.time, self._newest
        if 0 < self._sim_time < time - LATE:
            return News.STALE  # no simulator is there: digits are spoilt
        if newest is None or 0 < time - newest.time <= LEAP:
            return News.FRESH
        if time == newest.time:
            # While the simulator runs no time comes twice: the network has doubled a datagram.
            return News.STALE if newest.start and measures.start else News.FRESH
        agrees = bool(self._doubtful) and 0 <= time - self._doubtful[-1] <= LEAP
        if time > newest.time:
            if agrees:
                return News.FRESH
            self.stale += self._held is not None  # the one held before was spoilt
            self._doubtful, self._held = [time], time
            return News.HELD
        self._doubtful = [*self._doubtful, time] if agrees else [time]
        known = _AGREEING if newest.time - time > LATE else _STUBBORN
        return News.BEGUN_AGAIN if len(self._doubtful) >= known else News.STALE
