"""UDP, as the real simulator speaks it: one socket for registrations, and one for each client.

The client's socket is where its Reply comes from and where it sends everything else. Datagrams on it that
do not come from the address and port that registered are dropped.
"""

from __future__ import annotations

import contextlib
import socket
import struct

from ciberrato.protocol import encode
from ciberrato.protocol.binary import decode_binary_registration, is_binary_registration
from ciberrato.system.sockets import keep_port
from simulator_stub.service.allowance import (
    CLIENT_BYTES,
    LEAST_COST,
    MAIN_DATAGRAMS,
    MAIN_RATE,
    REGISTRATION_COST,
    Allowance,
    Meter,
)
from simulator_stub.service.readiness import Readiness
from simulator_stub.service.transports.base import Newcomer, Peer, Transport, Welcome
from simulator_stub.service.transports.binary import BinaryNewcomer

READ_SIZE = 2048
"""Bytes read of a datagram: more than any message may have, so that one too long can be told."""

AT_ONCE = 20
"""Datagrams that are read from the main socket before others have their turn."""

REFUSALS = 100
"""So many datagrams in a row that a machine has refused, and its client counts as lost."""

_SO_MEMINFO = 55
_DROPS = 8
"""Linux: what the system keeps of a socket, in words of 32 bits; the ninth counts datagrams dropped."""

Address = tuple[str, int]


class UdpTransport(Transport):
    """The main socket, and those of the clients."""

    name = "udp"

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._host = ""
        self._peers: set[UdpPeer] = set()
        self._readiness: Readiness | None = None
        self.port = 0

    def open(self, host: str, port: int) -> None:
        """Bind the main socket, exclusively."""
        keep_port(self._socket)
        self._socket.bind((host, port))
        self._socket.setblocking(False)
        self._host = host
        self.port = self._socket.getsockname()[1]

    def serve(self, readiness: Readiness, welcome: Welcome, meter: Meter) -> None:
        """Read registrations whenever there are some."""
        self._readiness = readiness
        self._welcome = welcome
        self.meter = meter
        self._allowance = Allowance(meter, max(MAIN_DATAGRAMS, int(MAIN_RATE * meter.tick_seconds)))
        self._overflow = Overflow(self._socket)
        readiness.watch(self._socket, self._read)

    def _read(self) -> None:
        if self._allowance.left() <= 0:  # called because of an error, while nothing is to be read
            self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            return
        for _ in range(AT_ONCE):
            try:
                data, address = self._socket.recvfrom(READ_SIZE)
            except OSError:  # nothing there after all, or an answer that could not be delivered
                return
            newcomer: Newcomer = UdpNewcomer(self, address)
            if is_binary_registration(data):
                newcomer = BinaryNewcomer(newcomer)
                data = encode(decode_binary_registration(data))
            if self._allowance.spend(REGISTRATION_COST if self._welcome(newcomer, data) else 1):
                self._watch_main(reading=False)
                self.meter.when_renewed(self._allowance, lambda: self._watch_main(reading=True))
                return

    def _watch_main(self, *, reading: bool) -> None:
        assert self._readiness is not None
        self._readiness.watch_for(self._socket, reading=reading)

    def tick(self, now: float) -> None:
        """Count what the system has dropped at the main port."""
        dropped = self._overflow.count()
        if dropped:
            self.meter.dropped["main_port"] += dropped

    def connect(self, address: Address) -> UdpPeer:
        """Open a socket of its own for a client."""
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        own.bind((self._host, 0))
        own.setblocking(False)
        # From here on the kernel drops what others send; what came before is dropped here.
        own.connect(address)
        with contextlib.suppress(OSError):
            while True:
                own.recv(1)
        assert self._readiness is not None
        peer = UdpPeer(self, self._readiness, own, address)
        self._peers.add(peer)
        self._readiness.watch(own, peer.read)
        return peer

    def release(self, peer: UdpPeer, own: socket.socket) -> None:
        """Close a client's socket."""
        assert self._readiness is not None
        self._readiness.forget(own)
        own.close()
        self._peers.discard(peer)

    def close(self) -> None:
        """Close all sockets."""
        for peer in tuple(self._peers):
            peer.close()
        if self._readiness is not None:
            self._readiness.forget(self._socket)
        self._socket.close()


class UdpNewcomer(Newcomer):
    """The sender of a datagram to the main socket."""

    def __init__(self, transport: UdpTransport, address: Address) -> None:
        self._transport = transport
        self._address = address
        self.source = address[0]

    @property
    def label(self) -> str:  # type: ignore[override]
        """Return transport and address; most are never shown."""
        return f"udp {self._address[0]}:{self._address[1]}"

    def accept(self) -> Peer:
        """Open a socket for it."""
        return self._transport.connect(self._address)


class UdpPeer(Peer):
    """A client with a socket of its own on our side."""

    def __init__(
        self, transport: UdpTransport, readiness: Readiness, own: socket.socket, address: Address
    ) -> None:
        super().__init__(f"udp {address[0]}:{address[1]}")
        self._transport = transport
        self._readiness = readiness
        self._socket = own
        self._allowance = Allowance(transport.meter, CLIENT_BYTES)
        self._overflow = Overflow(own)
        self._refused = 0
        self._pauses = False
        self.ends = ("udp", address, own.getsockname())
        self.source = address[0]

    def read(self) -> None:
        """Read one datagram."""
        if self._pauses and self._allowance.left() <= 0:  # called because of an error: nothing is to be read
            self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            return
        try:
            data = self._socket.recv(READ_SIZE)
        except OSError:  # nothing there after all, or no client was there for what was sent last
            return
        size = len(data)
        if self._allowance.take(size if size > LEAST_COST else LEAST_COST):
            self._pauses = True
            self._readiness.watch_for(self._socket, reading=False)
            self._transport.meter.when_renewed(self._allowance, self._read_on)
        self._refused = 0
        self.deliver(data)

    def _read_on(self) -> None:
        self._pauses = False
        if not self.closed:
            self._readiness.watch_for(self._socket, reading=True)

    @property
    def exhausted(self) -> bool:
        """Whether it has sent more than is read in a cycle."""
        return self._allowance.exhausted

    def serve_every_cycle(self) -> None:
        """Read as much as of a robot; see `Peer.serve_every_cycle`."""
        self._allowance.every_cycle = True

    def overflow(self) -> int:
        """Return what the system has dropped; see `Peer.overflow`."""
        return 0 if self.closed else self._overflow.count()

    def send(self, data: bytes) -> None:
        """Send a datagram; if it cannot be sent it is lost, as any datagram may be."""
        if self.closed:
            return
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            # No client was there for the one before; one may be there now.
            self._refused += 1
            self.lost = self._refused >= REFUSALS
            with contextlib.suppress(OSError):
                self._socket.send(data)
        except OSError:
            return
        else:
            self._refused = 0

    def close(self) -> None:
        """Close the socket."""
        if not self.closed:
            self.closed = True
            self._transport.release(self, self._socket)


class Overflow:
    """Counts what the system drops at a socket because it is not read fast enough; 0 where it does not tell.

    Parameters
    ----------
    sock : socket.socket
    """

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._counted = 0

    def count(self) -> int:
        """Return how many datagrams were dropped since the last call."""
        try:
            words = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * (_DROPS + 1))
            dropped = int(struct.unpack_from("=I", words, 4 * _DROPS)[0])
        except (OSError, struct.error):
            return 0
        new, self._counted = dropped - self._counted, dropped
        return new
