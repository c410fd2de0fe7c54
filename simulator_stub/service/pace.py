"""When the next cycle takes place.

`RealTime`: every CycleTime milliseconds, divided by the speed, whatever the robots do.

`Lockstep`: while the simulator runs, as soon as every robot that is waited for has answered its last
Measures.

- Waited for are the robots that run or return and are not silent. A robot is silent once it has let the time
  limit pass; it is waited for again as soon as it sends anything, and when the simulator starts. So a dead
  agent costs one time limit, not one a cycle.
- An answer is any message. One that does not look like a whole answer (a LED, a Say, a request: see
  `simulator_stub.service.clients.stands_alone`) may be followed by another: that one is waited for, but only
  for `SETTLE` seconds.
- While the simulator does not run (before Start, in a pause, after the end) cycles are also at least
  CycleTime / speed apart, so that nobody spins. Robots are still waited for, so that the first running cycle
  finds their answers to all that came before, but not longer than `IDLE_LIMIT`, as some agents are silent
  until the start, and not while somebody waits to be registered. When the automatic start is due the
  cycle that starts comes as soon as all have answered.
- With nobody to wait for, cycles keep the pace of real time.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from simulator_stub.service.clients import RobotClient
from simulator_stub.service.session import Session
from simulator_stub.world.robot_state import RobotState
from simulator_stub.world.simulator_state import SimulatorState

SETTLE = 0.002
"""Seconds that a message which does not look complete is given for what follows it."""

IDLE_LIMIT = 0.5
"""Seconds that a robot is waited for at the most while the simulator does not run."""

Poll = Callable[[float], bool]
"""Wait that many seconds for messages and deliver them; False when the server is to stop.

Waiting ends with the first messages. With 0 seconds, whatever is there is delivered.
"""


class Pace(ABC):
    """Decides how long to wait, delivering messages meanwhile.

    Parameters
    ----------
    session : Session
    period : float
        Seconds from a cycle to the next in real time.
    clock : callable
        Seconds, monotonic.

    Attributes
    ----------
    late : int
        Running cycles that began more than a period late.
    lost : int
        Whole periods that running cycles were behind in all, and that were not caught up with.
    """

    def __init__(
        self, session: Session, period: float, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.session = session
        self.period = period
        self.late = 0
        self.lost = 0
        self._clock = clock
        self._due = clock()

    def delays(self) -> str:
        """Put the delays into words."""
        return f"{self.late} cycles came late, by {self.lost} cycle times in all"

    @abstractmethod
    def wait(self, poll: Poll) -> bool:
        """Wait for the next cycle; False when the server is to stop."""

    def _wait_until_due(self, poll: Poll) -> bool:
        """Wait for the next tick, reckoned from the last one, so that delays do not add up."""
        self._due += self.period
        left = self._due - self._clock()
        if left < -self.period:
            # Catching up would give the robots several cycles at once: rather lose the time.
            self._due -= left
            if self.period > 0.0 and self.session.simulation.state is SimulatorState.RUNNING:
                self.late += 1
                self.lost += int(-left // self.period)
            left = 0.0
        going_on = True
        while going_on and (left := self._due - self._clock()) > 0.0:
            going_on = poll(left)
        # What has arrived by now counts in this cycle, also when every cycle is late.
        return going_on and poll(0.0)


class RealTime(Pace):
    """A cycle every period."""

    def wait(self, poll: Poll) -> bool:
        """Wait for the next tick."""
        return self._wait_until_due(poll)


class Lockstep(Pace):
    """A cycle as soon as every robot has answered.

    Parameters
    ----------
    session, period, clock
        As in `Pace`.
    limit : float
        Seconds that a robot is waited for; infinite for ever.
    notify : callable
        Told when a robot is no longer waited for.
    """

    def __init__(
        self,
        session: Session,
        period: float,
        *,
        limit: float,
        notify: Callable[[str], None] = lambda line: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(session, period, clock=clock)
        self.limit = limit
        self._notify = notify

    def wait(self, poll: Poll) -> bool:
        """Wait for the robots' answers, or for the next tick if there is nobody to wait for."""
        awaited = self._awaited()
        running = self.session.simulation.state is SimulatorState.RUNNING
        if not awaited:
            return self._wait_until_due(poll)
        spins_if_unchecked = not running and not self.session.start_is_due
        if spins_if_unchecked and not self._wait_until_due(poll):
            return False
        going_on = self._wait_for_answers(poll, awaited, running=running)
        # Ticks, if they are needed again, are reckoned from this cycle.
        self._due = self._clock()
        return going_on

    def _wait_for_answers(self, poll: Poll, awaited: list[RobotClient], *, running: bool) -> bool:
        limit = self.limit if running else min(self.limit, IDLE_LIMIT)
        deadline = self._clock() + limit
        # Look at least once, so that registrations, views and signals are noticed in any case.
        wait = 0.0 if _all_answered(awaited) else min(limit, 1.0)
        while True:
            if not poll(wait):
                return False
            if _all_answered(awaited):
                return self._wait_for_the_rest(poll, awaited)
            if not running and self.session.registrations_waiting:
                return True
            left = deadline - self._clock()
            if left <= 0.0:
                self._give_up(awaited)
                return True
            wait = min(left, 1.0)

    def _wait_for_the_rest(self, poll: Poll, awaited: list[RobotClient]) -> bool:
        arrived = -1
        while not all(client.complete for client in awaited):
            before, arrived = arrived, sum(len(client.messages) for client in awaited)
            if arrived == before:
                break
            if not poll(SETTLE):
                return False
        return True

    def _give_up(self, awaited: list[RobotClient]) -> None:
        for client in awaited:
            if not client.answered and not client.peer.closed:
                client.silent = True
                if self.session.simulation.state is SimulatorState.RUNNING:
                    self._notify(f"robot {client.robot_id} is silent and not waited for until it answers")

    def _awaited(self) -> list[RobotClient]:
        clients = self.session.robots
        return [
            clients[robot.robot_id]
            for robot in self.session.simulation.robots
            if robot.state not in (RobotState.FINISHED, RobotState.REMOVED)
            and not clients[robot.robot_id].silent
            and not clients[robot.robot_id].peer.closed
        ]


def _all_answered(awaited: list[RobotClient]) -> bool:
    # A plain loop: this is asked at every wake-up.
    for client in awaited:  # noqa: SIM110
        if not (client.answered or client.peer.closed):
            return False
    return True
