"""TCP: the same messages on a stream, each ended by NUL; one connection for each client.

The first message on a connection is the registration. When a client closes its connection a robot stays in
the world, as one does whose UDP client falls silent.
"""

from __future__ import annotations

import contextlib
import socket

from ciberrato.protocol import MESSAGE_LIMIT
from simulator_stub.service.readiness import Readiness
from simulator_stub.service.transports.base import Newcomer, Peer, Transport, Welcome, ignore

READ_SIZE = 65536
"""Bytes read at a time."""

BACKLOG_LIMIT = 1 << 20
"""Bytes that may wait for a client that does not read; beyond them it is cut off."""

CONNECTION_LIMIT = 512
"""Connections at a time; further ones are closed at once."""

_QUICK_ACKNOWLEDGEMENT: int | None = getattr(socket, "TCP_QUICKACK", None)
_ONCE = 2
"""Acknowledge what is pending, and go on delaying (an even number that is not 0, in Linux)."""


class TcpTransport(Transport):
    """The listening socket and its connections."""

    name = "tcp"

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._connections: set[TcpPeer] = set()
        self._readiness: Readiness | None = None
        self.port = 0

    def open(self, host: str, port: int) -> None:
        """Listen."""
        # Without this, connections of a simulator that has just ended keep the port for a minute.
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind((host, port))
        self._socket.listen()
        self._socket.setblocking(False)
        self.port = self._socket.getsockname()[1]

    def serve(self, readiness: Readiness, welcome: Welcome) -> None:
        """Accept connections whenever there are some."""
        self._readiness = readiness
        self._welcome = welcome
        readiness.watch(self._socket, self._accept)

    def _accept(self) -> None:
        try:
            connection, address = self._socket.accept()
        except OSError:
            return
        if len(self._connections) >= CONNECTION_LIMIT:
            connection.close()
            return
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        assert self._readiness is not None
        peer = TcpPeer(self._readiness, self._connections, connection, f"tcp {address[0]}:{address[1]}")
        newcomer = TcpNewcomer(peer)
        peer.deliver = lambda data: self._welcome(newcomer, data)

    def close(self) -> None:
        """Close all connections and stop listening."""
        for peer in tuple(self._connections):
            peer.close()
        if self._readiness is not None:
            self._readiness.forget(self._socket)
        self._socket.close()


class TcpNewcomer(Newcomer):
    """A connection without a registration so far."""

    def __init__(self, peer: TcpPeer) -> None:
        self._peer = peer
        self.label = peer.label

    def accept(self) -> Peer:
        """Return the connection itself, which does not listen until it is told to."""
        self.registered = self._peer
        self._peer.deliver = ignore
        return self._peer


class TcpPeer(Peer):
    """A connection."""

    def __init__(
        self,
        readiness: Readiness,
        connections: set[TcpPeer],
        connection: socket.socket,
        label: str,
    ) -> None:
        super().__init__(label)
        self._readiness = readiness
        self._connections = connections
        self._socket = connection
        self._incoming = bytearray()
        self._outgoing = bytearray()
        connection.setblocking(False)
        with contextlib.suppress(OSError):  # it may have gone already
            self.ends = ("tcp", connection.getpeername(), connection.getsockname())
        connections.add(self)
        readiness.watch(connection, self._ready)

    def _ready(self) -> None:
        if self._outgoing:
            self._flush()
        if not self.closed:
            self._read()

    def _read(self) -> None:
        try:
            data = self._socket.recv(READ_SIZE)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        if not data:
            self._drop()
            return
        if not self._incoming and data.find(0) == len(data) - 1:  # one whole message: nearly always
            self.deliver(data)
            return
        self._incoming += data
        if b"\0" in data:
            *messages, rest = bytes(self._incoming).split(b"\0")
            self._incoming = bytearray(rest)
            for message in messages:
                self.deliver(message)
        if len(self._incoming) > MESSAGE_LIMIT:
            self._drop()

    def send(self, data: bytes) -> None:
        """Send a message, now or as soon as the client reads."""
        if self.closed:
            return
        if not self._outgoing:
            try:
                sent = self._socket.send(data)
            except (BlockingIOError, InterruptedError):
                sent = 0
            except OSError:
                self._drop()
                return
            if sent == len(data):
                return
            data = data[sent:]
            self._readiness.watch_writing(self._socket, wanted=True)
        self._outgoing += data
        if len(self._outgoing) > BACKLOG_LIMIT:
            self._drop()

    def acknowledge(self) -> None:
        """Acknowledge at once what has come.

        A client that has not set TCP_NODELAY holds a second short message back until the first one is
        acknowledged (Nagle, RFC 896), which our system would do with the next Measures (delayed
        acknowledgements, RFC 1122 4.2.3.2).
        """
        if _QUICK_ACKNOWLEDGEMENT is not None and not self.closed:
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.IPPROTO_TCP, _QUICK_ACKNOWLEDGEMENT, _ONCE)

    def _flush(self) -> None:
        try:
            sent = self._socket.send(self._outgoing)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            self._drop()
            return
        del self._outgoing[:sent]
        if not self._outgoing:
            self._readiness.watch_writing(self._socket, wanted=False)

    def close(self) -> None:
        """Close the connection; what could not be sent by then is tried once more."""
        if not self.closed:
            if self._outgoing:
                with contextlib.suppress(OSError):
                    self._socket.send(self._outgoing)
            self._drop()

    def _drop(self) -> None:
        if not self.closed:
            self.closed = True
            self._readiness.forget(self._socket)
            self._socket.close()
            self._connections.discard(self)
