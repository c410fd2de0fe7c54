"""Carriers of a robot's messages: a link to a simulator, or a simulation in the same process."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any, Protocol

from ciberrato.client.errors import no_answer, refused
from ciberrato.errors import CiberratoError, ProtocolError, UsageError
from ciberrato.net.address import parse_address
from ciberrato.net.link import Link, LinkError
from ciberrato.net.tcp import TcpLink
from ciberrato.net.udp import UdpLink
from ciberrato.protocol import Acceptance, Refusal, RobotRegistration, decode_simulator_message, encode
from ciberrato.protocol.messages import Actions, Measures

FIRST_WAIT = 1.0
"""Seconds until the second attempt to register. A simulator answers within a cycle; asking again sooner could
mean being refused, or taking a second place."""
_LONGEST_WAIT = 5.0
REFUSAL_PATIENCE = 0.5
"""Seconds that an acceptance may still come after a refusal."""


class Channel(Protocol):
    """Carrier of a robot's messages."""

    place: str
    """Address of the simulator, for people."""
    waits: bool
    """Whether `receive` waits, for messages that may still come."""

    def register(self, registration: RobotRegistration, give_up_after: float) -> Acceptance:
        """Register a robot.

        Raises
        ------
        SilenceError
            If no simulator answers in time.
        RefusedError
            If the simulator refuses it.
        """

    def send(self, actions: Actions) -> None:
        """Send the message of a cycle."""

    def receive(self, timeout: float) -> list[Measures]:
        """Wait for Measures; return all that are there, oldest first, or none if none came in time."""

    def close(self) -> None:
        """Close the channel; closing again is harmless."""


class LinkChannel:
    """Messages over UDP or TCP.

    Parameters
    ----------
    host : str
        HOST[:PORT]; port 6000 if it is not named.
    transport : {"udp", "tcp"}

    Attributes
    ----------
    unreadable : int
        Messages that were not understood; they are left out.
    """

    waits = True

    def __init__(self, host: str, transport: str) -> None:
        if not isinstance(host, str):
            raise UsageError(f"host {host!r} is not a text like 'localhost:6000'")
        name, port = parse_address(host)
        if transport not in ("udp", "tcp"):
            raise UsageError(f"transport {transport!r} is neither 'udp' nor 'tcp'")
        self.place = f"{name}:{port}"
        self.transport = transport
        self.link: Link = UdpLink(name, port) if transport == "udp" else TcpLink(name, port)
        self.unreadable = 0
        self.refused = False
        """Whether the registration was refused."""

    def register(self, registration: RobotRegistration, give_up_after: float) -> Acceptance:
        """Register a robot; see `Channel.register`."""
        attempts = Attempts(give_up_after)
        self.refused = False
        while True:
            now = time.monotonic()
            if attempts.over(now):
                raise self.no_answer(registration, give_up_after)
            if attempts.due(now) and not self.refused:
                self.link.register(encode(registration))
            try:
                data = self.link.receive(attempts.patience(time.monotonic()))
            except LinkError:  # no simulator is there yet
                time.sleep(min(0.1, attempts.patience(time.monotonic())))
                continue
            answer = None if data is None else self.read_answer(data, attempts)
            if answer is not None:
                return answer

    def read_answer(self, data: bytes, attempts: Attempts) -> Acceptance | None:
        """Read what may be the answer to a registration; None if it is something else.

        After a refusal, which over UDP can be anybody's, an acceptance may still come for a short time.
        """
        message = self._decode(data)
        if isinstance(message, Refusal) and not self.refused:
            self.refused = True
            attempts.end_soon()
        return message if isinstance(message, Acceptance) else None

    def no_answer(self, registration: RobotRegistration, seconds: float) -> CiberratoError:
        """Return the error for a registration that no simulator has accepted."""
        if self.refused:
            return refused(self.place, registration.name or "", registration.robot_id)
        return no_answer(self.place, seconds, self.transport)

    def send(self, actions: Actions) -> None:
        """Send the message of a cycle; see `Channel.send`."""
        self.link.send(encode(actions))

    def receive(self, timeout: float) -> list[Measures]:
        """Wait for Measures; see `Channel.receive`."""
        deadline = time.monotonic() + timeout
        while True:
            data = self.link.receive(max(0.0, deadline - time.monotonic()))
            if data is None:
                return []
            found = self.measures_in([data, *self._rest()])
            if found:
                return found

    def measures_in(self, messages: list[bytes]) -> list[Measures]:
        """Return the Measures among some messages."""
        return [one for data in messages if isinstance(one := self._decode(data), Measures)]

    def close(self) -> None:
        """Close the link."""
        self.link.close()

    def _rest(self) -> list[bytes]:
        try:
            return self.link.receive_waiting()
        except LinkError:  # reported by the next call, once what has come is dealt with
            return []

    def _decode(self, data: bytes) -> object:
        try:
            return decode_simulator_message(data)
        except ProtocolError:
            self.unreadable += 1
            return None


