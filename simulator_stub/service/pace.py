"""Times of the cycles.

`RealTime`: every CycleTime milliseconds, divided by the speed, whatever the robots do.

`Lockstep`: while the simulator runs, as soon as every robot that is waited for has answered its last
Measures.

- Waited for are the robots that run or return and are not silent. A robot that leaves Measures unanswered
  costs a few of its own answer times (`simulator_stub.service.answers`), unless it is seen to be at work.
  Once it has been waited for in vain for the time limit in all it is silent: it is waited for again as soon
  as it sends anything, and when the simulator starts. So a dead agent costs one time limit, not one a cycle.
  With a fixed limit each Measures is waited for so long, and a robot is silent as soon as it has let it pass.
- An answer is all that a robot sends from its Measures on until it waits for the next ones, which can be seen
  of a client on this machine (`simulator_stub.service.client_process`). The newest command counts. Of others
  only time tells: a message that does not look like a whole answer (a LED, a Say, a request: see
  `simulator_stub.service.clients.stands_alone`; a brake) may be followed by another, and is given `SETTLE`
  seconds for it; so is each answer of a robot that has sent several commands of late, one that comes too soon
  to be an answer, and the first one after Measures without an answer, but longer than the robot takes to
  answer: what it has not answered yet is then in, and nothing is left over.
- What comes while a cycle is computed does not answer its Measures.
- While the simulator does not run (before Start, in a pause, after the end) cycles are also at least
  CycleTime / speed apart, lest a process spin. Robots are still waited for, so that the first running cycle
  finds their answers to all that came before, but not longer than `IDLE_LIMIT` (a fixed limit that has an end
  counts instead), as some agents are silent until the start, and not while a client waits to be registered.
  When the automatic start is due the cycle that starts comes as soon as all have answered.
- With no robot to wait for, cycles keep the pace of real time.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from ciberrato.system.process import give_way
from simulator_stub.service.answers import SHORTEST_PATIENCE, TALKATIVE
from simulator_stub.service.client_process import Activity, watch_client
from simulator_stub.service.clients import RobotClient
from simulator_stub.service.session import Session
from simulator_stub.service.vigil import Vigil, all_answered
from simulator_stub.world.robot_state import OUT
from simulator_stub.world.simulator_state import SimulatorState

INSTANT = 1e-6
"""Seconds that are not worth waiting for."""

LOOKS = 12
"""Number of looks in a row at a client's process: the way from its answer back to waiting is short."""

LOOK_AGAIN = 0.001
"""Seconds until it is looked at again."""

STRIKES = 3
"""Number of times in a row that a client's threads are found at work before they are ignored."""

