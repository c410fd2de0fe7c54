"""Records that the agent sends to the process that answers for it, and that come back.

Back come lists of `ciberrato.net.link.Arrival`, and `agent.drives.exchange.Answered` for what was sent. They
are not in the process's own module, which has another name while it runs as a program.
"""

from __future__ import annotations

from typing import NamedTuple


class Begin(NamedTuple):
    """First record to the process: the simulator's address, and what is known before the registration.

    The link's socket came before.
    """

    host: str
    port: int
    angles: tuple[float, ...]
    cruise: float
    roams: bool


class Register(NamedTuple):
    """A registration that is to be sent, if none has been accepted yet."""

    data: bytes


class Registered(NamedTuple):
    """The registration has left, at a moment in seconds by the clock that stamps arrivals."""

    time: float


class Peer(NamedTuple):
    """Address and port from which the simulator has answered."""

    host: str
    port: int


class Decision(NamedTuple):
    """A decision on the message of a time, encoded."""

    time: int
    data: bytes


class End(NamedTuple):
    """The last record to the process: it sends nothing any more."""


class Fault(NamedTuple):
    """The link does not carry messages."""

    text: str
