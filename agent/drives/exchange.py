"""Messages and answers of a run: what was in effect when, what was lost, and what to ask for."""

from __future__ import annotations

import math
import time as clock
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from ciberrato.client.pace import Pace
from ciberrato.client.requests import RequestRota
from ciberrato.physics.kinematics import STANDSTILL, Command
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.protocol.order import LATE, MessageOrder, News
from ciberrato.world.parameters import Parameters

_JUDGED = 2000  # messages that one look at the network may bring
_COMMANDS_KEPT = 60  # the newest; an older one cannot be the last before a message
_RELAYED_KEPT = 1000  # of those that another process has sent, of which many may be told at once


class _Sent(NamedTuple):
    """A command, when it left, and whether it only stops a robot that is not heard."""

    time: float
    command: Command
    stop: bool


class Answered(NamedTuple):
    """A message to the simulator that the answering process has sent.

    Attributes
    ----------
    time : float
        Moment of leaving, in seconds by the clock that stamps arrivals.
    command : (float, float)
    stop : bool
        Whether it only stops a robot that is not heard.
    answers : int or None
        Time of the message that it answers first, in simulated cycles; None: that was answered before.
    seconds : float or None
        From the arrival of that message.
    overtaken : int
        Messages since the answer before that are not answered, as newer ones were waiting.
    """

    time: float
    command: Command
    stop: bool = False
    answers: int | None = None
    seconds: float | None = None
    overtaken: int = 0


