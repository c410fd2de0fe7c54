"""Lockstep over loopback: cycles a second of the simulator with robots in a process of their own.

The client is as small as a client can be: it looks for the time only when it has to stop, and answers every
message with the same bytes. What is measured is the simulator, decoding and encoding included, and the way to
and fro. The reference sends the same bytes to and fro, and does nothing else.
"""

from __future__ import annotations

import math
import os
import re
import select
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.measure import Row

CYCLES = {1: 12_000, 5: 5_000}
"""Cycles of a run, by the number of robots."""

TARGETS = {1: 1 / 12_000, 5: 1 / 4_000}
"""Seconds a cycle that were asked for."""

SERIES = 3

REGISTRATION = b'<Robot Id="%d" Name="r%d"/>\0'
ANSWER = b'<Actions LeftMotor="0.1" RightMotor="0.08"/>\0'
MEASURES = b"m" * 355 + b"\0"
"""As long as the Measures of a robot with the usual sensors."""

_END = b'Start="Off" Stop="Off"'


def rows() -> Iterator[Row]:
    """Yield the rows of this benchmark."""
    for robots in CYCLES:
        group = f"lockstep on loopback, {robots} robot{'s' if robots > 1 else ''} in maze, a cycle"
        for transport in ("udp", "tcp"):
            if transport == "udp":
                seconds = min(echo(robots)[0] for _ in range(SERIES))
                yield Row(
                    group=group,
                    who="the same datagrams, nothing done",
                    seconds=seconds,
                    reference=True,
                    note=f"{1 / seconds:,.0f} cycles/s",
                )
            seconds = min(run_cycles(transport, robots)[0] for _ in range(SERIES))
            yield Row(
                group=group,
                who=f"simulator_stub over {transport.upper()}",
                seconds=seconds,
                ours=True,
                target=TARGETS[robots],
                note=f"{1 / seconds:,.0f} cycles/s",
            )


def run_cycles(
    transport: str, robots: int, *options: str, folder: str | None = None, alone: bool = False
) -> tuple[float, float]:
    """Run the simulator once; return the seconds of one cycle, and its processor time.

    Options, folder and `alone` are those of `simulator`.
    """
    with simulator(CYCLES[robots], robots, *options, folder=folder, alone=alone) as (port, pid):
        client = _udp_clients if transport == "udp" else _tcp_clients
        seconds, used = client(port, robots, lambda: _processor_seconds(pid))
    return seconds / CYCLES[robots], used / CYCLES[robots]


def _processor_seconds(pid: int) -> float:
    """Return the processor time of a process so far; nan where the system does not tell (all but Linux)."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text(encoding="ascii").split()[0]) / 1e9
    except OSError:
        return math.nan


@contextmanager
def simulator(
    cycles: int, robots: int, *options: str, folder: str | None = None, alone: bool = False
) -> Iterator[tuple[int, int]]:
    """Run a simulator in a process of its own; yield its port and its process number.

    Parameters
    ----------
    cycles, robots : int
    *options : str
        More options of the command.
    folder : str or None
        Checkout of the version to run; None: this one.
    alone : bool
        Whether it may use one processor only, and so never waits awake, which takes processor time.
    """
    with tempfile.TemporaryDirectory() as scratch:
        parameters = Path(scratch) / "params.xml"
        parameters.write_text(f'<Parameters SimTime="{cycles}" CycleTime="50"/>', encoding="utf-8")
        grid = ";".join(f"{3 + 4 * number},3,0" for number in range(robots))
        command = [sys.executable, "-m", "simulator_stub", "--lab", "maze", "--grid", grid, "--seed", "1"]
        command += ["--param", str(parameters), "--lockstep", "--exit-at-end", "--autostart", str(robots)]
        command += ["--bind", "127.0.0.1", "--port", "0", *options]
        quiet = subprocess.DEVNULL
        before = os.sched_getaffinity(0) if alone else None
        if before is not None:
            os.sched_setaffinity(0, {max(before)})  # the child inherits it
        try:
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=quiet, text=True, cwd=folder)
        finally:
            if before is not None:
                os.sched_setaffinity(0, before)
        with process:
            assert process.stdout is not None
            lines = [process.stdout.readline() for _ in range(3)]
            try:
                yield int(lines[1].rsplit(":", 1)[1]), process.pid
                process.wait(20.0)
            finally:
                process.kill()


def _udp_clients(port: int, robots: int, used: Callable[[], float]) -> tuple[float, float]:
    sockets = []
    for number in range(1, robots + 1):
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        own.bind(("127.0.0.1", 0))
        own.sendto(REGISTRATION % (number, number), ("127.0.0.1", port))
        _, address = own.recvfrom(4096)
        own.connect(address)
        sockets.append(own)
    return _drive(sockets, used)


def _tcp_clients(port: int, robots: int, used: Callable[[], float]) -> tuple[float, float]:
    sockets = []
    for number in range(1, robots + 1):
        own = socket.create_connection(("127.0.0.1", port))
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        own.sendall(REGISTRATION % (number, number))
        sockets.append(own)
    return _drive(sockets, used)


def _drive(sockets: list[socket.socket], used: Callable[[], float]) -> tuple[float, float]:
    """Answer everything until the end; return the seconds from time 1 on, and those of `used`."""
    began = used_before = 0.0
    poll = select.poll()
    by_number = {own.fileno(): own for own in sockets}
    for own in sockets:
        poll.register(own, select.POLLIN)
    running = re.compile(rb'<Measures Time="[1-9]')
    alone = sockets[0] if len(sockets) == 1 else None
    ended: set[int] = set()
    while len(ended) < len(sockets):
        for own in [alone] if alone else [by_number[number] for number, _ in poll.poll()]:
            assert own is not None
            data = own.recv(65536)
            if not began and running.search(data):
                began, used_before = time.perf_counter(), used()
            if _END in data or not data:
                ended.add(own.fileno())
                continue
            if b"</Measures>" in data:
                own.send(ANSWER)
    seconds, processor = time.perf_counter() - began, used() - used_before
    for own in sockets:
        own.close()
    return seconds, processor


_SOCKETS = """
import socket, sys, time
robots, cycles = int(sys.argv[1]), int(sys.argv[2])
sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(robots)]
for own in sockets:
    own.bind(("127.0.0.1", 0))
