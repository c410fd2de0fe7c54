"""What clients may cost the simulator, counted: no clock, no luck."""

from __future__ import annotations

import contextlib
import errno
import socket
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ciberrato.protocol import (
    Acceptance,
    PanelRegistration,
    Refusal,
    ViewRegistration,
    decode_registration,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.service.allowance import (
    CLIENT_BYTES,
    CONNECTIONS,
    LEAST_COST,
    MAIN_DATAGRAMS,
    MAIN_RATE,
    MESSAGES,
    NEWCOMER_BYTES,
    REGISTRATION_COST,
    VIEW_MESSAGES,
    Allowance,
    Meter,
)
from simulator_stub.service.audience import (
    GRACE_SECONDS,
    NEVER_ASKED_SECONDS,
    SILENT_SECONDS,
    SOURCE_LIMIT,
    VIEW_LIMIT,
    Admission,
)
from simulator_stub.service.clients import ANSWERS
from simulator_stub.service.readiness import Readiness
from simulator_stub.service.reception import FAULTS_LIMIT, FOLLOWERS_LIMIT
from simulator_stub.service.reception import SOURCE_LIMIT as WAITING_OF_ONE
from simulator_stub.service.session import Session
from simulator_stub.service.transports import Newcomer, Peer
from simulator_stub.service.transports.tcp import REGISTRATION_SECONDS, UNREGISTERED_LIMIT, TcpTransport
from simulator_stub.service.transports.udp import UdpTransport
from simulator_stub.simulation import Simulation

ROBOT = b'<Robot Id="%d" Name="r"/>'


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


# --- the meter -------------------------------------------------------------------------------------------


def test_robots_allowances_come_with_cycles_and_others_with_the_clock(clock: Clock) -> None:
    meter = Meter(0.05, Counter(), clock=clock)
    robot, view = Allowance(meter, 10), Allowance(meter, 10)
    robot.widen(10, every_cycle=True)
    gone_on: list[str] = []
    for name, allowance in (("robot", robot), ("view", view)):
        assert allowance.left() == 10
        assert not allowance.spend(9)
        assert allowance.spend(5)
        assert allowance.exhausted
        meter.when_renewed(allowance, lambda name=name: gone_on.append(name))
    assert not meter.advance()
    assert gone_on == ["robot"]
    assert (robot.left(), view.left()) == (10, -4)
    clock.now = 0.06
    assert meter.advance()
    assert gone_on == ["robot", "view"]
    assert view.left() == 10
    clock.now = 0.1
    assert not meter.advance(), "not yet again"


# --- transports ------------------------------------------------------------------------------------------


class Rig:
    """An open transport under watch, and all that it delivers."""

    def __init__(self, kind: type[Any], clock: Clock) -> None:
        self.clock = clock
        self.dropped: Counter[str] = Counter()
        self.meter = Meter(0.05, self.dropped, clock=clock)
        self.readiness = Readiness()
        self.transport = kind()
        self.transport.open("127.0.0.1", 0)
        self.came: list[tuple[Newcomer, bytes]] = []
        self.transport.serve(self.readiness, self.welcome, self.meter)
        self.address = ("127.0.0.1", self.transport.port)

    def welcome(self, newcomer: Newcomer, data: bytes) -> bool:
        self.came.append((newcomer, data))
        return not data.startswith(b"<Rat")

    def read_all(self) -> None:
        for _ in range(20_000):
            if not self.readiness.wait(0.0):
                return
        pytest.fail("it reads without end")

    def tick(self, seconds: float = 0.06) -> None:
        self.clock.now += seconds
        assert self.meter.advance()
        self.transport.tick(self.meter.now)

    def close(self) -> None:
        self.transport.close()
        self.readiness.close()


@pytest.fixture
def tcp(clock: Clock) -> Iterator[Rig]:
    rig = Rig(TcpTransport, clock)
    yield rig
    rig.close()


@pytest.fixture
def udp(clock: Clock) -> Iterator[Rig]:
    rig = Rig(UdpTransport, clock)
    yield rig
    rig.close()


def fill(sock: socket.socket, data: bytes) -> int:
    """Send until nothing more fits."""
    sock.setblocking(False)
    sent = 0
    try:
        while True:
            sent += sock.send(data)
    except BlockingIOError:
        return sent


def test_a_connection_is_read_as_far_as_its_allowance_goes_and_loses_nothing(tcp: Rig) -> None:
    with socket.create_connection(tcp.address) as client:
        client.sendall(b"<View/>\0")
        tcp.read_all()
        ((newcomer, _),) = tcp.came
        robot = newcomer.accept()
        got = bytearray()
        robot.deliver = lambda data: got.extend(data.rstrip(b"\0") + b"\0")
        robot.serve_every_cycle()
        tcp.meter.advance()
        line = b"".join(b"<%06d/>\0" % number for number in range(20_000))
        client.setblocking(False)
        rest = line
        cycles = 0
        while len(got) < len(line):
            with contextlib.suppress(BlockingIOError):
                rest = rest[client.send(rest) :] if rest else rest
            before = len(got)
            tcp.read_all()
            assert len(got) - before <= CLIENT_BYTES + 10, "and a message that had begun"
            cycles += 1
            tcp.meter.advance()
        assert bytes(got) == line, "what waited comes in order"
        assert cycles >= len(line) // CLIENT_BYTES


def test_empty_messages_on_a_stream_are_none(tcp: Rig) -> None:
    with socket.create_connection(tcp.address) as client:
        client.sendall(bytes(NEWCOMER_BYTES // 2) + b"<View/>\0\0\0" + b"\0")
        tcp.read_all()
        assert [data for _, data in tcp.came] == [b"<View/>"]
        client.sendall(b"\0")
        tcp.read_all()
        assert len(tcp.came) == 1


def test_somebody_who_has_not_registered_is_read_less_of(tcp: Rig) -> None:
    with socket.create_connection(tcp.address) as client:
        fill(client, b"<Rat/>\0" * 1000)
        tcp.read_all()
        assert sum(len(data) + 1 for _, data in tcp.came) <= NEWCOMER_BYTES
        before = len(tcp.came)
        tcp.meter.advance()
        tcp.read_all()
        assert len(tcp.came) == before, "cycles alone do not renew its allowance"
        tcp.tick()
        tcp.read_all()
        assert len(tcp.came) > before


def test_a_connection_that_breaks_while_it_is_not_read_is_noticed(tcp: Rig) -> None:
    client = socket.create_connection(tcp.address)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
    fill(client, b"<Rat/>\0" * 1000)
    tcp.read_all()
    assert len(tcp.transport._connections) == 1
    client.close()  # with a reset
    tcp.read_all()
    assert tcp.transport._connections == set()


def test_connections_that_do_not_register_are_closed_in_time(tcp: Rig) -> None:
    with socket.create_connection(tcp.address) as idle, socket.create_connection(tcp.address) as good:
        good.sendall(b"<View/>\0")
        while len(tcp.transport._connections) < 2 or not tcp.came:
            tcp.read_all()
        view = tcp.came[0][0].accept()
        tcp.tick(REGISTRATION_SECONDS - 1.0)
        assert len(tcp.transport._connections) == 2
        tcp.tick(2.0)
        idle.settimeout(300.0)
        assert idle.recv(1) == b""
        assert not view.closed
        assert tcp.dropped == {"connections": 1}


def test_one_more_connection_closes_the_one_that_has_waited_longest(tcp: Rig) -> None:
    clients = []
    try:
        for _ in range(UNREGISTERED_LIMIT + 3):
            clients.append(socket.create_connection(tcp.address))
            tcp.read_all()
            if len(clients) % CONNECTIONS == 0:
                tcp.tick()
        tcp.read_all()
        assert len(tcp.transport._unregistered) == UNREGISTERED_LIMIT
        assert tcp.dropped["connections"] == 3
        for client in clients[:3]:
            client.settimeout(300.0)
            assert client.recv(1) == b""
        clients[-1].sendall(b"<View/>\0")
        tcp.read_all()
        assert tcp.came[-1][1].rstrip(b"\0") == b"<View/>"
    finally:
        for client in clients:
            client.close()
    tcp.read_all()
    assert tcp.transport._unregistered == {}, "and who goes by itself is forgotten"


def test_accepting_pauses_after_so_many_and_where_no_descriptor_is_left(
    tcp: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0

    class Exhausted:
        def accept(self) -> None:
            nonlocal calls
            calls += 1
            raise OSError(errno.EMFILE, "Too many open files")

        def __getattr__(self, name: str) -> Any:
            return getattr(real, name)

    clients = [socket.create_connection(tcp.address) for _ in range(CONNECTIONS + 10)]
    try:
        tcp.read_all()
        assert len(tcp.transport._connections) == CONNECTIONS
        real = tcp.transport._socket
        monkeypatch.setattr(tcp.transport, "_socket", Exhausted())
        tcp.tick()
        for _ in range(50):
            tcp.readiness.wait(0.0)
        assert calls == 1
        assert len(tcp.transport._connections) == CONNECTIONS - 1, "the oldest has made room"
        tcp.tick()
        for _ in range(50):
            tcp.readiness.wait(0.0)
        assert calls == 2
        monkeypatch.undo()
        tcp.tick()
        tcp.read_all()
        assert len(tcp.transport._connections) == CONNECTIONS + 10 - 2
    finally:
        monkeypatch.undo()
        for client in clients:
            client.close()


def flood(rig: Rig, client: socket.socket, size: int, data: bytes = b"<Rat/>") -> None:
    for _ in range(size):
        client.sendto(data, rig.address)


def test_the_main_port_is_read_as_far_as_its_allowance_goes(udp: Rig) -> None:
    most = int(MAIN_RATE * udp.meter.tick_seconds)
    assert most >= MAIN_DATAGRAMS
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        while len(udp.came) < most:
            flood(udp, client, 50)
            udp.read_all()
        assert len(udp.came) == most
        flood(udp, client, 5000)  # more than any buffer holds
        udp.read_all()
        assert len(udp.came) == most
        udp.tick()
        udp.read_all()
        waiting = len(udp.came) - most
        assert waiting > 0
        lost = udp.dropped["main_port"]
        if lost:  # the system tells
            assert lost + waiting >= 5000


def test_what_may_be_a_registration_costs_more_of_the_allowance(udp: Rig) -> None:
    most = int(MAIN_RATE * udp.meter.tick_seconds)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        for _ in range(most // REGISTRATION_COST // 50 + 1):
            flood(udp, client, 50, ROBOT % 1)
            udp.read_all()
    assert len(udp.came) == -(-most // REGISTRATION_COST)


@pytest.mark.parametrize("times", [1, 2, 3])
def test_a_newcomer_is_heard_among_a_flood_of_some_times_what_is_read(udp: Rig, times: int) -> None:
    """The clock is the test's: in each tick so many times the allowance is sent, and read while it lasts."""
    most = int(MAIN_RATE * udp.meter.tick_seconds)
    moments = np.random.default_rng(1)
    heard = 0
    tries = 40
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        for _ in range(tries):
            moment = int(moments.integers(times * most))
            for sent in range(0, times * most, 50):
                if sent <= moment < sent + 50:
                    client.sendto(ROBOT % 1, udp.address)
                flood(udp, client, 50)
                for _ in range(6):
                    udp.readiness.wait(0.0)
            udp.tick()
            udp.read_all()
            udp.tick()
            heard += any(data.startswith(b"<Robot") for _, data in udp.came)
            udp.came.clear()
    # On average one in `times`, and the buffer's; three standard deviations less of 40 tries.
    share = 1.0 / times
    assert heard >= tries * share - 3.0 * (tries * share * (1.0 - share)) ** 0.5


def test_a_udp_robot_is_read_as_far_as_its_allowance_goes_and_what_is_lost_is_counted(udp: Rig) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.sendto(ROBOT % 1, udp.address)
        udp.read_all()
        peer = udp.came[0][0].accept()
        peer.serve_every_cycle()
        got: list[bytes] = []
        peer.deliver = got.append
        peer.send(b"hello")
        _, own = client.recvfrom(100)
        client.connect(own)
        for _ in range(5000):
            client.send(b"<Actions/>")
        udp.read_all()
        most = -(-CLIENT_BYTES // LEAST_COST)
        assert len(got) == most
        assert peer.exhausted
        udp.meter.advance()
        udp.read_all()
        assert len(got) == 2 * most
        for _ in range(200):
            udp.meter.advance()
            udp.read_all()
        lost = peer.overflow()
        assert lost == 0 or lost + len(got) == 5000
        assert peer.overflow() == 0, "each is counted once"


def test_a_view_whose_machine_says_that_nobody_is_there_counts_as_lost(udp: Rig) -> None:
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.sendto(b"<View/>", udp.address)
    udp.read_all()
    peer = udp.came[0][0].accept()
    for _ in range(300):
        peer.send(b"status")
    assert not peer.lost
    client.close()
    for _ in range(300):
        peer.send(b"status")
    assert peer.lost


# --- the session -----------------------------------------------------------------------------------------


class FakePeer(Peer):
    def __init__(self, source: str) -> None:
        super().__init__(f"fake {source}")
        self.source = source
        self.received: list[bytes] = []

    def send(self, data: bytes) -> None:
        self.received.append(data)

    def close(self) -> None:
        self.closed = True

    @property
    def accepted(self) -> bool:
        return isinstance(decode_simulator_message(self.received[0]), Acceptance)


class FakeNewcomer(Newcomer):
    def __init__(self, source: str) -> None:
        self.label = self.source = source
        self.peer = FakePeer(source)
        self.turned_away = False

    def accept(self) -> Peer:
        return self.peer

    def turn_away(self) -> None:
        self.turned_away = True


class World:
    def __init__(self, clock: Clock, **options: Any) -> None:
        lab = Lab(name="open", width=20.0, height=10.0)
        grid = StartGrid(positions=tuple(GridPosition(x=2.0 * n + 1, y=5.0) for n in range(5)))
        self.notes: list[str] = []
        self.clock = clock
        self.session = Session(
            Simulation(lab, grid, Parameters()), notify=self.notes.append, clock=clock, **options
        )

    def join(self, data: bytes, source: str = "10.0.0.1") -> FakePeer:
        newcomer = FakeNewcomer(source)
        self.session.welcome(newcomer, data)
        self.session.cycle()
        return newcomer.peer

    def pass_time(self, seconds: float) -> None:
        self.clock.now += seconds
        self.session.tick(self.clock.now)
        self.session.cycle()


@pytest.fixture
def world(clock: Clock) -> World:
    return World(clock)


def test_a_robots_messages_beyond_the_limit_are_dropped_and_counted_and_the_next_cycle_is_as_ever(
    world: World,
) -> None:
    robot = world.join(ROBOT % 1)
    for _ in range(2):
        for _ in range(MESSAGES + 50):
            robot.deliver(b'<Actions LeftMotor="0.1"/>')
        world.session.cycle()
    assert world.session.take_stock()["robot_messages"] == 100
    assert world.session.robots[1].dropped == 100
    robot.deliver(b'<Actions LeftMotor="0.03"/>')
    world.session.cycle()
    assert world.session.simulation.robots[0].left_command == 0.03


def test_a_view_gets_a_few_answers_a_cycle(world: World) -> None:
    view = world.join(b"<View/>")
    view.received.clear()
    for _ in range(3):
        for _ in range(VIEW_MESSAGES + 5):
            view.deliver(b"<LabReq/>\0")
        world.session.cycle()
    assert len(view.received) == 3 * ANSWERS
    stock = world.session.take_stock()
    assert (stock["requests"], stock["view_messages"]) == (3 * (VIEW_MESSAGES - ANSWERS), 15)


def test_what_was_dropped_is_counted_once_and_by_world(world: World) -> None:
    world.join(b"<Rat/>")
    assert world.session.take_stock()["junk"] == 1
    world.session.reset()
    assert not any(world.session.take_stock().values())
    world.join(b"<Rat/>")
    assert world.session.dropped_in_all() == {"junk": 2}


def test_dead_views_make_room_for_a_living_one_of_the_same_address(world: World) -> None:
    dead = [world.join(b"<View/>") for _ in range(SOURCE_LIMIT)]
    assert not world.join(b"<View/>").accepted, "all have just come"
    assert world.join(b"<View/>", "10.0.0.2").accepted, "and another address is another matter"
    for view in dead[:10]:
        view.deliver(b"<LabReq/>")
    world.pass_time(GRACE_SECONDS + 0.1)
    assert world.join(b"<View/>").accepted
    assert [view.closed for view in dead] == [number == 10 for number in range(SOURCE_LIMIT)]
    assert world.session.take_stock()["views"] == 1


def test_views_that_have_asked_leave_for_others_only_after_a_long_silence(world: World) -> None:
    views = [world.join(b"<View/>") for _ in range(SOURCE_LIMIT)]
    for view in views:
        view.deliver(b"<GridReq/>")
    world.pass_time(SILENT_SECONDS - 1.0)
    assert not world.join(b"<View/>").accepted
    views[0].deliver(b"<GridReq/>")
    world.pass_time(2.0)
    world.pass_time(SILENT_SECONDS - 1.0)
    assert world.join(b"<View/>").accepted
    assert not views[0].closed
    assert views[1].closed


def test_views_that_never_ask_expire_and_those_that_do_stay(world: World) -> None:
    silent, asking = world.join(b"<View/>"), world.join(b"<View/>")
    panel = world.join(b"<Panel/>")
    asking.deliver(b"<LabReq/>")
    panel.deliver(b"<Start/>")
    connected = world.join(b"<View/>")
    type(connected).connected = property(lambda peer: peer is connected)  # type: ignore[assignment]
    try:
        world.pass_time(NEVER_ASKED_SECONDS - 1.0)
        assert not silent.closed
        world.pass_time(2.0)
    finally:
        del type(connected).connected
    assert [peer.closed for peer in (silent, asking, panel, connected)] == [True, False, False, False]
    assert any("has not asked" in note for note in world.notes)


def test_a_lost_view_is_let_go(world: World) -> None:
    view = world.join(b"<View/>")
    view.lost = True
    world.pass_time(0.1)
    assert view.closed
    assert world.session.views == []


def test_addresses_without_end_do_not_keep_others_out(world: World) -> None:
    forged = [world.join(b"<View/>", f"10.0.{n}.1") for n in range(VIEW_LIMIT)]
    world.pass_time(GRACE_SECONDS + 0.1)
    assert world.join(b"<View/>", "10.1.0.1").accepted
    assert sum(view.closed for view in forged) == 1


@pytest.mark.parametrize(
    ("admission", "source", "data", "accepted"),
    [
        pytest.param({"local_only": True}, "127.0.0.1", b"<View/>", True, id="local-loopback"),
        pytest.param({"local_only": True}, "127.9.9.9", b"<Panel/>", True, id="local-loopback-panel"),
        pytest.param({"local_only": True}, "10.0.0.1", b"<View/>", False, id="local-stranger"),
        pytest.param({"local_only": True}, "10.0.0.1", b"<Panel/>", False, id="local-stranger-panel"),
        pytest.param({"local_only": True, "own": "10.0.0.1"}, "10.0.0.1", b"<View/>", True, id="local-own"),
        pytest.param({"token": "s"}, "127.0.0.1", b"<View/>", False, id="token-missing"),
        pytest.param({"token": "s"}, "127.0.0.1", b'<View Token="t"/>', False, id="token-wrong"),
        pytest.param({"token": "s"}, "10.0.0.1", b'<View Token="s"/>', True, id="token-right"),
        pytest.param({"token": "s"}, "10.0.0.1", b'<Panel Token="s"/>', True, id="token-right-panel"),
        pytest.param({}, "10.0.0.1", b"<View/>", True, id="all"),
    ],
)
def test_who_may_be_a_view(
    admission: dict[str, Any], source: str, data: bytes, accepted: bool, clock: Clock
) -> None:
    world = World(clock, admission=Admission(**admission))
    peer = world.join(data, source)
    assert peer.accepted == accepted
    if not accepted:
        assert decode_simulator_message(peer.received[0]) == Refusal()
        assert peer.closed
    robot = world.join(ROBOT % 1, source)
    assert robot.accepted, "robots are not views"


def test_a_token_is_written_and_read_and_a_view_without_one_is_as_ever() -> None:
    for kind in (ViewRegistration, PanelRegistration):
        for token in (None, "s", 'a"<&'):
            assert decode_registration(encode(kind(token))) == kind(token)
    assert encode(ViewRegistration()) == b"<View/>\0"


def test_somebody_who_sends_junk_only_is_turned_away_and_what_follows_a_registration_is_kept(
    world: World,
) -> None:
    rat = FakeNewcomer("10.0.0.1")
    for number in range(FAULTS_LIMIT):
        assert not rat.turned_away, number
        world.session.welcome(rat, b"<Rat/>")
    assert rat.turned_away
    robot = FakeNewcomer("10.0.0.2")
    world.session.welcome(robot, ROBOT % 1)
    for _ in range(FOLLOWERS_LIMIT + 5):
        world.session.welcome(robot, b'<Actions LeftMotor="0.05"/>')
    world.session.cycle()
    world.session.cycle()
    assert world.session.simulation.robots[0].left_command == 0.05
    assert world.session.take_stock()["registrations"] == 5


def test_one_address_cannot_take_all_the_room_where_registrations_wait(world: World) -> None:
    greedy = [FakeNewcomer("10.0.0.1") for _ in range(2000)]
    for newcomer in greedy:
        world.session.welcome(newcomer, b"<View/>")
    assert world.session.take_stock()["registrations"] == 2000 - WAITING_OF_ONE
    other = FakeNewcomer("10.0.0.2")
    world.session.welcome(other, ROBOT % 1)
    for _ in range(3):
        world.session.cycle()
    assert other.peer.accepted


def test_a_registration_waits_where_no_socket_is_left(world: World) -> None:
    unlucky = FakeNewcomer("10.0.0.1")
    calls = []

    def accept() -> Peer:
        calls.append(1)
        if len(calls) < 5:
            raise OSError(errno.EMFILE, "Too many open files")
        return unlucky.peer

    unlucky.accept = accept  # type: ignore[method-assign]
    world.session.welcome(unlucky, ROBOT % 1)
    rooms: list[int] = []
    world.session.make_room = lambda: rooms.append(1)
    for _ in range(2):
        other = world.join(ROBOT % (2 + len(calls) // 2))
        assert other.accepted, "others do not wait for it"
        assert unlucky.peer.received == []
    world.session.cycle()
    assert unlucky.peer.accepted
    assert len(rooms) == 2
    assert sum("waits" in note for note in world.notes) == 1


def test_an_address_that_cannot_be_answered_is_dropped_at_once(world: World) -> None:
    forged = FakeNewcomer("255.255.255.255")

    def accept() -> Peer:
        raise OSError(errno.EACCES, "Permission denied")

    forged.accept = accept  # type: ignore[method-assign]
    world.session.welcome(forged, ROBOT % 1)
    assert world.join(ROBOT % 1).accepted
    assert world.session.take_stock()["registrations"] == 1