def check_seconds(name: str, seconds: float) -> None:
    """Refuse what is no time to wait.

    Raises
    ------
    UsageError
        If it is not a number above 0; infinity is one.
    """
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not seconds > 0.0:
        raise UsageError(f"{name} {seconds!r} is not a number of seconds above 0")


class Attempts:
    """Times of further attempts to register, and of the last one.

    Parameters
    ----------
    give_up_after : float
        Seconds.
    """

    def __init__(self, give_up_after: float) -> None:
        self._next = time.monotonic()
        self._end = self._next + give_up_after
        self._wait = FIRST_WAIT

    def over(self, now: float) -> bool:
        """Return whether the time is up."""
        return now >= self._end

    def due(self, now: float) -> bool:
        """Return whether it is time for an attempt, and take it for made."""
        if now < self._next:
            return False
        self._next = now + self._wait
        self._wait = min(1.5 * self._wait, _LONGEST_WAIT)
        return True

    def end_soon(self) -> None:
        """Plan to stop trying in a moment, unless a simulator accepts until then."""
        self._end = min(self._end, time.monotonic() + REFUSAL_PATIENCE)
        self._next = math.inf

    def patience(self, now: float) -> float:
        """Return the seconds until there is something to do."""
        return max(0.0, min(self._next, self._end) - now)


class SteppedSimulation(Protocol):
    """Interface of a `simulator_stub.simulation.Simulation` that is needed here."""

    world: Any

    def register(self, registration: RobotRegistration) -> int | None:
        """Return the robot's position number, or None if it is refused."""

    def launch(self) -> Mapping[int, Measures]:
        """Run the two cycles with which every run begins."""

    def step(self, actions: Mapping[int, Actions]) -> Mapping[int, Measures]:
        """Run one cycle."""


class SimulationChannel:
    """A simulation in the same process: each message sent is a cycle, without sockets and clocks.

    Parameters
    ----------
    simulation : Simulation
        Simulation that no other caller steps meanwhile.
    """

    place = "the simulation in this process"
    waits = False

    def __init__(self, simulation: SteppedSimulation) -> None:
        if not all(callable(getattr(simulation, name, None)) for name in ("register", "launch", "step")):
            raise UsageError(f"simulation: {simulation!r:.60} is no Simulation of simulator_stub.simulation")
        self._simulation = simulation
        self._robot = 0
        self._ready: list[Measures] = []
        self._launched = False

    def register(self, registration: RobotRegistration, give_up_after: float) -> Acceptance:
        """Register a robot; see `Channel.register`."""
        robot = self._simulation.register(registration)
        if robot is None:
            raise refused(self.place, registration.name or "", registration.robot_id)
        self._robot = robot
        world = self._simulation.world
        return Acceptance(parameters=world.parameters, n_beacons=len(world.lab.beacons))

    def send(self, actions: Actions) -> None:
        """Send the command and run one cycle."""
        measures = self._simulation.step({self._robot: actions}).get(self._robot)
        if measures is not None:
            self._ready.append(measures)

    def receive(self, timeout: float) -> list[Measures]:
        """Return the Measures of the last cycle; starts the simulation at the first call."""
        if not self._launched:
            self._launched = True
            self._ready.append(self._simulation.launch()[self._robot])
        ready, self._ready = self._ready, []
        return ready

    def close(self) -> None:
        """Close nothing: the simulation stays as it is."""