IDLE_LIMIT = 0.5
"""Seconds of the longest wait for a robot while the simulator does not run."""

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
        self, session: Session, period: float, *, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.session = session
        self.period = period
        self.late = 0
        self.lost = 0
        self._clock = clock
        self._due = clock()

    def delays(self) -> str:
        """Return the delays as text."""
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
        Seconds of the longest wait for a robot; infinite: without limit.
    adaptive : bool
        Whether a robot that leaves Measures unanswered is waited for a few of its own answer times only,
        unless it is known to be at work.
    notify : callable
        Told when a robot is no longer waited for, and once for each robot what is ambiguous in its answers.
    vigil : Vigil or None
        Waits awake for the first message of each answer, before the pace sleeps.
    """

    def __init__(
        self,
        session: Session,
        period: float,
        *,
        limit: float,
        adaptive: bool = True,
        notify: Callable[[str], None] = lambda line: None,
        vigil: Vigil | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        super().__init__(session, period, clock=clock)
        self.limit = limit
        self._vigil = vigil
        self._adaptive = adaptive
        # A user who says how long to wait for an answer means the first one, too, unless it is infinite.
        self._idle_limit = min(limit, IDLE_LIMIT) if adaptive or limit == math.inf else limit
        self._notify = notify
        self._real_period = session.simulation.world.parameters.cycle_time / 1000.0
        self._sent = clock()
        self._poll: Poll | None = None
        self._certain = False
        self._known: dict[int, RobotClient] = {}
        session.before_measures = self._before_measures
        session.announce_lockstep()

    def counts(self, robot_id: int) -> dict[str, int]:
        """Return what the result file says of a robot's answers (`Answers.counts`)."""
        return self.session.robots[robot_id].answers.counts()

    def wait(self, poll: Poll) -> bool:
        """Wait for the robots' answers, or for the next tick if there is no robot to wait for."""
        self._poll = poll
        if self._known != self.session.robots:
            self._meet()
        awaited = self._awaited()
        if not awaited:
            return self._wait_until_due(poll)
        running = self.session.simulation.state is SimulatorState.RUNNING
        if not self._certain:
            for client in awaited:
                if client.answers.process is not None:
                    client.answers.process.after_message()
        spins_if_unchecked = not running and not self.session.start_is_due
        if spins_if_unchecked and not self._wait_until_due(poll):
            return False
        going_on = self._wait_for_answers(poll, awaited, running=running)
        # Ticks, if they are needed again, are reckoned from this cycle.
        self._due = self._clock()
        return going_on

    def _meet(self) -> None:
        for robot_id, client in self.session.robots.items():
            if self._known.get(robot_id) is not client and client.peer.ends is not None:
                client.answers.process = watch_client(*client.peer.ends)
        self._known = dict(self.session.robots)

    def _before_measures(self) -> None:
        """Read what came while the cycle was computed: it cannot answer the Measures that go out now."""
        if self._certain or self._poll is None or self.session.simulation.state is not SimulatorState.RUNNING:
            self._sent = self._clock()
            return
        clients = self.session.robots.values()
        for client in clients:
            client.commands = 0
            if client.answers.process is not None:
                client.answers.process.before_message()
        self._poll(0.0)
        for client in clients:
            if client.commands:
                answers = client.answers
                if answers.late == 0:
                    self._tell(
                        client, "came after its cycle: it counts until the answer to the next Measures"
                    )
                answers.late += client.commands
                answers.talkative = TALKATIVE
                client.commands = 0
        self._sent = self._clock()

    def _wait_for_answers(self, poll: Poll, awaited: list[RobotClient], *, running: bool) -> bool:
        began = self._sent if running else self._clock()
        pending = awaited
        for client in awaited:
            client.answers.answered_at = None
        # Look at least once, so that registrations, views and signals are noticed in any case.
        wait = 0.0 if all_answered(awaited) else SHORTEST_PATIENCE
        vigil = self._vigil
        if wait and running and vigil is not None:
            asleep = vigil.asleep
            if not vigil.keep(poll, awaited):
                return False
            if vigil.asleep == asleep and all_answered(awaited):
                wait = 0.0
        look_at = began + wait
        while True:
            if not poll(wait):
                return False
            now = self._clock()
            if pending:
                pending = self._note_answers(pending, now - began if running else None, now)
                if pending and now >= look_at:
                    wait = max(
                        [self._until_given_up(client, now - began, running=running) for client in pending]
                    )
                    look_at = now + wait
                    if wait < INSTANT:
                        pending = []
                if pending:
                    if not running and self.session.registrations_waiting:
                        return True
                    wait = max(look_at - now, INSTANT)
                    continue
            wait = self._until_all_complete(awaited, now)
            if wait < INSTANT:
                wait = 0.0
                before = 0
                for client in awaited:
                    before += client.arrived
                    client.peer.acknowledge()
                if not poll(0.0):
                    return False
                for client in awaited:
                    before -= client.arrived
                if before == 0 or now - began > self.limit:
                    break
        self._take_stock(awaited, now - began, running=running)
        return True

    @staticmethod
    def _note_answers(pending: list[RobotClient], delay: float | None, now: float) -> list[RobotClient]:
        """Record who has answered; return who has not."""
        still = []
        for client in pending:
            if client.answered:
                client.answers.take(delay, now)
                client.answers.arrived = client.arrived
            elif not client.peer.closed:
                still.append(client)
        return still

    def _until_all_complete(self, awaited: list[RobotClient], now: float) -> float:
        """Compute for how long to wait on for what else belongs to the answers that have begun.

        Only asked once all have begun: clients may share a process that has still to answer for others.
        """
        # Whether every client is known to rest: then nothing can come before it gets its Measures.
        self._certain = len(awaited) == len(self.session.robots)
        longest = 0.0
        resting = None
        for client in awaited:
            process = client.answers.process
            if not client.answered:
                self._certain = False
            elif process is not None and (process.reader == resting is not None or process.rests()):
                resting = process.reader
            else:
                longest = max(longest, self._until_complete(client, now))
        return longest

    def _until_complete(self, client: RobotClient, now: float) -> float:
        """Compute for how long to wait on for what else belongs to an answer."""
        answers = client.answers
        process = answers.process
        if client.peer.exhausted:  # what it goes on sending is not read before the next cycle
            self._certain = False
            return 0.0
        if answers.answered_at is None or client.arrived != answers.arrived:
            answers.arrived = client.arrived
            answers.take(None, now)
        assert answers.answered_at is not None
        left = answers.answered_at + self._real_period - now
        if process is None:
            self._certain = False
            likely = client.braked or not client.complete
            quiet = answers.settle(companion_likely=likely, longest=0.5 * self._real_period)
            return max(0.0, min(left, answers.arrived_at + quiet - now)) if quiet else 0.0
        for _ in range(LOOKS):
            activity = process.activity()
            if activity is Activity.RESTS:
                answers.strikes = 0
                return 0.0
            if activity is Activity.DOZES:
                break
            # It may wait for the processor that we are on: waking us has taken it from the client.
            give_way()
        self._certain = False
        if process.gone:
            answers.process = None
            return 0.0
        if activity is Activity.WORKS and process.truthful:
            left = answers.answered_at + self.limit - now
        if left > 0.0:
            return min(left, LOOK_AGAIN)
        answers.strikes += 1
        if answers.strikes >= STRIKES and not process.truthful:
            # Some other thread never rests: then only time tells.
            answers.process = None
        return 0.0

    def _until_given_up(self, client: RobotClient, passed: float, *, running: bool) -> float:
        """Compute for how long to wait on for the first message of an answer."""
        answers = client.answers
        if not running:
            return max(0.0, self._idle_limit - passed)
        left = self.limit - passed
        if not self._adaptive:
            return min(max(0.0, left), 1.0)
        patience = answers.patience(self._real_period)
        if passed < patience:
            return min(left, patience - passed, 1.0)
        process = answers.process
        if process is None or process.gone:
            return 0.0
        if process.activity(all_threads=True) is Activity.RESTS and process.has_read_all():
            return 0.0
        if process.truthful and process.activity() is Activity.WORKS:
            # At work: waited for as long as any robot.
            return max(0.0, min(left, patience))
        return max(0.0, min(left, self._real_period - passed, patience))

    def _take_stock(self, awaited: list[RobotClient], waited: float, *, running: bool) -> None:
        for client in awaited:
            answers = client.answers
            commands, client.commands = client.commands, 0
            if client.answered:
                answers.in_doubt = False
                if not running or (commands <= 1 and not answers.talkative):
                    continue
                if answers.finish(commands) and answers.several == commands - 1:
                    self._tell(client, "was not the only one in answer to its Measures: the last one counts")
            elif not client.peer.closed:
                self._give_up(client, waited, running=running)

    def _give_up(self, client: RobotClient, waited: float, *, running: bool) -> None:
        answers = client.answers
        gone = answers.process is not None and answers.process.gone
        answers.waited += waited
        answers.in_doubt = True
        if running:
            answers.unanswered += 1
        if not (running and self._adaptive) or gone or answers.waited >= self.limit:
            client.silent = True
            if running:
                why = "has ended" if gone else "is silent and not waited for until it answers"
                self._notify(f"robot {client.robot_id} {why}")
        elif answers.unanswered == 1:
            time = self.session.simulation.time
            self._notify(
                f"robot {client.robot_id} left the Measures of time {time} unanswered: its last command "
                "stays (reported once; --result has the count)"
            )

    def _tell(self, client: RobotClient, what: str) -> None:
        time = self.session.simulation.time
        self._notify(
            f"robot {client.robot_id}: at time {time} a motor command {what} "
            "(reported once; --result has the count)"
        )

    def _awaited(self) -> list[RobotClient]:
        clients = self.session.robots
        awaited = []
        for robot in self.session.simulation.robots:
            if robot.state not in OUT:
                client = clients[robot.robot_id]
                if not (client.silent or client.peer.closed):
                    awaited.append(client)
        return awaited
