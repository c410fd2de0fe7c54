"""UDP, as the real simulator speaks it: one socket for registrations, and one for each client.

The client's socket is where its Reply comes from and where it sends everything else. Datagrams on it that
do not come from the address and port that registered are dropped.
"""

from __future__ import annotations

import contextlib
import socket

from ciberrato.protocol import encode
from ciberrato.protocol.binary import decode_binary_registration, is_binary_registration
from simulator_stub.service.readiness import Readiness
from simulator_stub.service.transports.base import Newcomer, Peer, Transport, Welcome
from simulator_stub.service.transports.binary import BinaryNewcomer

READ_SIZE = 2048
"""Bytes read of a datagram: more than any message may have, so that one too long can be told."""

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
        self._socket.bind((host, port))
        self._socket.setblocking(False)
        self._host = host
        self.port = self._socket.getsockname()[1]

    def serve(self, readiness: Readiness, welcome: Welcome) -> None:
        """Read registrations whenever there are some."""
        self._readiness = readiness
        self._welcome = welcome
        readiness.watch(self._socket, self._read)

    def _read(self) -> None:
        try:
            data, address = self._socket.recvfrom(READ_SIZE)
        except OSError:  # nothing there after all, or an answer that could not be delivered
            return
        newcomer = UdpNewcomer(self, address)
        if is_binary_registration(data):
            self._welcome(BinaryNewcomer(newcomer), encode(decode_binary_registration(data)))
        else:
            self._welcome(newcomer, data)

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
        peer = UdpPeer(self, own, address)
        self._peers.add(peer)
        assert self._readiness is not None
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
        self.label = f"udp {address[0]}:{address[1]}"

    def accept(self) -> Peer:
        """Open a socket for it."""
        return self._transport.connect(self._address)


class UdpPeer(Peer):
    """A client with a socket of its own on our side."""

    def __init__(self, transport: UdpTransport, own: socket.socket, address: Address) -> None:
        super().__init__(f"udp {address[0]}:{address[1]}")
        self._transport = transport
        self._socket = own
        self.ends = ("udp", address, own.getsockname())

    def read(self) -> None:
        """Take one datagram."""
        try:
            data = self._socket.recv(READ_SIZE)
        except OSError:  # nothing there after all, or no client was there for what was sent last
            return
        self.deliver(data)

    def send(self, data: bytes) -> None:
        """Send a datagram; if it cannot be sent it is lost, as any datagram may be."""
        if self.closed:
            return
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            # No client was there for the one before; one may be there now.
            with contextlib.suppress(OSError):
                self._socket.send(data)
        except OSError:
            return

    def close(self) -> None:
        """Close the socket."""
        if not self.closed:
            self.closed = True
            self._transport.release(self, self._socket)
