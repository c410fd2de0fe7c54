import select
import socket
import struct
import time

import pytest

from ciberrato.net import LinkClosedError, LinkError, TcpLink
from ciberrato.protocol import MESSAGE_LIMIT

LONG = 300.0  # seconds; only a failure takes so long


@pytest.fixture
def link(tcp_server):
    with TcpLink("127.0.0.1", tcp_server.getsockname()[1]) as opened:
        yield opened


@pytest.fixture
def peer(link, tcp_server):
    """The simulator's end of a connection on which the registration has been read."""
    link.register(b"<Robot/>\0")
    connection, _ = tcp_server.accept()
    connection.settimeout(LONG)
    assert read_exactly(connection, 9) == b"<Robot/>\0"
    with connection:
        yield connection


def read_exactly(connection, size):
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        assert part, "the connection ended"
        data += part
    return data


def reset(connection):
    """Close so that the other side gets a reset."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def send_often(link, data):
    """Send until it fails: the first messages find room in the buffers."""
    for _ in range(10_000):
        link.send(data)


def test_messages_go_both_ways_on_one_connection(link, peer, tcp_server):
    peer.sendall(b"<Reply/>\n\0")
    assert link.receive(LONG) == b"<Reply/>\n\0"
    link.send(b"<Actions/>\0")
    assert read_exactly(peer, 11) == b"<Actions/>\0"
    tcp_server.settimeout(0)
    with pytest.raises(BlockingIOError):
        tcp_server.accept()
    assert link.peer == tcp_server.getsockname()


def test_the_nul_is_added_where_it_is_missing(link, peer):
    link.send(b"<Actions/>")
    link.send(b"<Say/>\0")
    assert read_exactly(peer, 18) == b"<Actions/>\0<Say/>\0"


def test_a_message_in_many_segments_is_one(link, peer):
    for position, byte in enumerate(b"<Measures/>\n"):
        peer.sendall(bytes([byte]))
        assert select.select([link], [], [], LONG)[0]
        assert link.receive_waiting() == [], position
    peer.sendall(b"\0")
    assert link.receive(LONG) == b"<Measures/>\n\0"


def test_many_messages_in_one_segment_are_many(link, peer):
    peer.sendall(b"<a/>\n\0<b/>\n\0<c/>\n\0<d")
    assert link.receive(LONG) == b"<a/>\n\0"
    assert link.receive_waiting() == [b"<b/>\n\0", b"<c/>\n\0"]
    assert link.receive_waiting() == []
    peer.sendall(b"/>\0")
    assert link.receive(LONG) == b"<d/>\0"


def test_a_wait_ends_though_a_message_has_begun(link, peer):
    peer.sendall(b"<Measures")
    before = time.monotonic()
    assert link.receive(0.05) is None
    assert time.monotonic() - before >= 0.045


def test_silence_is_none(link, peer):
    assert link.receive(0) is None
    assert link.receive(0.01) is None
    assert link.receive_waiting() == []


def test_the_end_is_an_error_after_the_last_complete_message(link, peer):
    peer.sendall(b"<a/>\0<b/>\0<cut")
    peer.close()
    assert link.receive(LONG) == b"<a/>\0"
    assert link.receive(LONG) == b"<b/>\0"
    for _ in range(2):
        with pytest.raises(LinkClosedError, match="closed"):
            link.receive(LONG)
        with pytest.raises(LinkClosedError, match="closed"):
            link.receive_waiting()
    assert link.peer is None


def test_the_end_is_an_error_for_receive_waiting_too_after_the_last_message(link, peer):
    peer.sendall(b"<a/>\0")
    peer.close()
    assert select.select([link], [], [], LONG)[0]
    taken = []

    def take_all():
        while True:
            taken.extend(link.receive_waiting())

    with pytest.raises(LinkClosedError):
        take_all()
    assert taken == [b"<a/>\0"]


def test_a_reset_is_an_error(link, peer):
    reset(peer)
    with pytest.raises(LinkClosedError, match="broken"):
        link.receive(LONG)


def test_sending_to_a_simulator_that_has_left_is_an_error(link, peer):
    reset(peer)
    assert select.select([link], [], [], LONG)[0]
    with pytest.raises(LinkClosedError):
        send_often(link, b"<Actions/>\0")
    with pytest.raises(LinkClosedError):
        link.receive(LONG)


def test_what_was_said_before_the_end_is_read_though_sending_failed(link, peer):
    peer.sendall(b"<last/>\0")
    peer.shutdown(socket.SHUT_RDWR)
    assert select.select([link], [], [], LONG)[0]
    with pytest.raises(LinkClosedError):
        send_often(link, b"<Actions/>\0")
    assert link.receive(LONG) == b"<last/>\0"


def test_a_simulator_that_does_not_read_is_left(link, peer, monkeypatch):
    monkeypatch.setattr("ciberrato.net.tcp._SEND_SECONDS", 0.05)
    with pytest.raises(LinkClosedError, match="has not read"):
        send_often(link, b"x" * 60_000)


def test_a_message_without_end_is_refused_in_bounded_memory(link, peer):
    chunk = b"x" * 8000

    def pour():
        for _ in range(MESSAGE_LIMIT // len(chunk) + 2):
            peer.sendall(chunk)
            assert select.select([link], [], [], LONG)[0]
            assert link.receive_waiting() == []

    with pytest.raises(LinkClosedError, match=str(MESSAGE_LIMIT)):
        pour()


def test_the_longest_message_passes(link, peer):
    longest = b"x" * (MESSAGE_LIMIT - 1) + b"\0"
    peer.sendall(longest)
    assert link.receive(LONG) == longest


def test_nobody_there_is_silence_and_a_late_simulator_is_found(closed_port):
    with TcpLink("127.0.0.1", closed_port) as link:
        for _ in range(2):
            link.register(b"<Robot/>\0")
            assert link.peer is None
            assert link.receive(0.01) is None
            assert link.receive_waiting() == []
            assert select.select([link], [], [], 0)[0] == [], "waiting on it must not return at once"
        with pytest.raises(LinkError, match="not connected"):
            link.send(b"<Actions/>\0")
        with socket.create_server(("127.0.0.1", closed_port)) as server:
            server.settimeout(LONG)
            link.register(b"<Robot/>\0")
            connection, _ = server.accept()
            with connection:
                assert read_exactly(connection, 9) == b"<Robot/>\0"


def test_trying_again_while_the_answer_is_awaited_sends_nothing_twice(link, peer):
    link.register(b"<Robot/>\0")
    link.send(b"<Actions/>\0")
    assert read_exactly(peer, 11) == b"<Actions/>\0"


def test_registering_again_after_an_answer_or_an_end_opens_a_new_connection(link, peer, tcp_server):
    peer.sendall(b"<Reply/>\0")
    assert link.receive(LONG) == b"<Reply/>\0"
    link.register(b"<Robot/>\0")
    second, _ = tcp_server.accept()
    assert peer.recv(10) == b"", "the old connection is closed"
    second.close()
    with pytest.raises(LinkClosedError):
        link.receive(LONG)
    link.register(b"<Robot/>\0")
    third, _ = tcp_server.accept()
    with third:
        third.sendall(b"<Reply/>\0")
        assert link.receive(LONG) == b"<Reply/>\0"


def test_closing_twice_is_harmless(link):
    link.close()
    link.close()
