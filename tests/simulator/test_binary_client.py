"""A tiny agent of the oldest kind, 22 bytes at a time, against the simulator over UDP."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from pathlib import Path

from ciberrato.net import UdpLink
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    RobotRegistration,
    decode_simulator_message,
    encode,
)
from simulator_stub.assembly import build_server
from simulator_stub.options import parse_arguments

PATIENCE = 300.0  # seconds; only a failure takes so long
CYCLES = 60


@contextlib.contextmanager
def serving(*arguments: str) -> Iterator[tuple[int, list[str]]]:
    """Serve in a thread; give the port, and what people are told."""
    lines: list[str] = []
    notes: list[str] = []
    options = parse_arguments(["--bind", "127.0.0.1", "--port", "0", "--seed", "5", *arguments])
    server = build_server(options, print_line=lines.append, notify=notes.append)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server.port, notes
    finally:
        server.stop()
        thread.join(PATIENCE)
        assert not thread.is_alive()
        server.close()


class Mouse:
    """The agent: it knows nothing of XML."""

    def __init__(self, port: int, name: bytes = b"mouse") -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.sendto(struct.pack(">H20s", 10, name), ("127.0.0.1", port))
        reply, self.address = self.socket.recvfrom(22)
        self.answer, self.cycle_time = struct.unpack_from(">2H", reply)
        assert len(reply) == 22

    def measures(self) -> tuple[int, ...]:
        return struct.unpack(">11H", self.socket.recv(100))

    def act(self, left: float, right: float, end: bool = False) -> None:
        powers = [round(1000 * (power + 2)) for power in (left, right)]
        self.socket.sendto(struct.pack(">3H", *powers, end), self.address)


def told_in_binary(port: int) -> list[tuple[int, ...]]:
    """Drive a mouse; give what it was told from time 1 on."""
    mouse = Mouse(port)
    assert (mouse.answer, mouse.cycle_time) == (25, 50)
    seen: list[tuple[int, ...]] = []
    with mouse.socket:
        while len(seen) < CYCLES:
            words = mouse.measures()
            if words[0]:
                seen.append(words)
            mouse.act(0.1, 0.08, end=words[0] == CYCLES - 3)
    return seen


def told_in_xml(port: int) -> list[tuple[int, ...]]:
    """Drive the same way by XML, and put the words together by hand."""
    seen: list[tuple[int, ...]] = []
    with UdpLink("127.0.0.1", port) as link:
        link.register(encode(RobotRegistration(name="mouse")))
        while len(seen) < CYCLES:
            data = link.receive(PATIENCE)
            assert data is not None
            message = decode_simulator_message(data)
            if isinstance(message, Acceptance):
                continue
            assert isinstance(message, Measures)
            if message.time:
                front, left, right, _ = (round(10 * (reading or 0)) % 65536 for reading in message.infrared)
                bearing = message.beacons[0].bearing
                assert message.compass is not None
                assert message.ground is not None
                seen.append(
                    (
                        *(message.time, front, right, left),
                        65535 if bearing is None else int(bearing) + 360,
                        *(int(message.compass) + 360, message.ground % 65536, int(bool(message.collision))),
                        *(int(message.start), int(message.stop), int(message.end_led)),
                    )
                )
            end = True if message.time == CYCLES - 3 else None
            # Thousandths are all that words can say.
            link.send(encode(Actions(left_motor=2100 / 1000 - 2, right_motor=2080 / 1000 - 2, end_led=end)))
    return seen


OPTIONS = (
    "--lab",
    "maze",
    "--grid",
    "maze",
    "--beacon",
    "--autostart",
    "1",
    "--lockstep",
    "--answer-limit",
    "inf",
)


def test_a_binary_agent_is_told_what_one_of_today_is() -> None:
    with serving(*OPTIONS) as (port, notes):
        binary = told_in_binary(port)
        assert any("'mouse', registered" in note and "binary" in note for note in notes)
    with serving(*OPTIONS) as (port, _):
        xml = told_in_xml(port)
    assert binary == xml
    assert [words[0] for words in binary] == list(range(1, CYCLES + 1))
    assert len({words[1:4] for words in binary}) > 5, "it moves"
    assert [words[10] for words in binary[-4:]] == [0, 1, 1, 1], "and says that it has finished"


def test_a_binary_agent_takes_the_first_free_place_or_is_refused() -> None:
    with (
        serving("--lab", "maze", "--grid", "1,1,0;3,1,0", "--no-tcp") as (port, notes),
        UdpLink("127.0.0.1", port) as other,
    ):
        other.register(encode(RobotRegistration(name="x", robot_id=1)))
        assert other.receive(PATIENCE)
        mice = [Mouse(port, name) for name in (b"one", b"two")]
        assert [mouse.answer for mouse in mice] == [25, 26]
        assert any(note.startswith("robot 2, 'one', registered") for note in notes)
        for mouse in mice:
            mouse.socket.close()


def test_what_is_too_short_is_a_broken_message(tmp_path: Path) -> None:
    endless = tmp_path / "endless.xml"  # no slow machine comes to its end before the message does
    endless.write_text('<Parameters SimTime="100000000"/>')
    words = ("--param", str(endless), "--autostart", "1", "--speed", "50")
    with serving("--lab", "maze", "--grid", "1,1,0", *words) as (port, notes):
        mouse = Mouse(port)
        with mouse.socket:
            mouse.socket.sendto(b"\x07", mouse.address)
            while not any(note.startswith("robot 1: ") for note in notes):
                mouse.measures()
            mouse.act(0.0, 0.0, end=True)
            while not mouse.measures()[10]:
                pass
