"""Limits of a client: so many bytes and messages a cycle; more waits in the system.

Reading stops when an allowance is used up, and goes on when it is renewed: over TCP the sender is held up
then, over UDP the system drops what its buffer does not hold. Robots' allowances are renewed with each cycle,
so that lockstep may go as fast as it can; all others once in a CycleTime by the clock, so that short cycles
do not make room for more of them. How much is a matter of counts alone, never of how long something took: the
same messages have the same fate on a slow machine.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

CLIENT_BYTES = 8192
"""Of a registered client: five to ten times what most talkative agents send in a cycle."""

NEWCOMER_BYTES = 2048
"""Of a connection without a registration: two registrations of the longest kind."""

LEAST_COST = 80
"""Least number of bytes that a datagram counts for: as many messages as a cycle takes (`MESSAGES`)."""

MESSAGES = 100
"""Messages of a robot that are looked at in a cycle; the rest is dropped and counted."""

VIEW_MESSAGES = 20
"""The same, of a view."""

MAIN_RATE = 100_000
"""Datagrams a second that are read at the main port, about as many as a program sends that does nothing else.

A flood keeps the system's buffer full, and what comes while it is full is lost: a registration is heard with
the probability that there is room, which is the share of the flood that is read. Each costs 1.5 microseconds
if it is no registration, so that a flood takes at most 15 % of a core.
"""

MAIN_DATAGRAMS = 1000
"""Datagrams at the main port at least, however short the time between renewals is."""

REGISTRATION_COST = 20
"""Datagrams that one counts for that may be a registration: reading it takes so much longer."""

CONNECTIONS = 64
"""New connections."""

DROPPED = (
    "robot_messages",
    "view_messages",
    "requests",
    "junk",
    "registrations",
    "main_port",
    "connections",
    "views",
)
"""Kinds of messages that may be dropped, by their names in the result file."""

SHORTEST_TICK = 0.005
"""Least number of seconds between renewals by the clock."""


class Meter:
    """Renews allowances, and counts what was dropped.

    Parameters
    ----------
    period : float
        Seconds between renewals of those that go by the clock.
    dropped : Counter
        By what it was; shared with those who drop something.
    clock : callable
        Seconds, monotonic.

    Attributes
    ----------
    cycles, ticks : int
        Number of renewals of the allowances of either kind.
    now : float
        Time at which the meter was last advanced.
    tick_seconds : float
        Seconds at least from one renewal by the clock to the next.
    """

    def __init__(
        self, period: float, dropped: Counter[str], *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.dropped = dropped
        self.cycles = self.ticks = 0
        self.now = clock()
        self.tick_seconds = max(period, SHORTEST_TICK)
        self._due = self.now + self.tick_seconds
        self._clock = clock
        self._waiting: list[tuple[Allowance, Callable[[], None]]] = []

    def advance(self) -> bool:
        """Renew allowances after a cycle; return whether those that go by the clock were, too."""
        self.cycles += 1
        self.now = self._clock()
        ticked = self.now >= self._due
        if ticked:
            self._due = self.now + self.tick_seconds
            self.ticks += 1
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            for allowance, go_on in waiting:
                if allowance.exhausted:
                    self._waiting.append((allowance, go_on))
                else:
                    go_on()
        return ticked

    def when_renewed(self, allowance: Allowance, go_on: Callable[[], None]) -> None:
        """Call a function, once, as soon as an allowance is renewed."""
        self._waiting.append((allowance, go_on))


class Allowance:
    """Allowance of bytes, messages and time until it is renewed.

    Parameters
    ----------
    meter : Meter
    most : int

    Attributes
    ----------
    every_cycle : bool
        Whether it is renewed with each cycle, and not by the clock.
    """

    __slots__ = ("_left", "_meter", "_renewal", "every_cycle", "most")

    def __init__(self, meter: Meter, most: int) -> None:
        self._meter = meter
        self._renewal = -1
        self._left = self.most = most
        self.every_cycle = False

    def left(self) -> int:
        """Return what is left; 0 or less if it is used up."""
        meter = self._meter
        renewal = meter.cycles if self.every_cycle else meter.ticks
        if renewal != self._renewal:
            self._renewal = renewal
            self._left = self.most
        return self._left

    def spend(self, cost: int) -> bool:
        """Subtract from what `left` has just returned; return whether it is used up."""
        self._left -= cost
        return self._left <= 0

    def take(self, cost: int) -> bool:
        """Subtract from what is left now; return whether it is used up."""
        meter = self._meter
        renewal = meter.cycles if self.every_cycle else meter.ticks
        if renewal != self._renewal:
            self._renewal = renewal
            self._left = self.most
        self._left -= cost
        return self._left <= 0

    @property
    def exhausted(self) -> bool:
        """Return whether it is used up."""
        return self.left() <= 0

    def widen(self, most: int, *, every_cycle: bool) -> None:
        """Allow more from now on."""
        self._left += most - self.most
        self.most = most
        self.every_cycle = every_cycle
        self._renewal = self._meter.cycles if every_cycle else self._meter.ticks
