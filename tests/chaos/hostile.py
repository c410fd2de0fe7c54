"""Clients that mean no good, or are broken: each a process of its own, against a simulator on loopback.

As a program::

    python -m tests.chaos.hostile nul --port 6000 --seconds 5
"""

from __future__ import annotations

import argparse
import contextlib
import selectors
import socket
import sys
import time
from collections.abc import Callable

ROBOT = b'<Robot Id="%d" Name="hostile"/>\0'
ACTIONS = b'<Actions LeftMotor="0.1" RightMotor="-0.1"/>\0'
HEAVY = b"<Actions>" + b"<Say>" * 150 + b"<Actions LeftMotor=1 a=&x;/>" * 5
"""Broken in the end only: what the tolerant reader takes longest for."""


def tcp(port: int, first: bytes = b"") -> socket.socket:
    sock = socket.create_connection(("127.0.0.1", port))
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.sendall(first)
    return sock


def udp() -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    return sock


def pump(socks: list[socket.socket], data: bytes, end: float) -> None:
    """Send without end on all connections, and read whatever comes."""
    selector = selectors.DefaultSelector()
    for sock in socks:
        sock.setblocking(False)
        selector.register(sock, selectors.EVENT_READ | selectors.EVENT_WRITE)
    rest = dict.fromkeys(socks, data)
    while selector.get_map() and time.monotonic() < end:
        for key, events in selector.select(0.1):
            sock = key.fileobj
            assert isinstance(sock, socket.socket)
            try:
                if events & selectors.EVENT_READ and not sock.recv(1 << 20):
                    raise OSError
                if events & selectors.EVENT_WRITE:
                    rest[sock] = rest[sock][sock.send(rest[sock]) :] or data
            except BlockingIOError:
                continue
            except OSError:
                selector.unregister(sock)


def nul(port: int, end: float, n: int, rate: float) -> None:
    pump([tcp(port, ROBOT % (2 + i)) for i in range(n)], bytes(1 << 16), end)


def flood(port: int, end: float, n: int, rate: float) -> None:
    pump([tcp(port, ROBOT % (2 + i)) for i in range(n)], ACTIONS * 1000, end)


def heavy(port: int, end: float, n: int, rate: float) -> None:
    pump([tcp(port, ROBOT % (2 + i)) for i in range(n)], (HEAVY[:1022] + b"\0") * 50, end)


def newcomers(port: int, end: float, n: int, rate: float) -> None:
    pump([tcp(port) for i in range(n)], b"<Rat/>\0" * 1000, end)


def labreq(port: int, end: float, n: int, rate: float) -> None:
    pump([tcp(port, b"<View/>\0") for _ in range(n)], b"<LabReq/>\0" * 1000, end)


def udp_flood(port: int, end: float, n: int, rate: float) -> None:
    sock = udp()
    sock.sendto(ROBOT % 2, ("127.0.0.1", port))
    own = sock.recvfrom(4096)[1]
    sock.connect(own)
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            sock.send(ACTIONS)


def junk(port: int, end: float, n: int, rate: float) -> None:
    """Junk to the main port, `rate` a second; 0 = as fast as it goes."""
    sock = udp()
    began = time.monotonic()
    sent = 0
    while (now := time.monotonic()) < end:
        if rate and sent >= (now - began) * rate:
            time.sleep(0.001)
            continue
        sent += 1
        with contextlib.suppress(OSError):
            sock.sendto(b"<Rat%d/>" % sent, ("127.0.0.1", port))


def dead_views(port: int, end: float, n: int, rate: float) -> None:
    """Views whose sockets are open, and that never say anything."""
    socks = [udp() for _ in range(n)]
    for sock in socks:
        sock.sendto(b"<View/>", ("127.0.0.1", port))
    time.sleep(max(0.0, end - time.monotonic()))


def idle(port: int, end: float, n: int, rate: float) -> None:
    """Connections on which nothing is said."""
    socks = []
    with contextlib.suppress(OSError):
        for _ in range(n):
            socks.append(tcp(port))  # noqa: PERF401 - those before a failure stay
    time.sleep(max(0.0, end - time.monotonic()))


KINDS: dict[str, Callable[[int, float, int, float], None]] = {
    function.__name__.replace("_", "-"): function
    for function in (nul, flood, heavy, newcomers, labreq, udp_flood, junk, dead_views, idle)
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.hostile")
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("-n", type=int, default=1, help="so many clients")
    parser.add_argument("--rate", type=float, default=0.0, help="messages a second; 0: as fast as it goes")
    options = parser.parse_args()
    print("ready", flush=True)
    try:
        KINDS[options.kind](options.port, time.monotonic() + options.seconds, options.n, options.rate)
    except OSError as error:
        print(error, file=sys.stderr)


if __name__ == "__main__":
    main()
