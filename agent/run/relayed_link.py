"""The agent's end of a link that another process has; see `agent.run.answering`."""

from __future__ import annotations

import select
import subprocess
from typing import TYPE_CHECKING

from agent.drives.exchange import Answered
from agent.run.channel import Channel
from agent.run.relay_records import Begin, Decision, End, Fault, Peer, Register, Registered
from ciberrato.net.link import Arrival, LinkError
from ciberrato.processes import module_command
from ciberrato.system.sockets import CAN_HAND_OVER, send_socket, start_with_channel

if TYPE_CHECKING:
    from ciberrato.net.udp import UdpLink

_PATIENCE = 2.0
"""Seconds that the process may take to end."""


class RelayedLink:
    """A link whose messages another process answers; the agent hears them all, and says what it decides.

    Parameters
    ----------
    process : Popen
    channel : Channel
        To it.
    link : UdpLink
        Handed over; the agent uses it itself again when the process has ended.
    """

    refused = False

    def __init__(self, process: subprocess.Popen[bytes], channel: Channel, link: UdpLink) -> None:
        self._process, self._channel, self._link = process, channel, link
        self._told: list[Answered] = []
        self._fault: str | None = None
        self._kept: list[Arrival] = []
        self.registered: float | None = None
        """When the process has sent the last registration, in seconds by the clock that stamps arrivals."""
        self.is_released = False
        """Whether the agent has ended the process."""

    @property
    def answers(self) -> bool:
        """Whether the process still answers."""
        return not self._channel.ended

    def register(self, data: bytes) -> None:
        """Send a registration, as soon as the process is ready to answer; see `Link.register`."""
        if self.answers:
            self._channel.send(Register(data))
        else:
            self._link.register(data)
        self._complain()

    def send(self, data: bytes) -> None:
        """Send a message past the process, once it has ended; see `Link.send`."""
        self.release()
        self._link.send(data)

    def decide(self, time: int, data: bytes) -> None:
        """Send a decision.

        Parameters
        ----------
        time : int
            Of the message that it answers, in simulated cycles.
        data : bytes
            Actions.

        Raises
        ------
        LinkError
            If the link has not carried the last answer.
        """
        if self.answers:
            self._channel.send(Decision(time, data))
        else:
            self._link.send(data)
        self._complain()

    def _complain(self) -> None:
        if self._fault is not None:
            fault, self._fault = self._fault, None
            raise LinkError(fault)

    def told(self) -> list[Answered]:
        """Return what the process has sent, as far as it is known since the last call."""
        told, self._told = self._told, []
        return told

    def receive(self, timeout: float | None) -> bytes | None:
        """Wait for one message; see `Link.receive`. Nothing waits here: see `receive_arrivals`."""
        return self._link.receive(timeout)

    def receive_waiting(self) -> list[bytes]:
        """Return the messages that have already arrived; see `Link.receive_waiting`."""
        return [arrival.data for arrival in self.receive_arrivals()]

    def receive_arrivals(self) -> list[Arrival]:
        """Return them with the times of their arrival; see `Link.receive_arrivals`."""
        if not self.is_released:
            self._read()
        arrivals, self._kept = self._kept, []
        if self._channel.ended:
            arrivals += self._link.receive_arrivals()
        return arrivals

    def _read(self) -> None:
        for record in self._channel.receive():
            if isinstance(record, Answered):
                self._told.append(record)
            elif isinstance(record, Fault):
                self._fault = record.text
            elif isinstance(record, Registered):
                self.registered = record.time
            elif isinstance(record, Peer):
                self._link.peer = (record.host, record.port)
            else:
                self._kept += record

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when something arrives."""
        return self._link.fileno() if self._channel.ended else self._channel.fileno()

    def wait(self, timeout: float) -> None:
        """Wait until something arrives, or time is up."""
        select.select([self.fileno()], [], [], timeout)

    def abandon(self) -> None:
        """Close the way to the process, as the end of this one would: it stops the robot, and ends."""
        self._channel.close()

    def release(self) -> None:
        """End the process: nothing that it would send may come after what the agent sends itself.

        What it has received until then is still there to be received.
        """
        if self._process.returncode is not None:
            return
        self.is_released = True
        if not self._channel.ended:
            self._channel.send(End())
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._read()
        self._channel.close()

    def close(self) -> None:
        """Close the link; see `Link.close`."""
        self.release()
        self._link.close()


class Relay:
    """Starts the process that will answer, while the agent prepares and registers."""

    def __init__(self) -> None:
        self.process, self._socket = start_with_channel(module_command("agent.run.answering"))

    def take_over(
        self, link: UdpLink, angles: tuple[float, ...], cruise: float, *, roams: bool
    ) -> RelayedLink:
        """Send a link that has not registered yet to the process, and return the agent's end.

        Parameters
        ----------
        link : UdpLink
        angles : tuple of float
            Mounting angles of the IR sensors in degrees.
        cruise : float
        roams : bool
            See `agent.drives.reflex.Reflex`.
        """
        send_socket(self._socket, link.endpoint)
        channel = Channel(self._socket)
        channel.send(Begin(*link.main, angles, cruise, roams))
        return RelayedLink(self.process, channel, link)

    def close(self) -> None:
        """End the process, if nothing was handed over to it or it runs still."""
        self._socket.close()
        try:
            self.process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def can_relay() -> bool:
    """Return whether this system can hand a socket over to another process."""
    return CAN_HAND_OVER
