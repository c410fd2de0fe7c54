"""Interface of links to a simulator, for all transports."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from ciberrato.errors import CiberratoError
from ciberrato.reprs import short_repr


class LinkError(CiberratoError):
    """The network does not carry the message; trying again may help."""


class LinkClosedError(LinkError):
    """The peer has closed the connection, or left it; registering again opens a new one."""


class Arrival(NamedTuple):
    """A message and when it arrived.

    Attributes
    ----------
    data : bytes
        With its terminator.
    time : float or None
        Seconds by the system's clock (`time.time`) at which this machine had it, however late it was taken;
        None where the network does not report it.
    """

    data: bytes
    time: float | None

    def __repr__(self) -> str:
        return short_repr(self)


class Link(Protocol):
    """A client's way to one simulator.

    Nothing blocks but `receive` (and, over TCP, `register` while it connects). A link belongs to one thread.
    """

    refused: bool
    """Return whether the machine has said at the last `register` that no program listens there (TCP only)."""

    def register(self, data: bytes) -> None:
        """Send a registration to the main port.

        A simulator that is not there (yet) is no error: nothing will be received. Calling it again is
        trying again; where a peer has answered already it begins anew, and the old peer is not heard again.

        Parameters
        ----------
        data : bytes
            One message.

        Raises
        ------
        LinkError
            If this machine cannot send at all.
        """

    def send(self, data: bytes) -> None:
        """Send a message to the simulator that has answered.

        Parameters
        ----------
        data : bytes
            One message.

        Raises
        ------
        LinkError
            If no peer has answered yet, or this machine cannot send at all.
        LinkClosedError
            If the connection is gone (TCP only; UDP cannot detect it).
        """

    def receive(self, timeout: float | None) -> bytes | None:
        """Wait for one message.

        Parameters
        ----------
        timeout : float or None
            Seconds; None waits without limit, 0 not at all.

        Returns
        -------
        bytes or None
            The message with its terminator; None if none came in time.

        Raises
        ------
        LinkClosedError
            If the connection is gone and every complete message was delivered (TCP only).
        """

    def receive_waiting(self) -> list[bytes]:
        """Return the messages that have already arrived, oldest first; never blocks.

        Raises
        ------
        LinkClosedError
            If the connection is gone and every complete message was delivered (TCP only).
        """

    def receive_arrivals(self) -> list[Arrival]:
        """Receive messages as `receive_waiting` does, with the time of each message's arrival.

        Raises
        ------
        LinkClosedError
            See `receive_waiting`.
        """

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when something arrives.

        It may change with `register`. Messages that are already taken off the network do not make it
        readable: call `receive_waiting` before waiting on it.
        """

    def close(self) -> None:
        """Close the link; closing again is harmless."""
