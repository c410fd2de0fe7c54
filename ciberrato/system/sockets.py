"""Sockets: which are ready, who else may have a port, and when a datagram came."""

from __future__ import annotations

import math
import select
import socket
import struct
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from ciberrato.system.process import apart

if TYPE_CHECKING:
    import subprocess

READING, WRITING = 1, 4
"""Events for which a poller can wait: the values of POLLIN and POLLOUT, which Windows does not name."""

# Linux' option that makes the kernel stamp each datagram; the socket module has no name for it.
_TIMESTAMPS = 35 if sys.platform == "linux" and hasattr(socket.socket, "recvmsg") else None
_STAMP = struct.Struct("@ll")
_LARGEST = 65535
_EXCLUSIVE: int | None = getattr(socket, "SO_EXCLUSIVEADDRUSE", None)


class Poller(Protocol):
    """Waits for several sockets: an ``epoll`` object, or what does the same."""

    def register(self, sock: socket.socket, events: int, /) -> object:
        """Watch a socket for `READING`, `WRITING` or both."""

    def modify(self, sock: socket.socket, events: int, /) -> object:
        """Change what a socket is watched for."""

    def unregister(self, sock: socket.socket, /) -> object:
        """Stop watching it."""

    def poll(self, seconds: float, /) -> list[tuple[int, int]]:
        """Wait, and return descriptors and events of those that are ready."""

    def close(self) -> object:
        """Release the system's resources."""


def poller() -> Poller:
    """Return the fastest poller that there is: epoll (Linux), poll (macOS), or select (Windows)."""
    if hasattr(select, "epoll"):
        fastest: Poller = select.epoll()
        return fastest
    if hasattr(select, "poll"):
        return _Poll()
    return _Select()


class _Poll:
    """`select.poll`, which counts milliseconds; rounded up, so that waiting does not turn into spinning."""

    def __init__(self) -> None:
        self._poll = select.poll()
        self.register, self.modify, self.unregister = (
            self._poll.register,
            self._poll.modify,
            self._poll.unregister,
        )

    def poll(self, seconds: float, /) -> list[tuple[int, int]]:
        return self._poll.poll(math.ceil(seconds * 1000.0))

    def close(self) -> None:
        """Close nothing: no resource is held."""


class _Select:
    """`select.select`, which every system has; at most 512 sockets on Windows."""

    def __init__(self) -> None:
        self._reading: set[int] = set()
        self._writing: set[int] = set()

    def register(self, sock: socket.socket, events: int, /) -> None:
        for wanted, held in ((READING, self._reading), (WRITING, self._writing)):
            if events & wanted:
                held.add(sock.fileno())
            else:
                held.discard(sock.fileno())

    modify = register

    def unregister(self, sock: socket.socket, /) -> None:
        self._reading.discard(sock.fileno())
        self._writing.discard(sock.fileno())

    def poll(self, seconds: float, /) -> list[tuple[int, int]]:
        readable, writable, _ = select.select(self._reading, self._writing, (), seconds)
        return [(found, READING) for found in readable] + [
            (found, WRITING) for found in writable if found not in readable
        ]

    def close(self) -> None:
        """Close nothing: no resource is held."""


def keep_port(sock: socket.socket) -> None:
    """Reserve a port for a socket that is about to be bound, which can be bound again at once.

    Elsewhere than on Windows a port is its owner's anyway, but connections of a program that has just ended
    keep a TCP port for a minute unless SO_REUSEADDR is set. On Windows that option lets others take the port
    away, and SO_EXCLUSIVEADDRUSE is what keeps them off.
    """
    if _EXCLUSIVE is not None:
        sock.setsockopt(socket.SOL_SOCKET, _EXCLUSIVE, 1)
    elif sock.type == socket.SOCK_STREAM:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)


def stamp_arrivals(sock: socket.socket) -> None:
    """Request the kernel's time stamp of each datagram's arrival, where it can."""
    if _TIMESTAMPS is not None:
        sock.setsockopt(socket.SOL_SOCKET, _TIMESTAMPS, 1)


def receive_stamped(sock: socket.socket) -> tuple[bytes, tuple[str, int], float | None]:
    """Receive one datagram.

    Returns
    -------
    data : bytes
    sender : (str, int)
    arrived : float or None
        Seconds by the system's clock; None where the system does not note it.
    """
    if _TIMESTAMPS is None:
        data, sender = sock.recvfrom(_LARGEST)
        return data, sender, None
    data, notes, _, sender = sock.recvmsg(_LARGEST, 64)
    for level, kind, value in notes:
        if level == socket.SOL_SOCKET and kind == _TIMESTAMPS and len(value) >= _STAMP.size:
            seconds, nanoseconds = _STAMP.unpack_from(value)
            return data, sender, float(seconds) + 1e-9 * float(nanoseconds)
    return data, sender, None


CAN_HAND_OVER = hasattr(socket, "send_fds") and hasattr(socket, "AF_UNIX")
"""Whether a socket can be handed over to another process."""


def start_with_channel(command: Sequence[str]) -> tuple[subprocess.Popen[bytes], socket.socket]:
    """Start a process apart that has one end of a stream, and return it with the other end.

    Parameters
    ----------
    command : sequence of str
        The number of its descriptor is added as the last argument; see `inherited_channel`.

    Returns
    -------
    process : Popen
    channel : socket
        Blocking.
    """
    import subprocess

    ours, theirs = socket.socketpair()
    with theirs:
        number = theirs.fileno()
        try:
            process = subprocess.Popen(
                [*command, str(number)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=(number,),
                **apart(),
            )
        except BaseException:
            ours.close()
            raise
    return process, ours


def inherited_channel(number: int) -> socket.socket:
    """Return the end of a stream that `start_with_channel` has left to this process."""
    return socket.socket(fileno=number)


def send_socket(channel: socket.socket, sock: socket.socket) -> None:
    """Send a socket to the process at the other end of a channel; this process keeps it, too."""
    socket.send_fds(channel, [b"."], [sock.fileno()])


def receive_socket(channel: socket.socket) -> socket.socket | None:
    """Wait for a socket from the other end of a channel; None if it has ended."""
    _, descriptors, _, _ = socket.recv_fds(channel, 1, 1)
    return socket.socket(fileno=descriptors[0]) if descriptors else None


def has_address(address: str) -> bool:
    """Return whether an IPv4 address is this machine's: of 127.x macOS has 127.0.0.1 only."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        try:
            sock.bind((address, 0))
        except OSError:
            return False
    return True
