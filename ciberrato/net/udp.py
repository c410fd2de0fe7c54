"""The link over UDP, as all CiberRato programs have it: one message a datagram."""

from __future__ import annotations

import errno
import select
import socket
import time

from ciberrato.errors import ProtocolError
from ciberrato.net.address import answers_for, resolve
from ciberrato.net.link import Arrival, LinkError
from ciberrato.system.sockets import receive_stamped, stamp_arrivals

_MOST_AT_ONCE = 1000
"""Datagrams that one call takes, so that a flood cannot keep it from returning."""

_RECEIVE_BUFFER = 1 << 20
"""Bytes that may wait: some seconds of Measures and status messages at the shortest cycle times."""


class UdpLink:
    """A client's link over UDP.

    The simulator answers a registration from a port of its own. From the first answer on the link talks to
    that port only: datagrams from other ports and other machines are dropped. A refused connection (ICMP:
    no peer there yet, or no longer) is taken as silence.

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

    refused = False

    def __init__(self, host: str, port: int) -> None:
        self._main = resolve(host, port)
        self._peer: tuple[str, int] | None = None
        self._former: set[tuple[str, int]] = set()
        # Not connected: a simulator that was started anew answers from another port, on the same link.
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
        stamp_arrivals(self._socket)

    @classmethod
    def handed_over(cls, sock: socket.socket, host: str, port: int) -> UdpLink:
        """Return the link that another process has had so far, given its socket."""
        link = cls(host, port)
        link._socket.close()
        link._socket = sock
        sock.setblocking(False)
        return link

    @property
    def main(self) -> tuple[str, int]:
        """Address and main port of the simulator."""
        return self._main

    @property
    def endpoint(self) -> socket.socket:
        """Socket of the link, for handing it over."""
        return self._socket

    @property
    def peer(self) -> tuple[str, int] | None:
        """Address and port of the simulator that has answered, or None."""
        return self._peer

    @peer.setter
    def peer(self, peer: tuple[str, int]) -> None:
        self._peer = peer

    def register(self, data: bytes) -> None:
        """Send a registration to the main port; see `Link.register`."""
        if self._peer is not None:
            self._former.add(self._peer)
            self._peer = None
        self._send(data, self._main)

    def send(self, data: bytes) -> None:
        """Send a message to the port that has answered; see `Link.send`."""
        if self._peer is None:
            raise LinkError("no simulator has answered the registration yet")
        self._send(data, self._peer)

    def receive(self, timeout: float | None) -> bytes | None:
        """Wait for one message; see `Link.receive`."""
        deadline = None if timeout is None else time.monotonic() + timeout
        remaining = timeout
        while True:
            readable, _, _ = select.select((self._socket,), (), (), remaining)
            if readable:
                data = self._take()
                if data is not None:
                    return data
            if deadline is not None:
                # A stream of strangers' datagrams must not prolong the wait.
                remaining = deadline - time.monotonic()
                if remaining <= 0:
                    return None

    def receive_waiting(self) -> list[bytes]:
        """Return the messages that have already arrived; see `Link.receive_waiting`."""
        return [arrival.data for arrival in self.receive_arrivals()]

    def receive_arrivals(self) -> list[Arrival]:
        """Return them with the times of their arrival; see `Link.receive_arrivals`."""
        arrivals = []
        for _ in range(_MOST_AT_ONCE):
            try:
                data, sender, arrived = receive_stamped(self._socket)
            except ConnectionError:
                continue  # Windows reports a refused datagram in the place of the next one that has come
            except BlockingIOError:
                break
            if self._is_ours(sender, data):
                arrivals.append(Arrival(data, arrived))
        return arrivals

    def fileno(self) -> int:
        """Return the socket's descriptor; see `Link.fileno`."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket; see `Link.close`."""
        self._socket.close()

    def __enter__(self) -> UdpLink:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _take(self) -> bytes | None:
        """Receive one datagram; None if there is none or it comes from a stranger."""
        try:
            data, sender = self._socket.recvfrom(65535)
        except (BlockingIOError, ConnectionError):
            return None
        return data if self._is_ours(sender, data) else None

    def _is_ours(self, sender: tuple[str, int], data: bytes) -> bool:
        if self._peer is not None:
            return sender == self._peer
        if sender in self._former or not answers_for(sender[0], self._main[0]):
            return False
        # A refusal may come from any program: an acceptance after it counts.
        if not _is_refusal(data):
            self._peer = sender
        return True

    def _send(self, data: bytes, address: tuple[str, int]) -> None:
        try:
            self._socket.sendto(data, address)
        except (BlockingIOError, ConnectionError):
            return  # as lost on the way
        except OSError as error:
            if error.errno == errno.EHOSTUNREACH:
                return
            raise LinkError(f"cannot send to {address[0]}:{address[1]}: {error.strerror}") from None


def _is_refusal(data: bytes) -> bool:
    from ciberrato.protocol import Refusal, decode_simulator_message

    try:
        return isinstance(decode_simulator_message(data), Refusal)
    except ProtocolError:
        return False
