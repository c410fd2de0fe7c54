"""Waiting for answers without going to sleep, for a bounded time.

A processor with nothing to do takes time to wake, which may be longer than a client takes to answer. So
lockstep looks for answers again and again before it sleeps, where that takes nothing from others: the clients
leave a processor over, the processors were idle for some of the last time, and none is found to have waited
for this one. On systems that do not say how long they were idle, it always sleeps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from ciberrato.system.process import give_way, idle_seconds, processors
from simulator_stub.service.clients import RobotClient

LONGEST = 250e-6
"""Seconds of the longest wait awake; whose clients never answer sooner is not waited for awake at all."""

WINDOW = 0.25
"""Seconds between looks at how idle the processors were."""

IDLE = 0.3
"""Processors that have to be idle on an average."""

TAKEN = 30e-6
"""Seconds after which the processor, once yielded, counts as having been wanted by another process."""

PAUSE = 2.0
"""Seconds without another wait awake after that."""


class Vigil:
    """Decides whether to wait awake, and does.

    Parameters
    ----------
    clock : callable
        Seconds, monotonic.
    yield_processor : callable
        Let another process have the processor, if one waits for it.
    idle : callable
        Seconds that the processors this process may use were idle, added up; None where that is not known.
    count : int or None
        Number of those; None: as the system says.

    Attributes
    ----------
    awake, asleep : int
        Waits so far of either kind.
    """

    def __init__(
        self,
        *,
        clock: Callable[[], float] = time.perf_counter,
        yield_processor: Callable[[], None] = give_way,
        idle: Callable[[], float | None] = idle_seconds,
        count: int | None = None,
    ) -> None:
        self._clock = clock
        self._yield = yield_processor
        self._idle = idle
        self._processors = processors() if count is None else count
        self.awake = self.asleep = 0
        self._quiet = False
        self._looked_at, self._idle_then = clock(), None if self._processors < 2 else idle()
        self._due = self._looked_at + WINDOW

    def keep(self, poll: Callable[[float], bool], awaited: Sequence[RobotClient]) -> bool:
        """Wait until all have answered, or for as long as that may take.

        Parameters
        ----------
        poll : callable
            As for `simulator_stub.service.pace.Pace.wait`.
        awaited : sequence of RobotClient

        Returns
        -------
        bool
            False when the server is to stop.
        """
        clock = self._clock
        if self._idle_then is None or not self._may_wait(awaited, clock()):
            self.asleep += 1
            return True
        self.awake += 1
        end = clock() + LONGEST
        while True:
            if not poll(0.0):
                return False
            before = clock()
            if before >= end or all_answered(awaited):
                return True
            self._yield()
            if clock() - before > TAKEN:
                self._quiet = False
                self._due = before + PAUSE
                return True

    def _may_wait(self, awaited: Sequence[RobotClient], now: float) -> bool:
        if now >= self._due:
            idle = self._idle() or 0.0
            self._quiet = idle - (self._idle_then or 0.0) > IDLE * (now - self._looked_at)
            self._looked_at, self._idle_then, self._due = now, idle, now + WINDOW
        if not self._quiet:
            return False
        processes: set[object] = set()
        for client in awaited:
            answers = client.answers
            if answers.usual is None or answers.fastest > LONGEST:
                return False
            reader = None if answers.process is None else answers.process.reader
            processes.add(client.robot_id if reader is None else reader[:1])
        return len(processes) < self._processors


def all_answered(awaited: Sequence[RobotClient]) -> bool:
    """Return whether no answer is waited for any more."""
    # A plain loop: this is asked at every wake-up.
    for client in awaited:  # noqa: SIM110
        if not (client.answered or client.peer.closed):
            return False
    return True
