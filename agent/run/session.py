"""One run of the agent, from the first datagram to the belief file: link, clock, thread and files."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from typing import TYPE_CHECKING

from agent.drives.right.phases import Phase
from agent.run.registration import Answer, register
from ciberrato.errors import ProtocolError, UsageError
from ciberrato.net.link import Arrival, Link, LinkError
from ciberrato.protocol.registrations import RobotRegistration

if TYPE_CHECKING:
    from agent.drives.exchange import Exchange
    from agent.run.method import Method, Responder
    from agent.run.relayed_link import Relay, RelayedLink
    from agent.run.reporter import Reporter
    from agent.run.settings import Settings
    from agent.run.signals import Interrupts
    from ciberrato.files.run_log import RunWriter
    from ciberrato.files.run_records import Cycle, RunHeader
    from ciberrato.physics.kinematics import Command
    from ciberrato.protocol import Actions

_STOPPED_CYCLES = 5  # a simulator that starts by itself does so after one or two
_STOPS = 3  # times that the last stop is repeated, a cycle apart
_SILENT_CYCLES = 3  # a simulator is not silent before it has missed so many cycles


class Session:
    """One run of the agent.

    Parameters
    ----------
    settings : Settings
    interrupts : Interrupts
        Armed.
    reporter : Reporter
    method : Method
    """

    def __init__(
        self, settings: Settings, interrupts: Interrupts, reporter: Reporter, method: Method
    ) -> None:
        self._settings = settings
        self._interrupts = interrupts
        self._reporter = reporter
        self._method = method
        self._header: RunHeader | None = None
        self._cycles: list[Cycle] = []
        self._exchange: Exchange | None = None
        self._relay: Relay | None = None
        self._held: Cycle | None = None
        """Message that another process answers: it is recorded when it is known what was sent."""
        self._is_stopped = False
        self.lost_contact = False
        """Whether the run has ended because the simulator was not heard any more, or has begun again."""

    def run(self) -> int:
        """Register, drive, and write the belief file.

        Returns
        -------
        int
            Exit status: 0, or 128 + number of the signal that came before anything was recorded.

        Raises
        ------
        UsageError
            If the robot is refused, the simulator falls silent before anything was recorded, or a file cannot
            be written.
        """
        try:
            self._relay = _relay(self._settings, self._method)
            return self._run() if self._method.prepare() else self._interrupts.status
        finally:
            self._method.close()
            if self._relay is not None:
                self._relay.close()

    def _run(self) -> int:
        settings = self._settings
        link = _open_link(settings)
        relayed: RelayedLink | None = None
        try:
            relayed = self._hand_over(link)
            registration = RobotRegistration(
                name=settings.name,
                robot_id=settings.position,
                sensor_angles=tuple(enumerate(settings.angles)),
            )
            answer = register(
                relayed or link,
                registration,
                f"{settings.host}:{settings.port}",
                self._interrupts,
                self._reporter,
                give_up_after=settings.give_up_after,
                when_sent=self._method.begin,
                patient=settings.reconnect,
            )
            if relayed is not None and (answer is None or answer.acceptance.lockstep):
                relayed.release()  # in lockstep there is nothing to answer in time
            reason = "interrupted" if answer is None else self._drive(link, relayed, answer)
            return self._finish(link, reason)
        finally:
            if relayed is not None:
                relayed.release()
            if not self._is_stopped:
                # Nothing was recorded, or there was an error: another process may have driven all the same.
                self._stop(link)
            link.close()

    def _drive(self, link: Link, relayed: RelayedLink | None, answer: Answer) -> str:
        """Answer Measures until something ends the run; return what."""
        import hashlib

        from ciberrato.files.run_log import RunWriter
        from ciberrato.files.run_records import RunHeader

        settings, parameters = self._settings, answer.acceptance.parameters
        waiting = list(answer.following)
        sent = answer.sent
        if relayed is not None:
            sent = relayed.registered or sent
            if relayed.is_released:
                waiting += relayed.receive_arrivals()
                relayed = None
        self._header = RunHeader(
            lab_name=settings.lab_file.name,
            lab_sha256=hashlib.sha256(settings.lab_data).hexdigest(),
            parameters=parameters,
            n_beacons=answer.acceptance.n_beacons,
            sensor_angles=settings.angles,
            preset=settings.preset,
            distance_model=settings.distance_model,
            seed=settings.seed,
            robot_name=settings.name,
            robot_position=settings.position,
            cruise=settings.cruise,
            precision=settings.precision,
        )
        self._method.announce(self._header)
        self._announce(lockstep=answer.acceptance.lockstep)
        try:
            writer = RunWriter(settings.log, self._header)
        except OSError as error:
            raise UsageError(f"{settings.log}: cannot be written: {error.strerror}") from None
        controller = self._method.controller(self._header)
        self._exchange = exchange = controller.exchange
        exchange.begin(lockstep=answer.acceptance.lockstep or settings.lockstep, relayed=relayed is not None)
        # The simulator answers a registration in its next cycle: what is beyond that was spent on the way.
        exchange.round_trip = max(answer.arrived - sent - exchange.pace.seconds, 0.0)
        with writer:
            try:
                reason = self._answer_measures(relayed or link, controller, writer, waiting)
            finally:
                if relayed is not None:
                    relayed.release()
                    self._hear(relayed, exchange)
            self._record_held(exchange.command, writer)
        self._tell_of_log(writer)
        missing = exchange.summary()
        if missing is not None:
            self._reporter.warn(missing)
        return reason

    def _answer_measures(
        self, link: Link, controller: Responder, writer: RunWriter, waiting: list[Arrival]
    ) -> str:
        from ciberrato.protocol import Measures

        assert self._header is not None
        silence = max(self._settings.silence, _SILENT_CYCLES * self._header.parameters.cycle_time / 1000.0)
        exchange = controller.exchange
        heard = time.monotonic()
        next_stop = math.inf
        while True:
            if self._interrupts.received:
                return "interrupted"
            try:
                # What came while the last messages were dealt with; only then is the newest the newest.
                waiting += link.receive_arrivals()
            except LinkError as error:
                if not waiting:
                    self.lost_contact = True
                    return str(error)
            relayed = self._hear(link, exchange)
            taken = [(self._decode(arrival.data), arrival.time) for arrival in waiting]
            measures = [(message, arrived) for message, arrived in taken if isinstance(message, Measures)]
            news = exchange.news(measures)
            if relayed is not None and not exchange.pace.is_real_time:
                self._reporter.warn_once(
                    f"Measures do not come every {self._header.parameters.cycle_time} ms: the simulator is "
                    "taken to wait for answers, or to be faster than real time"
                )
            for number, (message, arrived) in enumerate(news, start=1):
                newest = number == len(news)
                self._record_held(exchange.command_in_effect(arrived, message.time), writer)
                cycle, actions = controller.observe(message, newest=newest, arrived=arrived)
                if relayed is not None:
                    self._held = cycle
                    if actions is not None:
                        self._decide(relayed, message.time, actions)
                    continue
                if actions is not None:
                    # Before sending: in lockstep what follows may be here before the call returns.
                    controller.sent(time.time())
                    self._send(link, actions)
                self._record(cycle, writer)
            if controller.ended is not None:
                return controller.ended
            if exchange.begun_again:
                self.lost_contact = True
                return "the simulator has begun again"
            if self._method.failure is not None:
                return self._method.failure
            now = time.monotonic()
            if measures:
                heard = now
            elif now - heard >= silence:
                self.lost_contact = True
                return f"no Measures for {silence:g} s"
            if relayed is not None:
                next_stop = math.inf
            elif news:
                next_stop = now + exchange.patience
            elif now >= next_stop:
                # A robot that is told nothing goes on as it was told last: blindly, and into walls.
                self._send(link, exchange.stopped(time.time()))
                next_stop = now + exchange.pace.seconds
            try:
                waiting = link.receive_arrivals()
                if not waiting:
                    self._interrupts.wait(link.fileno(), min(heard + silence, next_stop) - now)
            except LinkError as error:
                self.lost_contact = True
                return str(error)

    def _hand_over(self, link: Link) -> RelayedLink | None:
        """Send the link to the process that is to register and to answer, if there is one."""
        from ciberrato.net.udp import UdpLink

        if self._relay is None or not isinstance(link, UdpLink):
            return None
        settings = self._settings
        return self._relay.take_over(link, settings.angles, settings.cruise, roams=self._method.drives)

    def _hear(self, link: Link, exchange: Exchange) -> RelayedLink | None:
        """Record what another process has sent; return the link, if it goes on with that."""
        from agent.run.relayed_link import RelayedLink

        if self._relay is None or not isinstance(link, RelayedLink):
            return None
        for answer in link.told():
            exchange.relayed(answer)
        if exchange.is_relayed and not link.answers and not link.is_released:
            self._reporter.warn("the process that answers in time has ended; answering without it")
        exchange.is_relayed = link.answers
        return link if link.answers else None

    def _record_held(self, command: Command | None, writer: RunWriter) -> None:
        """Record the message before this one, with the command that was in effect after it."""
        if self._held is None or self._exchange is None:
            return
        answered = self._held.time in self._exchange.answered
        held = dataclasses.replace(self._held, command=command, answered=answered)
        self._held = None
        self._record(held, writer)

    def _decide(self, link: RelayedLink, time: int, actions: Actions) -> None:
        from ciberrato.protocol import encode

        try:
            link.decide(time, encode(actions))
        except LinkError as error:
            self._reporter.warn_once(str(error))

    def _send(self, link: Link, actions: Actions) -> None:
        from ciberrato.protocol import encode

        try:
            link.send(encode(actions))
        except LinkError as error:
            self._reporter.warn_once(str(error))

    def _decode(self, data: bytes) -> object:
        from ciberrato.protocol import decode_simulator_message

        try:
            return decode_simulator_message(data)
        except ProtocolError as error:
            self._reporter.warn_once(f"a message is left out: {error}")
            return None

    def _record(self, cycle: Cycle, writer: RunWriter) -> None:
        self._cycles.append(cycle)
        writer.write(cycle)
        if writer.fault is not None:
            self._reporter.warn_once(
                f"{self._settings.log}: cannot be written: {writer.fault}; kept until there is room again"
            )
        if cycle.phase == Phase.HOLDING and (len(self._cycles) < 2 or self._cycles[-2].phase != cycle.phase):
            self._reporter.say(
                f"time {cycle.time}: wall ahead, standing still; Ctrl-C ends the run and writes "
                f"{self._settings.output}"
            )
        if cycle.step is not None:
            readings = " ".join("-" if value is None else f"{value:g}" for value in cycle.readings or ())
            self._reporter.say(f"time {cycle.time}: step {cycle.step}, readings {readings}")
        self._tell_of_start(cycle)
        self._method.report(cycle)

    def _tell_of_log(self, writer: RunWriter) -> None:
        """Report what the log lacks, if anything."""
        self._method.log_is_whole = writer.missing == 0
        if writer.missing:
            self._reporter.warn(
                f"{self._settings.log}: lacks the last {writer.missing} of {len(self._cycles) + 1} lines: "
                f"{writer.fault}"
            )
        elif writer.fault is not None:
            self._reporter.warn(f"{self._settings.log}: nothing is missing, there was room again")

    def _tell_of_start(self, cycle: Cycle) -> None:
        """Report once that Start is not on yet; the first messages of a run always say so."""
        stopped = len(self._cycles) == _STOPPED_CYCLES and not any(c.start for c in self._cycles)
        if stopped:
            self._reporter.say(f"time {cycle.time}: waiting for Start (Ctrl-C ends this)")

    def _finish(self, link: Link, reason: str) -> int:
        """Finish the run: the method runs its filter and writes the file."""
        from ciberrato.files.run_records import RecordedRun

        run = None if self._header is None else RecordedRun(self._header, tuple(self._cycles))
        return self._method.finish(run, reason, lambda: self._stop(link))

    def _stop(self, link: Link) -> None:
        """Stop the robot; where messages are lost, once is not enough."""
        from ciberrato.protocol import Actions, encode

        self._is_stopped = True
        stop = encode(Actions(left_motor=0.0, right_motor=0.0))
        with contextlib.suppress(LinkError):  # then the robot is out of reach
            link.send(stop)
            if self._exchange is not None and self._exchange.pace.is_real_time:
                for _ in range(_STOPS):
                    time.sleep(self._exchange.pace.seconds)
                    link.send(stop)

    def _announce(self, *, lockstep: bool) -> None:
        assert self._header is not None
        parameters = self._header.parameters
        length = f"{parameters.sim_time} cycles" if parameters.sim_time else "no time limit"
        self._reporter.say(
            f"registered as {self._header.robot_name!r} at {self._settings.host}:{self._settings.port}; "
            f"noise: motors {parameters.motors_noise:g} %, compass {parameters.compass_noise:g} degrees, "
            f"IR {parameters.obstacle_noise:g}; cycle {parameters.cycle_time} ms; {length}"
            + "; in lockstep: the simulator waits for answers"
            * lockstep
        )


def _relay(settings: Settings, method: Method) -> Relay | None:
    """Start the process that answers while the method computes, where that is of use."""
    if not method.thinks_long or settings.transport != "udp":
        return None
    from agent.run.relayed_link import Relay, can_relay

    return Relay() if can_relay() else None


def _open_link(settings: Settings) -> Link:
    if settings.transport == "tcp":
        from ciberrato.net.tcp import TcpLink

        return TcpLink(settings.host, settings.port)
    from ciberrato.net.udp import UdpLink

    return UdpLink(settings.host, settings.port)
