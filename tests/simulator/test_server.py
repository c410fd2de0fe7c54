"""The simulator on real sockets, loopback only, in a thread of the test."""

from __future__ import annotations

import contextlib
import csv
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ciberrato.errors import UsageError
from ciberrato.net import TcpLink, UdpLink
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    Refusal,
    RobotRegistration,
    RobotStatus,
    Start,
    ViewRegistration,
    decode_simulator_message,
    encode,
)
from simulator_stub.assembly import build_server
from simulator_stub.options import parse_arguments
from simulator_stub.service.server import Server

LINKS: dict[str, Callable[[str, int], Any]] = {"udp": UdpLink, "tcp": TcpLink}
MOVE = encode(Actions(left_motor=0.1, right_motor=0.11))
PATIENCE = 300.0  # seconds; only a failure takes so long
LOCKSTEP = (
    "--lockstep",
    "--answer-limit",
    "inf",
)  # however long this machine leaves a robot without a processor


@contextlib.contextmanager
def serving(*arguments: str) -> Iterator[tuple[Server, int]]:
    lines: list[str] = []
    options = parse_arguments(["--bind", "127.0.0.1", "--port", "0", "--seed", "1", *arguments])
    server = build_server(options, print_line=lines.append, notify=lambda line: None)
    ports = {int(line.rsplit(":", 1)[1]) for line in lines if line.startswith("listening on ")}
    assert len(ports) == 1
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server, ports.pop()
    finally:
        server.stop()
        thread.join(PATIENCE)
        assert not thread.is_alive()
        server.close()


def receive(link: Any) -> Any:
    data = link.receive(PATIENCE)
    assert data is not None
    return decode_simulator_message(data)


def registered(transport: str, port: int, name: str = "r", robot_id: int = 0) -> Any:
    link = LINKS[transport]("127.0.0.1", port)
    link.register(encode(RobotRegistration(name=name, robot_id=robot_id)))
    assert isinstance(receive(link), Acceptance)
    return link


def drive(link: Any, cycles: int) -> list[Measures]:
    """Answer that many Measures of a running simulator; give back those with their times."""
    seen: list[Measures] = []
    while len(seen) < cycles:
        measures = receive(link)
        assert isinstance(measures, Measures)
        if measures.time:
            seen.append(measures)
        link.send(MOVE)
    return seen


@pytest.mark.parametrize("transport", LINKS)
def test_a_robot_drives_in_lockstep_and_the_run_is_the_same_every_time(transport: str) -> None:
    runs = []
    for _ in range(2):
        with (
            serving(*LOCKSTEP, "--autostart", "1", "--lab", "maze") as (_, port),
            registered(transport, port) as link,
        ):
            runs.append(drive(link, 200))
    assert [measures.time for measures in runs[0]] == list(range(1, 201))
    assert runs[0] == runs[1]
    assert len({measures.infrared for measures in runs[0]}) > 50


def test_both_transports_give_the_same_run() -> None:
    runs = []
    for transport in LINKS:
        with serving(*LOCKSTEP, "--autostart", "1") as (_, port), registered(transport, port) as link:
            runs.append(drive(link, 50))
    assert runs[0] == runs[1]


