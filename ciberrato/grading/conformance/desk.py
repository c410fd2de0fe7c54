"""The simulator's end of the wire, as the examiner holds it: registrations, one agent, and what it sends.

Cycles are those of a `Simulation`; which of its Measures reach the agent, when and how often is up to the
caller.
"""

from __future__ import annotations

import contextlib
import socket
import time
from typing import TYPE_CHECKING

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    ACTIONS_LIMIT,
    REGISTRATION_LIMIT,
    Actions,
    Measures,
    Refusal,
    RobotRegistration,
    decode_actions,
    decode_registration,
    encode,
    fit_reply,
)

if TYPE_CHECKING:
    from simulator_stub.simulation import Simulation

_MOST_AT_ONCE = 10_000


class Fault(Exception):  # noqa: N818 - it is the agent's, not ours
    """Fault of the agent, in words."""


class Gone(Exception):  # noqa: N818 - to end is what some rows expect
    """The agent has closed its socket."""


class Desk:
    """Talks with one agent.

    Parameters
    ----------
    simulation : Simulation
    host, port : str, int
        Host and port of the main socket.
    """

    def __init__(self, simulation: Simulation, host: str, port: int) -> None:
        self.simulation = simulation
        self.answered = 0
        self.driving = False
        """Whether one of the last messages had a motor command other than 0."""
        self._host = host
        self._main = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._main.bind((host, port))
        self.port: int = self._main.getsockname()[1]
        self._own: socket.socket | None = None
        self._robot = 0
        self._held: list[Actions] = []

    # --- registration -----------------------------------------------------------------------------

    def await_registration(self) -> RobotRegistration:
        """Wait for a registration; the parent process limits the time.

        Raises
        ------
        Fault
            If something else comes.
        """
        data, self._client = self._main.recvfrom(1 << 16)
        try:
            registration = decode_registration(data)
        except ProtocolError as error:
            raise Fault(f"the registration cannot be understood: {error}") from None
        if len(data) > REGISTRATION_LIMIT + 1:
            raise Fault(f"the registration has {len(data)} bytes; {REGISTRATION_LIMIT} are read")
        if not isinstance(registration, RobotRegistration):
            raise Fault(f"the registration is no <Robot>: {data[:60].decode('utf-8', 'replace')!r}")
        return registration

    def refuse(self) -> None:
        """Refuse it."""
        self._main.sendto(encode(Refusal()), self._client)

    def accept(self, registration: RobotRegistration) -> Measures:
        """Accept it.

        Returns
        -------
        Measures
            The first ones, of a stopped simulator; not yet sent.

        Raises
        ------
        Fault
            If its position is not in the start grid.
        """
        robot = self.simulation.register(registration)
        if robot is None:
            raise Fault(
                f"it asks for start position {registration.robot_id}, which the simulator does not have"
            )
        self._robot = robot
        self._own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._own.bind((self._host, 0))
        self._own.connect(self._client)
        self.send(encode(fit_reply(self.simulation.acceptance())))
        return self.compute()

    def registrations(self) -> list[tuple[str, int]]:
        """Return from where others registered since; a repetition of the same is none."""
        self._main.setblocking(False)
        others = []
        with contextlib.suppress(OSError):
            while True:
                others.append(self._main.recvfrom(1 << 16)[1])
        return [address for address in others if address != self._client]

    # --- cycles -----------------------------------------------------------------------------------

    def compute(self) -> Measures:
        """Run a cycle of the simulation with what the agent has sent.

        Returns
        -------
        Measures
            Not yet sent.
        """
        held, self._held = self._held, []
        self.simulation.begin_cycle()
        for actions in held:
            self.simulation.act(self._robot, actions)
        if self.simulation.restart_requested:
            self.simulation.restart()
        measures = self.simulation.advance()[self._robot]
        self.simulation.end_cycle()
        return measures

    def send(self, data: bytes) -> None:
        """Send something.

        Raises
        ------
        Gone
        """
        assert self._own is not None
        try:
            self._own.send(data)
        except ConnectionError:
            raise Gone from None

    def deliver(self, *measures: Measures) -> None:
        """Send Measures; what has come until now does not answer them."""
        self.take(0.0)
        for one in measures:
            self.send(encode(one))

    def answer(self, seconds: float, what: Measures) -> bool:
        """Wait for an answer.

        Returns
        -------
        bool
            Whether one came in time.

        Raises
        ------
        Gone
        Fault
            If it cannot be understood.
        """
        count = self.take(seconds, what)
        self.answered += count > 0
        return count > 0

    def take(self, seconds: float, what: Measures | None = None, *, until_first: bool = True) -> int:
        """Process the messages that have arrived.

        Parameters
        ----------
        seconds : float
            Time to wait.
        what : Measures or None
            Message that it answers, for the words of a fault.
        until_first : bool
            Return as soon as something has come, and all that is there by then is taken.

        Returns
        -------
        int
            Number of messages.

        Raises
        ------
        Gone, Fault
        """
        assert self._own is not None
        until = time.monotonic() + seconds
        count = 0
        while True:
            left = until - time.monotonic()
            wait = 0.0 if count and until_first else max(left, 0.0)
            self._own.settimeout(wait)
            try:
                data = self._own.recv(1 << 16)
            except (TimeoutError, BlockingIOError):
                return count
            except ConnectionError:
                if count:
                    return count  # it said goodbye; the next message finds it gone
                raise Gone from None
            self._understand(data, what)
            count += 1
            if count >= _MOST_AT_ONCE:
                return count

    def _understand(self, data: bytes, what: Measures | None) -> None:
        where = "" if what is None else f" after the Measures of time {what.time}"
        size = len(data.partition(b"\0")[0])
        if size > ACTIONS_LIMIT:
            raise Fault(f"a message{where} has {size} bytes; the simulator reads {ACTIONS_LIMIT}")
        try:
            actions = decode_actions(data)
        except ProtocolError as error:
            raise Fault(f"a message{where} cannot be understood: {error}") from None
        self._held.append(actions)
        powers = (actions.left_motor, actions.right_motor)
        if powers != (None, None):
            self.driving = any(powers)
        if actions.end_led:
            raise Fault(
                f"the robot has switched EndLed on{where}: its run was over before the check was; "
                "choose a lab that takes it longer"
            )

    def close(self) -> None:
        """Close the sockets: for the agent the simulator is gone."""
        self._main.close()
        if self._own is not None:
            self._own.close()
