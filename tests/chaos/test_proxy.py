"""The bad network itself: what it does is what was asked for, and the same with the same seed."""

from __future__ import annotations

import contextlib
import socket
import time
from collections import Counter

import pytest

from ciberrato.net import LinkClosedError, TcpLink, UdpLink
from tests.chaos.proxy import Faults, Proxy, corrupted, parse_faults

PATIENCE = 300.0  # seconds; only a failure takes so long
LINKS = {"udp": UdpLink, "tcp": TcpLink}


class Echo:
    """A simulator that answers a registration from a new port, and echoes from there."""

    def __enter__(self):
        self.stack = contextlib.ExitStack()
        self.main = self.stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self.own = self.stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self.listener = self.stack.enter_context(socket.socket())
        self.main.bind(("127.0.0.1", 0))
        self.own.bind(("127.0.0.1", 0))
        self.listener.bind(self.main.getsockname())
        self.listener.listen()
        for sock in (self.main, self.own, self.listener):
            sock.settimeout(PATIENCE)
        self.address = self.main.getsockname()
        return self

    def __exit__(self, *_):
        self.stack.close()


def talk(seed, faults, n=300):
    """Send n numbered datagrams down to a client; return what reached it, in order."""
    with Echo() as echo, Proxy(echo.address, down=faults, seed=seed) as proxy:
        with UdpLink(*proxy.address) as link:
            link.register(b"hello\0")
            data, client = echo.main.recvfrom(100)
            assert data == b"hello\0"
            proxy.down = Faults()
            echo.own.sendto(b"first\0", client)
            assert link.receive(PATIENCE) == b"first\0"
            link.send(b"up\0")
            assert echo.own.recv(100) == b"up\0"
            proxy.down = faults
            got = []
            for i in range(n):
                echo.own.sendto(b"<%d/>\0" % i, client)
                while proxy.counts["down", "messages"] < i + 2:  # no socket's buffer runs over
                    time.sleep(0)
                got += link.receive_waiting()
            proxy.down = Faults()
            echo.own.sendto(b"last\0", client)
            while not got or got[-1] != b"last\0":
                got.append(link.receive(PATIENCE))
        return got, Counter({what: count for (way, what), count in proxy.counts.items() if way == "down"})


def test_without_faults_all_passes_in_order() -> None:
    got, counts = talk(1, Faults())
    assert got == [b"<%d/>\0" % i for i in range(300)] + [b"last\0"]
    assert set(counts) == {"messages"}


def test_the_same_seed_drops_duplicates_and_changes_the_same_messages() -> None:
    faults = Faults(drop=0.2, duplicate=0.1, reorder=0.1, corrupt=0.1, truncate=0.1)
    first, counts = talk(5, faults)
    assert talk(5, faults) == (first, counts)
    assert talk(6, faults)[0] != first
    # Five standard deviations of a binomial either way.
    for what, share in (("dropped", 0.2), ("reordered", 0.08), ("corrupted", 0.08), ("truncated", 0.08)):
        assert abs(counts[what] - 300 * share) < 5 * (300 * share * (1 - share)) ** 0.5, what
    assert len(first) == 301 - counts["dropped"] + counts["duplicated"]


@pytest.mark.parametrize("transport", LINKS)
def test_a_cut_lets_nothing_through_in_its_direction(transport: str) -> None:
    with Echo() as echo, Proxy(echo.address) as proxy, LINKS[transport](*proxy.address) as link:
        link.register(b"hello\0")
        if transport == "udp":
            _, client = echo.main.recvfrom(100)
            echo.own.connect(client)
            peer = echo.own
        else:
            peer = echo.stack.enter_context(echo.listener.accept()[0])
            peer.settimeout(PATIENCE)
            assert peer.recv(100) == b"hello\0"
        peer.send(b"one\0")
        assert link.receive(PATIENCE) == b"one\0"
        with proxy.cut("down"):
            peer.send(b"two\0")
            link.send(b"up\0")
            assert peer.recv(100) == b"up\0"
            while proxy.counts["down", "cut off"] < 1:
                time.sleep(0)
        peer.send(b"three\0")
        assert link.receive(PATIENCE) == b"three\0"
        assert proxy.counts["down", "cut off"] == 1


def test_a_connection_is_cut_after_so_many_messages() -> None:
    with (
        Echo() as echo,
        Proxy(echo.address, down=Faults(cut_after=2)) as proxy,
        TcpLink(*proxy.address) as link,
    ):
        link.register(b"hello\0")
        peer = echo.stack.enter_context(echo.listener.accept()[0])
        peer.sendall(b"one\0two\0three\0")
        got = []
        with contextlib.suppress(LinkClosedError):
            while True:
                got.append(link.receive(PATIENCE))
        assert got[:2] == [b"one\0", b"two\0"]


def test_faults_are_read_from_text_and_digits_stay_digits() -> None:
    assert parse_faults("drop=0.1,outages=1:2.5/4:5,digits=1,cut_after=3") == Faults(
        drop=0.1, outages=((1.0, 2.5), (4.0, 5.0)), digits=True, cut_after=3
    )
    import numpy as np

    rng = np.random.default_rng(1)
    text = b'<Measures Time="12">\0'
    for _ in range(50):
        changed = corrupted(text, rng, digits=True)
        assert changed != text
        assert changed.translate(None, b"0123456789") == text.translate(None, b"0123456789")
