"""TCP: the same messages on a stream, each ended by NUL; one connection for each client.

The first message on a connection is the registration. When a client closes its connection a robot stays in
the world, as one does whose UDP client falls silent.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable

from ciberrato.protocol import MESSAGE_LIMIT
from ciberrato.system.limits import descriptors
from ciberrato.system.sockets import keep_port
from simulator_stub.service.allowance import CLIENT_BYTES, CONNECTIONS, NEWCOMER_BYTES, Allowance, Meter
from simulator_stub.service.readiness import Readiness
from simulator_stub.service.transports.base import NO_ROOM, Newcomer, Peer, Transport, Welcome, ignore

BACKLOG_LIMIT = 1 << 20
"""Bytes that may wait for a client that does not read; beyond them it is cut off."""

UNREGISTERED_LIMIT = 256
"""Connections without a registration; the oldest is closed for one more."""

RESERVE = 16
"""Descriptors that are left for robots over UDP and for files: connections take turns in the rest."""

REGISTRATION_SECONDS = 30.0
"""So long a connection may take to register; it is closed then."""

_QUICK_ACKNOWLEDGEMENT: int | None = getattr(socket, "TCP_QUICKACK", None)
_ONCE = 2
"""Acknowledge what is pending, and go on delaying (an even number that is not 0, in Linux)."""


class TcpTransport(Transport):
    """The listening socket and its connections."""

    name = "tcp"

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._connections: set[TcpPeer] = set()
        self._unregistered: dict[TcpPeer, float] = {}
        self._readiness: Readiness | None = None
        self.port = 0

    def open(self, host: str, port: int) -> None:
        """Listen."""
        keep_port(self._socket)
        self._socket.bind((host, port))
        self._socket.listen()
        self._socket.setblocking(False)
        self.port = self._socket.getsockname()[1]

    def serve(self, readiness: Readiness, welcome: Welcome, meter: Meter) -> None:
        """Accept connections whenever there are some."""
        self._readiness = readiness
        self._welcome = welcome
        self._meter = meter
        self._allowance = Allowance(meter, CONNECTIONS)
        self._places = UNREGISTERED_LIMIT
        self._last_descriptor = descriptors() - RESERVE
        readiness.watch(self._socket, self._accept)

    def _accept(self) -> None:
        self._allowance.left()
        try:
            connection, address = self._socket.accept()
        except OSError as error:
            if error.errno in NO_ROOM:
                self.make_room()
                self._pause(self._allowance.left())
            return
        self._pause(1)
        if connection.fileno() >= self._last_descriptor:
            self._places = max(1, min(self._places, len(self._unregistered)))
        if len(self._unregistered) >= self._places:
            self.make_room()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        assert self._readiness is not None
        label = f"tcp {address[0]}:{address[1]}"
        peer = TcpPeer(self._readiness, self._connections, connection, label, self._meter)
        peer.source = address[0]
        self._unregistered[peer] = self._meter.now + REGISTRATION_SECONDS
        peer.settled = lambda: self._unregistered.pop(peer, None)
        newcomer = TcpNewcomer(peer)
        peer.deliver = lambda data: self._welcome(newcomer, data)

    def _pause(self, cost: int) -> None:
        """Accept no more for the rest of a CycleTime, once there were so many, or no descriptor is left."""
        if self._allowance.spend(cost):
            self._watch(reading=False)
            self._meter.when_renewed(self._allowance, lambda: self._watch(reading=True))

    def _watch(self, *, reading: bool) -> None:
        assert self._readiness is not None
        self._readiness.watch_for(self._socket, reading=reading)

    def make_room(self) -> None:
        """Close the connection that has not registered for longest, if there is one."""
        for peer in self._unregistered:
            self._meter.dropped["connections"] += 1
            peer.close()
            return

    def tick(self, now: float) -> None:
        """Close connections on which no client has registered in time."""
        while self._unregistered:
            peer, deadline = next(iter(self._unregistered.items()))
            if deadline > now:
                return
            self._meter.dropped["connections"] += 1
            peer.close()

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
        self.source = peer.source

    def accept(self) -> Peer:
        """Return the connection itself, which does not listen until it is told to."""
        self._peer.settled()
        self.registered = self._peer
        self._peer.deliver = ignore
        self._peer.widen()
        return self._peer

    def turn_away(self) -> None:
        """Close the connection."""
        self._peer.close()


class TcpPeer(Peer):
    """A connection.

    Attributes
    ----------
    settled : callable
        Called when its client registers, and when it is closed.
    """

    connected = True

    def __init__(
        self,
        readiness: Readiness,
        connections: set[TcpPeer],
        connection: socket.socket,
        label: str,
        meter: Meter,
    ) -> None:
        super().__init__(label)
        self._meter = meter
        self._allowance = Allowance(meter, NEWCOMER_BYTES)
        self._paused = False
        self.settled: Callable[[], object] = lambda: None
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
            if self._paused:
                return
        if not self.closed:
            self._read()

    def _read(self) -> None:
        # Paused and called all the same, it has broken: what is left to read has an end.
        left = NEWCOMER_BYTES if self._paused else self._allowance.left()
        try:
            data = self._socket.recv(left)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        if not data:
            self._drop()
            return
        if self._allowance.spend(len(data)) and not self._paused:
            self._paused = True
            self._watch()
            self._meter.when_renewed(self._allowance, self._read_on)
        if not self._incoming and 0 < data.find(0) == len(data) - 1:  # one whole message: nearly always
            self.deliver(data)
            return
        self._incoming += data
        if b"\0" in data:
            *messages, rest = bytes(self._incoming).split(b"\0")
            self._incoming = bytearray(rest)
            for message in messages:
                if message:  # empty ones cost nothing
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
            self._outgoing += data[sent:]
            self._watch()
            return
        self._outgoing += data
        if len(self._outgoing) > BACKLOG_LIMIT:
            self._drop()

    def _read_on(self) -> None:
        self._paused = False
        if not self.closed:
            self._watch()

    def _watch(self) -> None:
        self._readiness.watch_for(self._socket, reading=not self._paused, writing=bool(self._outgoing))

    @property
    def exhausted(self) -> bool:
        """Return whether it has sent more than is read in a cycle."""
        return self._paused

    def widen(self) -> None:
        """Read as much as of a client that is registered."""
        self._allowance.widen(CLIENT_BYTES, every_cycle=False)

    def serve_every_cycle(self) -> None:
        """Read as much as of a robot; see `Peer.serve_every_cycle`."""
        self._allowance.widen(CLIENT_BYTES, every_cycle=True)

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
            self._watch()

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
            self.settled()
