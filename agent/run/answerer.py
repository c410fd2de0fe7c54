"""Answers every message in time, by what the agent has decided last; the agent thinks meanwhile.

Without sockets and clocks: `agent.run.answering` is the process around it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from agent.drives.exchange import Answered
from agent.drives.reflex import Reflex
from ciberrato.client.pace import Pace
from ciberrato.client.requests import RequestRota
from ciberrato.errors import ProtocolError
from ciberrato.net.link import Arrival
from ciberrato.physics.kinematics import STANDSTILL, Command
from ciberrato.protocol import Actions, Measures, decode_simulator_message, encode
from ciberrato.protocol.order import MessageOrder, News
from ciberrato.world.parameters import Parameters

_WAIT = 0.3
"""Of a cycle that an answer waits for a decision on its message."""
_LATE_TURN = 0.1
"""Of a cycle after a message came, from which on its answer does not wait."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswererSetup:
    """Facts of the run that an answerer needs.

    Attributes
    ----------
    parameters : Parameters
        As announced.
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    cruise : float
    roams : bool
        See `Reflex`.
    lockstep : bool
        Whether the simulator has said that it waits for every answer.
    """

    parameters: Parameters
    angles: tuple[float, ...]
    cruise: float
    roams: bool
    lockstep: bool = False


class Answerer:
    """Decides when to send what.

    A decision on the newest message is sent at once. Where none comes in time, the message is answered by the
    latest one there is, as far as that is safe. If the simulator says that it waits for the agent, or does
    not keep real time, only decisions are sent.

    Parameters
    ----------
    setup : AnswererSetup
    send : callable
        Sends a message to the simulator.
    tell : callable
        Tells the agent of an answer.
    """

    def __init__(
        self, setup: AnswererSetup, send: Callable[[bytes], None], tell: Callable[[Answered], None]
    ) -> None:
        parameters = setup.parameters
        self._reflex = Reflex(setup.angles, parameters.obstacle_noise, cruise=setup.cruise, roams=setup.roams)
        self._send, self._tell = send, tell
        self._pace = Pace(parameters.cycle_time, lockstep=setup.lockstep, presumed=True)
        self._order = MessageOrder(parameters.sim_time)
        self._requests = RequestRota(parameters)
        self._newest: tuple[Measures, float] | None = None
        self._open = False
        """Whether the newest message is not answered yet."""
        self._due = math.inf
        self._last = 0.0
        """When a message was answered last, the first time; 0 before."""
        self._decided = -1
        self._punctual = True
        self._overtaken = 0
        self._command: Command = STANDSTILL
        self._stop_at = math.inf

    @property
    def due(self) -> float:
        """Time at which `tick` has something to do; infinite if it has not."""
        return min(self._due, self._stop_at)

    def take(self, arrivals: Sequence[Arrival], now: float) -> None:
        """Process messages that have come together; only the newest is to be answered.

        Parameters
        ----------
        arrivals : sequence of Arrival
        now : float
            Seconds by the clock that stamps arrivals.
        """
        fresh: list[tuple[Measures, float]] = []
        for arrival in arrivals:
            try:
                measures = decode_simulator_message(arrival.data)
            except ProtocolError:
                continue  # the agent complains of it
            if not isinstance(measures, Measures) or self._order.judge(measures) is not News.FRESH:
                continue
            came = now if arrival.time is None else min(arrival.time, now)
            if measures.start:
                self._pace.heard(came, measures.time)
            fresh.append((measures, came))
        if not fresh:
            return
        overtaken = [one for one, _ in fresh[:-1] if one.start]
        if self._open and self._newest is not None and self._newest[0].start:
            overtaken.append(self._newest[0])
        self._overtaken += len(overtaken)
        for measures, _ in fresh:
            self._reflex.observe(measures)
        self._punctual = self._newest is None or self._decided >= self._newest[0].time
        self._newest = measures, came = fresh[-1]
        self._open = True
        self._stop_at = now + self._pace.patience if self._command != STANDSTILL else math.inf
        self._due = math.inf
        if measures.start and not measures.stop and self._pace.is_real_time:
            # A turn on the processor that came late may be the only one in this cycle.
            waits = self._punctual and now - came < _LATE_TURN * self._pace.seconds
            self._due = came + _WAIT * self._pace.seconds if waits else now

    def decide(self, time: int, actions: Actions, now: float) -> None:
        """Send the agent's decision on a message, made safe for what has come since.

        Parameters
        ----------
        time : int
            Of the message, in simulated cycles.
        actions : Actions
        now : float
            See `take`.
        """
        command = actions.left_motor or 0.0, actions.right_motor or 0.0
        self._decided = time
        self._reflex.decide(command, time)
        if self._newest is not None and self._newest[0].start and self._pace.is_real_time:
            self._learn(now)
            command = self._reflex.command()
        self._leave(actions, command, now)

    def tick(self, now: float) -> None:
        """Do what is due."""
        if now >= self._due:
            self._learn(now)
            self._leave(Actions(), self._reflex.command(), now)
        elif now >= self._stop_at:
            # A robot that is told nothing goes on as it was told last: blindly, and into walls.
            self.stop(now)
            self._stop_at = now + self._pace.seconds

    def stop(self, now: float) -> None:
        """Stop the robot, whatever was decided."""
        self._send(encode(Actions(left_motor=0.0, right_motor=0.0)))
        self._tell(Answered(now, STANDSTILL, stop=True))
        self._reflex.stop()

    def _learn(self, now: float) -> None:
        """Learn how late the answer is that is about to leave, so that it is safe for as long itself."""
        if not self._open or self._newest is None:
            return
        since = now - self._last if self._last > 0.0 else 0.0
        waited = now - self._newest[1]
        self._reflex.answered(max(since / self._pace.seconds, 1.0 + waited / self._pace.seconds))

    def _leave(self, actions: Actions, command: Command, now: float) -> None:
        left, right = command
        actions = dataclasses.replace(
            actions, left_motor=left, right_motor=right, requests=self._requests.next()
        )
        self._send(encode(actions))
        self._command = command
        self._stop_at = now + self._pace.patience if command != STANDSTILL else math.inf
        answers, seconds = None, None
        if self._open and self._newest is not None:
            measures, came = self._newest
            answers, seconds = measures.time, now - came
            self._last = now
        self._tell(Answered(now, command, answers=answers, seconds=seconds, overtaken=self._overtaken))
        self._overtaken = 0
        self._open = False
        self._due = math.inf
