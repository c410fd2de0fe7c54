"""Interfaces of a transport for the server, and of a client inside the simulator."""

from __future__ import annotations

import errno
from abc import ABC, abstractmethod
from collections.abc import Callable

from simulator_stub.service.allowance import Meter
from simulator_stub.service.readiness import Readiness

NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
"""Errors of a system without a descriptor, or memory, for one more socket: it may have them later."""

Ends = tuple[str, tuple[str, int], tuple[str, int]]


class Peer(ABC):
    """One registered client, as its transport reaches it.

    Attributes
    ----------
    deliver : callable
        Called with each message that the client sends; set where the client is accepted.
    label : str
        Transport and address, for people.
    closed : bool
        Whether nothing can reach the client any more, as far as is known.
    ends : (str, (str, int), (str, int)) or None
        Transport, the client's address and port, and ours, where these tell its socket from all others.
    source : str
        The address of its machine.
    lost : bool
        Whether its machine has said, again and again, that no client is there any more.
    """

    connected = False
    """Whether `closed` tells when the client has gone."""

    def __init__(self, label: str) -> None:
        self.deliver: Callable[[bytes], object] = ignore
        self.label = label
        self.closed = False
        self.ends: Ends | None = None
        self.source = ""
        self.lost = False

    @property
    def exhausted(self) -> bool:
        """Whether it has sent more than is read in a cycle."""
        return False

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a message, or lose it: no client may hold up the simulation."""

    def acknowledge(self) -> None:  # noqa: B027 - most transports have nothing to do
        """Acknowledge messages, so that the client's system sends what it holds back until then."""

    def serve_every_cycle(self) -> None:  # noqa: B027 - as above
        """Read as much of this client as of a robot: its allowance is renewed with each cycle."""

    def overflow(self) -> int:
        """Return how many unread messages the system has dropped since the last call."""
        return 0

    @abstractmethod
    def close(self) -> None:
        """Close the client; what was sent still goes out. Closing twice does no harm."""


class Newcomer(ABC):
    """Origin of a registration.

    Attributes
    ----------
    label : str
        Transport and address, for people.
    registered : Peer or None
        The channel, once it has one: what was sent after the registration, but before it was looked at,
        belongs there. Only where messages of one client keep their order can this be known.
    source : str
        The address of its machine.
    followers : list of bytes or None
        Messages after a registration that waits; None while none waits.
    faults : int
        Messages that were no registrations.
    """

    label: str
    source: str = ""
    registered: Peer | None = None
    followers: list[bytes] | None = None
    faults: int = 0

    @abstractmethod
    def accept(self) -> Peer:
        """Open the client's own channel; its Reply goes out on it, also a refusal."""

    def turn_away(self) -> None:  # noqa: B027 - where nothing is open there is nothing to close
        """Close a client that does not register."""


Welcome = Callable[[Newcomer, bytes], bool]
"""Called with each message that comes from an address that has not registered; False for what is evidently no
registration, and has cost next to nothing."""


class Transport(ABC):
    """A way for messages to come and go. It owns its sockets and puts them under a common watch."""

    name: str
    """On the command line and in the line that is printed."""

    port: int
    """The port that is listened on."""

    @abstractmethod
    def open(self, host: str, port: int) -> None:
        """Open the transport; port 0 chooses any free one.

        Raises
        ------
        OSError
            If that is not possible.
        """

    @abstractmethod
    def serve(self, readiness: Readiness, welcome: Welcome, meter: Meter) -> None:
        """Serve the open socket; newcomers' messages go to `welcome`, as many as `meter` allows."""

    def tick(self, now: float) -> None:  # noqa: B027 - most have nothing to do
        """Close what takes too long; called once per CycleTime, with the meter's time in seconds."""

    def make_room(self) -> None:  # noqa: B027 - most have nothing to let go of
        """Close a client that has not registered: one that has needs a descriptor."""

    @abstractmethod
    def close(self) -> None:
        """Close everything that is still open."""


def ignore(data: bytes) -> None:
    """Ignore messages of a client that is not listened to."""