def test_three_robots_and_a_view_on_both_transports(tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    arguments = (*LOCKSTEP, "--grid", "9,3,0;13,3,90;5,7,-90", "--truth", str(truth))
    with serving(*arguments) as (server, port), contextlib.ExitStack() as stack:
        view = stack.enter_context(UdpLink("127.0.0.1", port))
        view.register(encode(ViewRegistration()))
        assert isinstance(receive(view), Acceptance)
        robots = [stack.enter_context(registered(kind, port)) for kind in ("udp", "tcp", "udp")]
        refused = stack.enter_context(TcpLink("127.0.0.1", port))
        refused.register(encode(RobotRegistration()))
        assert receive(refused) == Refusal()
        view.send(encode(Start()))
        time = 0
        while time < 100:
            for robot in robots:
                time = receive(robot).time
                robot.send(MOVE)
        statuses = [decode_simulator_message(data) for data in view.receive_waiting()]
        assert {s.robot_id for s in statuses if isinstance(s, RobotStatus)} == {1, 2, 3}
    rows = list(csv.DictReader(truth.read_text().splitlines()))
    assert [(row["time"], row["robot"]) for row in rows[:3]] == [("0", "1"), ("0", "2"), ("0", "3")]
    assert [float(rows[2][name]) for name in ("x", "y", "dir_deg")] == [5.0, 7.0, -90.0]
    last = {int(row["robot"]): row for row in rows}
    for robot_record in server.simulation.robots:
        row = last[robot_record.robot_id]
        assert (float(row["x"]), float(row["y"])) == (robot_record.x, robot_record.y)
        assert row["state"] == "Running"


def test_datagrams_of_strangers_are_dropped() -> None:
    with (
        serving("--speed", "10") as (server, port),
        registered("udp", port) as link,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        stranger.sendto(encode(Actions(left_motor=-0.15)), link.peer)
        link.send(encode(Actions(right_motor=0.12)))
        while server.simulation.robots[0].right_command != 0.12:
            receive(link)
        assert server.simulation.robots[0].left_command == 0.0


def test_a_robot_whose_connection_ends_stays_and_does_not_hold_up_the_others() -> None:
    arguments = (*LOCKSTEP, "--autostart", "2", "--grid", "9,3,0;13,3,90")
    with serving(*arguments) as (_, port), registered("udp", port) as link:
        leaving = registered("tcp", port)
        leaving.close()
        times = [measures.time for measures in drive(link, 20)]
    assert times == list(range(1, 21))


def test_in_real_time_cycles_go_on_whether_or_not_anybody_answers() -> None:
    with serving("--speed", "25", "--autostart", "1") as (_, port), registered("udp", port) as link:
        while receive(link).time < 20:
            pass


def test_registrations_that_make_no_sense_get_no_answer_and_do_no_harm() -> None:
    with serving("--speed", "50") as (_, port), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for rubbish in (
            b"",
            b"\0",
            b"<Robot",
            b"\xff" * 60000,
            b"<a>" * 20000,
            b'<Robot Id="1"><Rat/></Robot>',
        ):
            stranger.sendto(rubbish, ("127.0.0.1", port))
        with socket.create_connection(("127.0.0.1", port)) as connection:
            connection.sendall(b"x" * 200_000)  # no end in sight
            connection.settimeout(PATIENCE)
            with contextlib.suppress(ConnectionResetError):
                assert connection.recv(100) == b"", "cut off"
        with registered("udp", port):
            stranger.setblocking(False)
            with pytest.raises(BlockingIOError):
                stranger.recv(100)


def test_a_client_that_does_not_read_is_cut_off_and_holds_up_nobody() -> None:
    with (
        serving("--speed", "1000", "--lab", "wide") as (server, port),
        socket.create_connection(("127.0.0.1", port)) as lazy,
        registered("udp", port) as link,
    ):
        lazy.sendall(encode(ViewRegistration()))
        while not server.session.views:
            receive(link)
        peer = server.session.views[0].peer
        with contextlib.suppress(OSError):
            while not peer.closed:
                lazy.sendall(b"<LabReq/>\0" * 50)
                receive(link)
        assert peer.closed
        assert isinstance(receive(link), Measures)


def test_a_port_in_use_is_an_error_on_either_transport() -> None:
    for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
        with socket.socket(socket.AF_INET, kind) as holder:
            holder.bind(("127.0.0.1", 0))
            if kind == socket.SOCK_STREAM:
                holder.listen()
            port = str(holder.getsockname()[1])
            options = parse_arguments(["--bind", "127.0.0.1", "--port", port])
            with pytest.raises(UsageError, match=f"127.0.0.1:{port}: Address already in use"):
                build_server(options, print_line=lambda line: None, notify=lambda line: None)


def test_without_tcp_nobody_listens_there() -> None:
    with serving("--no-tcp") as (_, port), pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))
