"""Ten thousand datagrams of every bad kind, while two robots drive: nothing happens to them."""

from __future__ import annotations

import base64
import gzip
import json
import os
import random
import re
import select
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
TRANSCRIPTS = REPOSITORY / "tests/data/golden/transcripts"
DATAGRAMS = 10_000
CYCLES = 500
TIME = re.compile(rb'<Measures Time="(\d+)"')


def golden_datagrams() -> list[bytes]:
    found: set[bytes] = set()
    for path in sorted(TRANSCRIPTS.glob("*.jsonl.gz")):
        with gzip.open(path, "rt") as lines:
            for line in lines:
                event = json.loads(line)
                if event["direction"] == "client->sim":
                    found.add(base64.b64decode(event["payload_b64"]))
    return sorted(found)


def bad_datagrams(seed: int) -> Iterator[bytes]:
    """Yield datagrams without end: random, cut, flipped, huge, deep, full of entities, and whole ones."""
    chance = random.Random(seed)
    golden = golden_datagrams()
    bomb = b"<!DOCTYPE a [" + b"".join(
        b'<!ENTITY %c "%s">' % (98 + n, (b"&%c;" % (97 + n)) * 10) for n in range(9)
    )
    huge = [
        b"<Robot>" + b" " * 65000 + b"</Robot>",
        b'<Robot Name="' + b"n" * 65000 + b'"/>',
        b"\0" * 65507,
        b"<a>" * 300 + b"\0",
        b"<a>" * 21000,
        b'<?xml version="1.0"?>' + bomb + b"]><Actions><Say>&j;</Say></Actions>",
        bomb + b"]><Robot Name='&j;'/>",
        b"<!DOCTYPE a [" + b"<!---->" * 140,
        b'<Actions LeftMotor="1" LeftMotor="' + b"2" * 900 + b'"/>',
        b"\0\nabcdefghijklmnopqrst",
        b'<Robot Id="1" Name="&#0;&#x1F600;"/>',
        b'<Robot Id="99999999999999999999" Name="x"/>',
        b'<Robot Id="3"><IRSensor Id="-1" Angle="nan"/></Robot>',
        b'<?xml version="1.0" encoding="utf-16"?><View/>',
        b"\xff\xfe<\0V\0i\0e\0w\0/\0>\0",
        b"",
    ]
    while True:
        kind = chance.randrange(5)
        data = chance.choice(golden)
        if kind == 0:
            yield chance.randbytes(chance.randrange(1, 1500))
        elif kind == 1:
            yield data[: chance.randrange(len(data) + 1)]
        elif kind == 2 and data:
            flipped = bytearray(data)
            for _ in range(chance.randrange(1, 5)):
                flipped[chance.randrange(len(flipped))] ^= 1 << chance.randrange(8)
            yield bytes(flipped)
        elif kind == 3:
            yield chance.choice(huge) if chance.random() < 0.5 else data * 3
        else:
            yield data


def memory_of(process: int) -> int:
    """Bytes of memory that a process really uses."""
    with open(f"/proc/{process}/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Robot:
    def __init__(self, port: int, number: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(300.0)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.sendto(b'<Robot Id="%d" Name="r%d"/>' % (number, number), ("127.0.0.1", port))
        _, self.address = self.socket.recvfrom(4096)
        self.answer = b'<Actions LeftMotor="0.1" RightMotor="0.0%d"/>\0' % (9 - number)
        self.seen: list[bytes] = []

    def turn(self) -> int:
        """Read Measures and answer; give the time."""
        data = self.socket.recv(4096)
        match = TIME.match(data)
        assert match is not None, data
        time = int(match[1])
        if time:
            self.seen.append(data)
        self.socket.sendto(self.answer, self.address)
        return time


def run(disturb: Callable[[int, list[int], int], None]) -> list[list[bytes]]:
    """Let two robots drive in lockstep; give what they were told from time 1 on."""
    command = [sys.executable, "-m", "simulator_stub", "--bind", "127.0.0.1", "--port", "0", "--seed", "4"]
    command += ["--lab", "maze", "--grid", "3,3,0;7,3,90", "--autostart", "2", "--quiet"]
    command += ["--lockstep", "--answer-limit", "inf"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=REPOSITORY, text=True)
    robots: list[Robot] = []
    try:
        assert process.stdout is not None
        port = int([process.stdout.readline() for _ in range(3)][1].rsplit(":", 1)[1])
        robots = [Robot(port, 1), Robot(port, 2)]
        ports = [port, *(robot.address[1] for robot in robots)]
        by_socket = {robot.socket: robot for robot in robots}
        while min(len(robot.seen) for robot in robots) < CYCLES:
            ready, _, _ = select.select(list(by_socket), [], [], 300.0)
            assert ready, "the simulator has fallen silent"
            for one in ready:
                time = by_socket[one].turn()
                if time and one is robots[0].socket:
                    disturb(time, ports, process.pid)
        assert process.poll() is None
    finally:
        process.kill()
        process.communicate()
        for robot in robots:
            robot.socket.close()
    return [robot.seen[:CYCLES] for robot in robots]


@pytest.mark.slow
def test_bad_datagrams_change_nothing_and_leave_nothing_behind() -> None:
    calm = run(lambda time, ports, process: None)
    assert [len(seen) for seen in calm] == [CYCLES] * 2
    strangers = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(5)]
    bad = bad_datagrams(9)
    sent = 0
    memory: dict[int, int] = {}

    def disturb(time: int, ports: list[int], process: int) -> None:
        nonlocal sent
        while sent < DATAGRAMS * time // (CYCLES - 10) and sent < DATAGRAMS:
            # Every other one to the main port, the rest to the robots' ports: from strangers, all of them.
            port = ports[0] if sent % 2 else ports[1 + sent // 2 % 2]
            strangers[sent % len(strangers)].sendto(next(bad), ("127.0.0.1", port))
            sent += 1
        memory[time] = memory_of(process)

    try:
        disturbed = run(disturb)
    finally:
        for stranger in strangers:
            stranger.close()
    assert sent == DATAGRAMS
    assert disturbed == calm
    assert memory[CYCLES] - memory[CYCLES // 4] < 4 << 20
