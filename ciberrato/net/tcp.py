"""The link over TCP: the same messages on a stream, each ended by its NUL, one connection a client."""

from __future__ import annotations

import errno
import select
import socket
import time

from ciberrato.errors import ProtocolError
from ciberrato.net.address import resolve
from ciberrato.net.link import Arrival, LinkClosedError, LinkError
from ciberrato.protocol.framing import MessageSplitter

_CONNECT_SECONDS = 2.0
_SEND_SECONDS = 2.0
_SEGMENT = 65536
_MOST_AT_ONCE = 100
"""Segments that one call takes, so that a flood cannot keep it from returning."""


class TcpLink:
    """A client's link over TCP, to a simulator that offers it (the real one does not).

    `register` connects; the connection then carries everything. `LinkClosedError` is its end, not silence.

    Parameters
    ----------
    host : str
        Name or IPv4 address; looked up once.
    port : int
        The simulator's main port.

    Raises
    ------
    UsageError
        If there is no such host.
    """

    def __init__(self, host: str, port: int) -> None:
        self._main = resolve(host, port)
        self.refused = False
        self._socket = _placeholder()
        self._connected = False
        self._answered = False
        self._splitter = MessageSplitter()
        self._complete: list[bytes] = []
        self._end: str | None = None

    @property
    def peer(self) -> tuple[str, int] | None:
        """Address and port that the link is connected to, or None."""
        return self._main if self._connected and self._end is None else None

    def register(self, data: bytes) -> None:
        """Connect and send a registration; see `Link.register`.

        Where the connection stands and nothing has come back, the registration is on its way: nothing is
        done.
        """
        if self.peer is not None and not self._answered:
            return
        self._take_over(self._connect())
        if self._connected:
            try:
                self.send(data)
            except LinkClosedError:
                self._take_over(None)

    def send(self, data: bytes) -> None:
        """Send a message; see `Link.send`. Its NUL is added where it is missing."""
        if self._end is not None:
            raise LinkClosedError(self._end)
        if not self._connected:
            raise LinkError(f"not connected to {self._main[0]}:{self._main[1]}")
        rest = memoryview(data if data.endswith(b"\0") else data + b"\0")
        while rest:
            try:
                rest = rest[self._socket.send(rest) :]
            except BlockingIOError:
                _, writable, _ = select.select((), (self._socket,), (), _SEND_SECONDS)
                if not writable:
                    self._end = f"the simulator has not read for {_SEND_SECONDS:g} s"
                    raise LinkClosedError(self._end) from None
            except OSError as error:
                while self._read():  # what the simulator said before it left is still to be had
                    pass
                self._end = f"the connection is broken: {error.strerror}"
                raise LinkClosedError(self._end) from None

    def receive(self, timeout: float | None) -> bytes | None:
        """Wait for one message; see `Link.receive`."""
        deadline = None if timeout is None else time.monotonic() + timeout
        remaining = timeout
        while not self._complete:
            if self._end is not None:
                raise LinkClosedError(self._end)
            readable, _, _ = select.select((self._socket,), (), (), remaining)
            if readable:
                self._read()
            elif deadline is not None:
                return None
            if deadline is not None:
                remaining = max(0.0, deadline - time.monotonic())
        return self._complete.pop(0)

    def receive_waiting(self) -> list[bytes]:
        """Return the messages that have already arrived; see `Link.receive_waiting`."""
        for _ in range(_MOST_AT_ONCE):
            if self._end is not None or not self._read():
                break
        if self._end is not None and not self._complete:
            raise LinkClosedError(self._end)
        messages, self._complete = self._complete, []
        return messages

    def receive_arrivals(self) -> list[Arrival]:
        """Return them without times, which a stream does not have; see `Link.receive_arrivals`."""
        return [Arrival(data, None) for data in self.receive_waiting()]

    def fileno(self) -> int:
        """Return the socket's descriptor; see `Link.fileno`."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the connection; see `Link.close`."""
        self._socket.close()

    def __enter__(self) -> TcpLink:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take_over(self, connection: socket.socket | None) -> None:
        """Replace the connection by another one, or none."""
        self._socket.close()
        self._connected = connection is not None
        self._answered = False
        self._splitter = MessageSplitter()
        self._complete = []
        self._end = None
        self._socket = connection or _placeholder()
        self._socket.setblocking(False)

    def _connect(self) -> socket.socket | None:
        """Open a connection; None if no program listens there."""
        self.refused = False
        try:
            connection = socket.create_connection(self._main, timeout=_CONNECT_SECONDS)
        except (ConnectionError, TimeoutError) as error:
            self.refused = isinstance(error, ConnectionRefusedError)
            return None
        except OSError as error:
            if error.errno == errno.EHOSTUNREACH:
                return None
            address = f"{self._main[0]}:{self._main[1]}"
            raise LinkError(f"cannot connect to {address}: {error.strerror}") from None
        if connection.getsockname() == connection.getpeername():
            # Knocking at a free port of this machine again and again can meet itself.
            connection.close()
            return None
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection

    def _read(self) -> bool:
        """Read one segment; return False if there is none."""
        if not self._connected:
            return False
        try:
            data = self._socket.recv(_SEGMENT)
        except BlockingIOError:
            return False
        except OSError as error:
            self._end = f"the connection is broken: {error.strerror}"
            return False
        if not data:
            self._end = "the simulator has closed the connection"
            return False
        self._answered = True
        try:
            self._complete += self._splitter.feed(data)
        except ProtocolError as error:
            self._end = str(error)
            return False
        return True


def _placeholder() -> socket.socket:
    """Create a socket that never becomes readable; an unconnected TCP one would always be."""
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
