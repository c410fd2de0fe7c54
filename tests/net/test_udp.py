import errno
import select
import socket
import time

import pytest

from ciberrato.net import LinkError, UdpLink

LONG = 300.0  # seconds; only a failure takes so long


@pytest.fixture
def main_port(udp_socket):
    return udp_socket()


@pytest.fixture
def link(main_port):
    with UdpLink("127.0.0.1", main_port.getsockname()[1]) as opened:
        yield opened


def answer_from(main_port, answering, data=b"<Reply/>\n\0"):
    """Take the registration on the main port and answer from another, as a simulator does."""
    request, client = main_port.recvfrom(2000)
    answering.sendto(data, client)
    return request, client


def test_after_the_answer_everything_goes_to_the_port_that_answered(link, main_port, udp_socket):
    robot_port = udp_socket()
    assert link.peer is None
    link.register(b"<Robot/>\0")
    request, client = answer_from(main_port, robot_port)
    assert request == b"<Robot/>\0"
    assert link.receive(LONG) == b"<Reply/>\n\0"
    assert link.peer == robot_port.getsockname()
    link.send(b"<Actions/>\0")
    assert robot_port.recvfrom(2000) == (b"<Actions/>\0", client)


def test_strangers_are_not_heard_once_somebody_has_answered(link, main_port, udp_socket):
    robot_port, stranger = udp_socket(), udp_socket()
    link.register(b"<Robot/>\0")
    _, client = answer_from(main_port, robot_port, b"1")
    assert link.receive(LONG) == b"1"
    stranger.sendto(b"stranger", client)
    main_port.sendto(b"main", client)
    robot_port.sendto(b"2", client)
    stranger.sendto(b"stranger", client)
    robot_port.sendto(b"3", client)
    assert link.receive(LONG) == b"2"
    assert link.receive_waiting() == [b"3"]


def test_an_answer_from_another_machine_does_not_count(main_port, udp_socket):
    # 127/8 is one machine to the link, so a link to another address sees loopback as somebody else.
    with UdpLink("192.0.2.1", 6000) as link:
        stranger = udp_socket()
        stranger.sendto(b"x", ("127.0.0.1", _local_port(link)))
        assert select.select([link], [], [], LONG)[0], "it has arrived"
        assert link.receive(0) is None
        assert link.peer is None


def _local_port(link):
    with socket.socket(fileno=socket.dup(link.fileno())) as same:
        if same.getsockname()[1] == 0:
            same.bind(("127.0.0.1", 0))
        return same.getsockname()[1]


def test_loopback_addresses_are_one_machine(udp_socket):
    main_port = udp_socket("0.0.0.0")
    with UdpLink("127.0.1.1", main_port.getsockname()[1]) as link:
        link.register(b"x")
        answer_from(main_port, udp_socket("0.0.0.0"), b"reply")
        assert link.receive(LONG) == b"reply"


def test_silence_is_none_after_the_time_asked_for(link):
    before = time.monotonic()
    assert link.receive(0.05) is None
    assert time.monotonic() - before >= 0.045
    assert link.receive(0) is None
    assert link.receive_waiting() == []


def test_strangers_do_not_prolong_the_wait(link, main_port, udp_socket, monkeypatch):
    robot_port, stranger = udp_socket(), udp_socket()
    link.register(b"x")
    _, client = answer_from(main_port, robot_port)
    assert link.receive(LONG)
    # A clock that leaps, and a stranger's datagram always waiting: the wait must still end.
    clock = iter(range(0, 10**9, 40))

    def monotonic():
        stranger.sendto(b"noise", client)
        return float(next(clock))

    monkeypatch.setattr("ciberrato.net.udp.time.monotonic", monotonic)
    assert link.receive(100.0) is None
    assert next(clock) == 160


