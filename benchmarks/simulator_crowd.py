"""Twenty robots at once in real time: cycles that come late, messages that are lost, processor time.

``python -m benchmarks.simulator_crowd [seconds]`` measures for a minute over each transport; `crowd` is also
what the tests use, for a shorter time.
"""

from __future__ import annotations

import contextlib
import re
import resource
import select
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.measure import Row

ROBOTS = 20
CYCLE_MILLISECONDS = 10
SECONDS = 60.0

_TIME = re.compile(rb'<Measures Time="(\d+)"')
_END = b'Start="Off" Stop="Off"'
_DELAYS = re.compile(r"(\d+) cycles came late, by (\d+) cycle times")
_REGISTRATION = b'<Robot Id="%d" Name="robot %d"/>\0'


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """Outcome of a run with many robots.

    Attributes
    ----------
    cycles : int
        Simulated.
    late, behind : int
        Cycles that the simulator says it began more than a cycle time late, and cycle times lost in all.
    missing : int
        Measures that robots did not get, of cycles x robots.
    processor : float
        Seconds of processor time of the simulator, from its start to its end.
    wall : float
        Seconds from the first cycle to the last.
    """

    cycles: int
    late: int
    behind: int
    missing: int
    processor: float
    wall: float


def rows() -> Iterator[Row]:
    """Yield the processor time of a cycle, over each transport; takes a few seconds."""
    for transport in ("udp", "tcp"):
        run = crowd(transport, seconds=5.0)
        yield Row(
            group=f"{ROBOTS} robots in real time, {CYCLE_MILLISECONDS} ms a cycle; processor time a cycle",
            who=f"simulator_stub over {transport.upper()}",
            seconds=run.processor / run.cycles,
            ours=True,
            target=CYCLE_MILLISECONDS / 1000.0,
            note=describe(run),
        )


def describe(run: Crowd) -> str:
    """Return a run as text."""
    return (
        f"{run.cycles} cycles in {run.wall:.2f} s, {run.late} late by {run.behind} cycle times in all,"
        f" {run.missing} Measures missing, {run.processor / run.wall:.0%} of a core"
    )


def crowd(transport: str, *, seconds: float, robots: int = ROBOTS) -> Crowd:
    """Run many robots in the open lab, in real time.

    Parameters
    ----------
    transport : {"udp", "tcp"}
    seconds : float
        Simulated time.
    robots : int
        At most 20.

    Returns
    -------
    Crowd
    """
    cycles = round(seconds * 1000.0 / CYCLE_MILLISECONDS)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        parameters = Path(folder) / "params.xml"
        parameters.write_text(f'<Parameters SimTime="{cycles}" CycleTime="{CYCLE_MILLISECONDS}"/>')
        command = [sys.executable, "-m", "simulator_stub", "--lab", "open", "--grid", "open", "--seed", "1"]
        command += ["--param", str(parameters), "--autostart", str(robots), "--exit-at-end"]
        command += ["--bind", "127.0.0.1", "--port", "0"]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
            try:
                assert process.stdout is not None
                port = int([process.stdout.readline() for _ in range(3)][1].rsplit(":", 1)[1])
                missing, wall = _drive(transport, port, robots, cycles)
                _, told = process.communicate(timeout=30.0)
            finally:
                process.kill()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    delays = _DELAYS.search(told)
    assert delays is not None, told
    return Crowd(
        cycles=cycles,
        late=int(delays[1]),
        behind=int(delays[2]),
        missing=missing,
        processor=after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        wall=wall,
    )


class _Robot:
    """One client: counts the cycles that it is told of, and drives in a curve of its own."""

    def __init__(self, transport: str, port: int, number: int) -> None:
        registration = _REGISTRATION % (number, number)
        if transport == "udp":
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.socket.bind(("127.0.0.1", 0))
            self.socket.sendto(registration, ("127.0.0.1", port))
            _, address = self.socket.recvfrom(4096)
            self.socket.connect(address)
        else:
            self.socket = socket.create_connection(("127.0.0.1", port))
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.socket.sendall(registration)
        self.answer = b'<Actions LeftMotor="%.3f" RightMotor="0.1"/>\0' % (0.05 + 0.004 * number)
        self.times: set[int] = set()
        self.ended = False
        self._rest = b""

    def read(self) -> None:
        try:
            received = self.socket.recv(65536)
        except ConnectionError:  # the simulator has ended with our last answer unread
            received = b""
        self.ended |= not received
        data = self._rest + received
        *messages, self._rest = data.split(b"\0")
        for message in messages:
            time = _TIME.match(message)
            if time is not None:
                self.times.add(int(time[1]))
                self.ended |= _END in message
                with contextlib.suppress(ConnectionError):
                    self.socket.send(self.answer)


def _drive(transport: str, port: int, robots: int, cycles: int) -> tuple[int, float]:
    """Answer until all have seen the end; return the missing Measures, and the time."""
    import time

    clients = [_Robot(transport, port, number) for number in range(1, robots + 1)]
    by_number = {client.socket.fileno(): client for client in clients}
    poll = select.poll()
    for number in by_number:
        poll.register(number, select.POLLIN)
    began = 0.0
    while not all(client.ended for client in clients):
        ready = poll.poll(5000)
        if not ready:
            break  # the last messages were lost
        for number, _ in ready:
            by_number[number].read()
            if by_number[number].ended:
                poll.unregister(number)
        if not began and any(1 in client.times for client in clients):
            began = time.monotonic()
    wall = time.monotonic() - began
    for client in clients:
        client.socket.close()
    expected = set(range(1, cycles + 1))
    return sum(len(expected - client.times) for client in clients), wall


if __name__ == "__main__":
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    for name in ("udp", "tcp"):
        print(f"{name}: {describe(crowd(name, seconds=duration))}", flush=True)