class Exchange:
    """Keeps account of the messages that came and of the answers that left.

    Parameters
    ----------
    parameters : Parameters
        As announced.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.time: int | None = None
        """Of the newest message, in simulated cycles."""
        self.command: Command | None = None
        """In effect from now on; None before the first answer."""
        self.lost = 0
        """Simulated cycles whose Measures never came."""
        self.unanswered = 0
        """Measures that were overtaken by a newer one before they were answered."""
        self.longest_gap = 0
        """Most cycles in a row whose Measures never came."""
        self.stops = 0
        """Number of times that the robot was stopped as nothing was heard."""
        self.begun_again = False
        """Whether several messages in a row have said that another run has begun."""
        self.lockstep = False
        """Whether the simulator is known to wait for every answer: then no clock has a say."""
        self.pace = Pace(parameters.cycle_time)
        """Whether the simulator keeps real time."""
        self.round_trip = 0.0
        """Seconds, at least, from sending a message to receiving what it did; counts in real time only."""
        self.is_relayed = False
        """Whether another process answers, and tells by `relayed` what it has sent."""
        self.answered: set[int] = set()
        """Times of the messages that it has answered, in simulated cycles."""
        self.milliseconds: list[float] = []
        """From the arrival of each of them to its answer."""
        self._parameters = parameters
        self._requests = RequestRota(parameters)
        self._order = MessageOrder(parameters.sim_time)
        self._judged: deque[tuple[Measures, News]] = deque(maxlen=_JUDGED)
        self._sent: list[_Sent] = []

    def begin(self, *, lockstep: bool, relayed: bool) -> None:
        """Register what is known of the run when it begins.

        Parameters
        ----------
        lockstep : bool
            Whether the simulator is known to wait for every answer.
        relayed : bool
            Whether another process answers: then real time is presumed here as it is there.
        """
        self.lockstep, self.is_relayed = lockstep, relayed
        self.pace = Pace(self._parameters.cycle_time, lockstep=lockstep, presumed=relayed)

    @property
    def stale(self) -> int:
        """Messages that were late, doubled or spoilt, and were left out."""
        return self._order.stale

    def sent(self, time: float) -> None:
        """Record when the last answer was sent.

        Parameters
        ----------
        time : float
            Seconds, by the clock that stamps the arrivals.
        """
        if self.command is not None:
            self._note(time, self.command)

    def stopped(self, time: float) -> Actions:
        """Record that the robot is stopped, as no message arrives, and return the message that does it.

        Parameters
        ----------
        time : float
            See `sent`.
        """
        self.stops += self.is_moving
        self._note(time, STANDSTILL, stop=True)
        return Actions(left_motor=0.0, right_motor=0.0)

    def _note(self, time: float, command: Command, *, stop: bool = False) -> None:
        kept = _RELAYED_KEPT if self.is_relayed else _COMMANDS_KEPT
        if len(self._sent) > 2 * kept:
            del self._sent[:-kept]
        self._sent.append(_Sent(time, command, stop))

    @property
    def answers_itself(self) -> bool:
        """Return whether another process answers whatever is decided here, or not."""
        return self.is_relayed and self.pace.is_real_time

    def relayed(self, answer: Answered) -> None:
        """Record a message that another process has sent."""
        self.stops += answer.stop and self.is_moving
        self._note(answer.time, answer.command, stop=answer.stop)
        self.unanswered += answer.overtaken
        if not answer.stop:
            self.command = answer.command
        if answer.answers is not None and answer.seconds is not None:
            self.answered.add(answer.answers)
            self.milliseconds.append(1000.0 * answer.seconds)

    def overtake(self) -> None:
        """Record that a message is not answered, as a newer one is waiting."""
        if not self.is_relayed:
            self.unanswered += 1

    @property
    def is_moving(self) -> bool:
        """Return whether the last command sent lets the robot move."""
        return bool(self._sent) and self._sent[-1].command != STANDSTILL

    def command_in_effect(self, arrived: float | None, time: int | None = None) -> Command | None:
        """Return the command that moved the robot in the cycle that a message is about.

        Parameters
        ----------
        arrived : float or None
            Time of the message's arrival; None = not known, taken to be after the last answer.
        time : int or None
            Time of the message, in simulated cycles. After lost messages it is not known whether a stop has
            reached the robot: then it is not counted, and the filter allows for both.

        Returns
        -------
        (float, float) or None
            The last one that had left, by the time on the way, before the message was sent. An answer that
            leaves later, because this process had no time, acts in a later cycle.
        """
        if arrived is None or not self._sent:
            return self.command
        unsure = time is not None and self.time is not None and time - self.time > 1
        earlier = [
            sent.command
            for sent in self._sent
            if sent.time < arrived - self._on_the_way and not (unsure and sent.stop)
        ]
        return earlier[-1] if earlier else None

    def under_way(self, arrived: float | None) -> int:
        """Count the newest answers that had not acted when a message was sent: they act after its next cycle.

        Parameters
        ----------
        arrived : float or None
            See `command_in_effect`.
        """
        if arrived is None:
            return 0
        return sum(one.time >= arrived - self._on_the_way and not one.stop for one in self._sent)

    def is_unsure(self, arrived: float | None) -> bool:
        """Return whether the cycle in which answers act is not known exactly.

        Parameters
        ----------
        arrived : float or None
            See `command_in_effect`.
        """
        if arrived is not None and self.round_trip > 0.0 and not self.lockstep and not self.pace.is_known:
            return True  # answers are late if this is real time, which the first messages do not tell
        return self.under_way(arrived) > 0

    @property
    def _on_the_way(self) -> float:
        return self.round_trip if self.pace.is_real_time and not self.lockstep else 0.0

    def news(self, messages: Sequence[tuple[Measures, float | None]]) -> list[tuple[Measures, float | None]]:
        """Sort messages that have come together; return those that are news, in the order of their times.

        Parameters
        ----------
        messages : sequence of (Measures, float or None)
            With the times of their arrival.

        Returns
        -------
        list of (Measures, float or None)
            In real time a message has arrived a cycle before the next one at the latest: what is held up on
            the way comes all at once. The times are corrected by that.
        """
        times = [measures.time for measures, _ in messages]
        ordered = list(messages)
        if times and max(times) - min(times) <= LATE:
            ordered.sort(key=lambda one: one[0].time)
        fresh = []
        for measures, arrived in ordered:
            news = self.judge(measures)
            self.begun_again |= news is News.BEGUN_AGAIN
            if news is News.FRESH:
                fresh.append((measures, arrived))
                if measures.start:
                    self.pace.heard(clock.time() if arrived is None else arrived, measures.time)
        if not self.pace.is_real_time:
            return fresh
        latest, after = math.inf, 0
        for number in range(len(fresh) - 1, -1, -1):
            measures, arrived = fresh[number]
            if arrived is not None:
                latest = min(arrived, latest - self.pace.seconds * max(after - measures.time, 0))
                fresh[number] = measures, latest
            after = measures.time
        return fresh

    @property
    def patience(self) -> float:
        """Seconds without news after which the robot is to be stopped; infinite where it stands anyway."""
        return self.pace.patience if self.is_moving and not self.lockstep else math.inf

    def judge(self, measures: Measures) -> News:
        """Return whether a message is news; each is judged once."""
        for known, news in self._judged:
            if known is measures:
                return news
        self._judged.append((measures, self._order.judge(measures)))
        return self._judged[-1][1]

    def take(self, measures: Measures) -> None:
        """Record a message that is news."""
        self._judged = deque((one for one in self._judged if one[0] is not measures), _JUDGED)
        if self.time is not None:
            missing = max(measures.time - self.time - 1, 0)
            self.lost += missing
            self.longest_gap = max(self.longest_gap, missing)
        self.time = measures.time

    def answer(self, command: Command) -> Actions:
        """Return the answer with a command, and with the sensors that are to be requested next."""
        self.command = command
        return Actions(left_motor=command[0], right_motor=command[1], requests=self._requests.next())

    def end_of_time(self, measures: Measures) -> str | None:
        """Return why the simulator does not go on; None if it does."""
        if measures.time > 0 and not measures.start and not measures.stop:
            return "the simulation is over"
        if 0 < self._parameters.sim_time <= measures.time:
            return "the run's time is up"
        return None

    def summary(self) -> str | None:
        """Return a line on what was missing, or None if nothing was."""
        told = []
        if self.lost:
            longest = f", {self.longest_gap} of them in a row" * (self.longest_gap > 1)
            told.append(f"{self.lost} cycles without Measures{longest}")
        if self.unanswered:
            told.append(f"{self.unanswered} Measures not answered, as newer ones were waiting")
        if self.stale:
            told.append(f"{self.stale} late, doubled or spoilt Measures left out")
        if self.stops:
            told.append(f"stopped {self.stops} times while nothing was heard")
        if self.round_trip > 0.0 and self.pace.is_real_time:
            told.append(f"{1000 * self.round_trip:.0f} ms and more on the way, there and back")
        return "; ".join(told) or None