def test_what_has_arrived_comes_oldest_first_and_at_once(link, main_port, udp_socket):
    robot_port = udp_socket()
    link.register(b"x")
    _, client = answer_from(main_port, robot_port, b"0")
    assert link.receive(LONG) == b"0"
    sent = [b"%d\0" % n for n in range(1, 200)]
    for data in sent:
        robot_port.sendto(data, client)
    assert link.receive_waiting() == sent
    assert link.receive_waiting() == []


def test_a_flood_does_not_keep_receive_waiting_from_returning(link, main_port, udp_socket, monkeypatch):
    monkeypatch.setattr("ciberrato.net.udp._MOST_AT_ONCE", 5)
    robot_port = udp_socket()
    link.register(b"x")
    _, client = answer_from(main_port, robot_port, b"0")
    assert link.receive(LONG) == b"0"
    for _ in range(12):
        robot_port.sendto(b"m", client)
    assert [len(link.receive_waiting()) for _ in range(4)] == [5, 5, 2, 0]


@pytest.mark.parametrize("size", [0, 1, 4096, 65507])
def test_datagrams_of_every_size_arrive_whole(link, main_port, udp_socket, size):
    robot_port = udp_socket()
    link.register(b"x")
    answer_from(main_port, robot_port, b"\xff" * size)
    assert link.receive(LONG) == b"\xff" * size


def test_nobody_there_is_silence_and_a_late_simulator_is_heard(closed_port):
    with UdpLink("127.0.0.1", closed_port) as link:
        for _ in range(3):
            link.register(b"<Robot/>\0")  # ICMP comes back: port unreachable
            assert link.receive(0.02) is None
            assert link.receive_waiting() == []
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as main_port:
            main_port.bind(("127.0.0.1", closed_port))
            main_port.settimeout(LONG)
            link.register(b"<Robot/>\0")
            answer_from(main_port, main_port, b"late")
            assert link.receive(LONG) == b"late"


def test_a_simulator_that_is_gone_is_silence(link, main_port, udp_socket):
    robot_port = udp_socket()
    link.register(b"x")
    answer_from(main_port, robot_port)
    assert link.receive(LONG)
    robot_port.close()
    for _ in range(3):
        link.send(b"<Actions/>\0")
        assert link.receive(0.01) is None


def test_sending_before_an_answer_is_an_error(link):
    with pytest.raises(LinkError, match="answered"):
        link.send(b"<Actions/>\0")


def test_registering_again_leaves_the_old_port(link, main_port, udp_socket):
    old, new = udp_socket(), udp_socket()
    link.register(b"first")
    _, client = answer_from(main_port, old, b"from old")
    assert link.receive(LONG) == b"from old"
    old.sendto(b"late from old", client)
    link.register(b"second")
    assert link.peer is None
    answer_from(main_port, new, b"from new")
    assert link.receive(LONG) == b"from new"
    assert link.peer == new.getsockname()


def test_trying_again_does_not_lose_an_answer_that_was_under_way(link, main_port, udp_socket):
    robot_port = udp_socket()
    link.register(b"first")
    answer_from(main_port, robot_port, b"yes")
    link.register(b"second")
    assert link.receive(LONG) == b"yes"


def test_it_can_be_waited_on(link, main_port, udp_socket):
    link.register(b"x")
    assert select.select([link], [], [], 0)[0] == []
    answer_from(main_port, udp_socket())
    assert select.select([link], [], [], LONG)[0] == [link]


def test_a_machine_that_cannot_send_is_an_error_in_one_line():
    with (
        UdpLink("255.255.255.255", 6000) as link,
        pytest.raises(LinkError, match="cannot send to 255") as caught,
    ):
        link.register(b"x")
    assert "\n" not in str(caught.value)


def test_a_host_out_of_reach_for_now_is_silence(link, monkeypatch):
    class Unreachable:
        def sendto(self, data, address):
            raise OSError(errno.EHOSTUNREACH, "No route to host")

        def close(self):
            pass

    link.close()
    link._socket = Unreachable()
    link.register(b"x")


def test_closing_twice_is_harmless(link):
    link.close()
    link.close()