"""
_MEET = """
print(*(own.getsockname()[1] for own in sockets), flush=True)
addresses = [own.recvfrom(64)[1] for own in sockets]
for own, address in zip(sockets, addresses):
    own.connect(address)
began = time.process_time()
"""
_PART = """
print(time.process_time() - began, flush=True)
for own in sockets:
    own.send(b"end")
"""


_ECHO = f"""{_SOCKETS}
message = b"m" * 355 + b"\\0"
{_MEET}
for _ in range(cycles):
    for own in sockets:
        own.send(message)
    for own in sockets:
        own.recv(2048)
{_PART}"""


_BARE_LOOP = f"""{_SOCKETS}
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.protocol import RobotRegistration, decode_actions
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation
grid = StartGrid(positions=[GridPosition(x=3.0 + 4 * number, y=3.0) for number in range(robots)])
lab, compiled = read_lab(find_lab("maze")), sys.argv[3] == "compiled"
simulation = Simulation(lab, grid, Parameters(sim_time=0), seed=1, compiled=compiled)
for _ in range(robots):
    simulation.register(RobotRegistration())
simulation.launch()
{_MEET}
for _ in range(cycles):
    for own, data in zip(sockets, simulation.advance_encoded().values()):
        own.send(data)
    simulation.end_cycle()
    simulation.begin_cycle()
    for robot, own in enumerate(sockets, start=1):
        simulation.act(robot, decode_actions(own.recv(2048)))
{_PART}"""


def bare_loop(robots: int, *, compiled: bool) -> float:
    """Return the processor time of a cycle of nothing but receive, decode, step, encode and send."""
    return echo(robots, _BARE_LOOP, "compiled" if compiled else "plain")[1]


def echo(robots: int, code: str = _ECHO, *arguments: str) -> tuple[float, float]:
    """Send and receive the same bytes by another process; return the seconds and its processor time."""
    cycles = CYCLES[robots]
    command = [sys.executable, "-c", code, str(robots), str(cycles), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ports = [int(text) for text in process.stdout.readline().split()]
        sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in ports]
        for own, port in zip(sockets, ports, strict=True):
            own.connect(("127.0.0.1", port))
            own.send(b"hello")
        poll = select.poll()
        by_number = {own.fileno(): own for own in sockets}
        for own in sockets:
            poll.register(own, select.POLLIN)
        alone = sockets[0] if robots == 1 else None
        began = time.perf_counter()
        left = robots
        while left:
            for own in [alone] if alone else [by_number[number] for number, _ in poll.poll()]:
                assert own is not None
                if own.recv(4096) == b"end":
                    left -= 1
                else:
                    own.send(ANSWER)
        seconds = time.perf_counter() - began
        for own in sockets:
            own.close()
        used = float(process.stdout.readline())
    return seconds / cycles, used / cycles
