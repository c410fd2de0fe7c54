"""A simulator in long use: agents come and go over UDP and TCP, run after run, and five pages look on.

As a program::

    python -m tests.chaos.soak --minutes 20 [--speed 20]

Checks that memory, descriptors and threads of simulator and viewer are flat, and that every truth and result
file is right: whole, in agreement with one another, and with what the agents have heard themselves.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import itertools
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from websockets.asyncio.client import connect
from websockets.typing import Origin

GRID = "3,3,0;7,3,0;11,3,0;15,3,0;19,3,0;23,3,0"
AGENTS = 5
PAGES = 5
SIM_TIME = 1000
MOST_RUNS = 1_000_000
PERIOD = 0.050
ANSWER = b'<Actions LeftMotor="%.2f" RightMotor="%.2f"/>'
_PATIENCE = 20.0
"""Seconds for an answer: who gives up too soon has a robot in the run that will never drive."""
_TIME = re.compile(rb'<Measures Time="(\d+)')
_OVER = b'Start="Off" Stop="Off"'


@dataclass
class Seen:
    """What agents and pages have met.

    Attributes
    ----------
    registered : list of int
    left : list of set of int
        Who has registered, and who has left before the end, by run.
    intervals : list of float
        Between Measures of cycles that follow one another, of the first robot, in cycle times.
    heard : list of dict of int to int
        Measures of running cycles, by run and robot.
    frames : int
        That the pages got.
    delays : str
        What the simulator says of its own delays.
    samples : dict of str to list of (int, int, int)
        Kilobytes, descriptors and threads, once a second, by program.
    """

    registered: list[int] = field(default_factory=list)
    left: list[set[int]] = field(default_factory=list)
    intervals: list[float] = field(default_factory=list)
    heard: list[dict[int, int]] = field(default_factory=list)
    frames: int = 0
    delays: str = ""
    ended: bool = False
    samples: dict[str, list[tuple[int, int, int]]] = field(default_factory=dict)

    def goes_on(self, run: int, end: float) -> bool:
        """Return whether there is to be a run, the same for every agent: the first one that asks decides."""
        if run == len(self.registered) and not self.ended:
            self.ended = run >= 2 and time.monotonic() > end
            if not self.ended:
                self.registered.append(0)
                self.left.append(set())
                self.heard.append({})
        return run < len(self.registered)


class Agent(asyncio.DatagramProtocol):
    """A robot over UDP."""

    def __init__(self) -> None:
        self.inbox: asyncio.Queue[bytes] = asyncio.Queue()
        self.transport: Any = None
        self.address: Any = None

    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def datagram_received(self, data: bytes, address: Any) -> None:
        self.address = address
        self.inbox.put_nowait(data)

    def send(self, data: bytes) -> None:
        self.transport.sendto(data, self.address)

    async def receive(self) -> bytes:
        return await self.inbox.get()

    def close(self) -> None:
        self.transport.close()


class StreamAgent:
    """A robot over TCP."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    def send(self, data: bytes) -> None:
        self._writer.write(data + b"\0")

    async def receive(self) -> bytes:
        return await self._reader.readuntil(b"\0")

    def close(self) -> None:
        self._writer.close()


async def join(port: int, position: int, *, tcp: bool) -> Agent | StreamAgent:
    """Register, again and again until there is room: the run before may not have ended yet."""
    while True:
        registration = b'<Robot Id="%d" Name="agent%d"/>' % (position, position)
        agent: Agent | StreamAgent
        if tcp:
            agent = StreamAgent(*await asyncio.open_connection("127.0.0.1", port))
        else:
            _, agent = await asyncio.get_running_loop().create_datagram_endpoint(
                Agent, local_addr=("127.0.0.1", 0)
            )
            agent.address = ("127.0.0.1", port)
        agent.send(registration)
        with contextlib.suppress(asyncio.TimeoutError, OSError, asyncio.IncompleteReadError):
            if b'Status="Ok"' in await asyncio.wait_for(agent.receive(), _PATIENCE):
                return agent
        agent.close()
        await asyncio.sleep(0.02)


async def take_part(port: int, position: int, end: float, seen: Seen, speed: float) -> None:
    """Drive in every run, over UDP and TCP in turn; in one of four, leave before its end."""
    chance = random.Random(position)
    for run in itertools.count():
        if not seen.goes_on(run, end):
            return
        agent = await join(port, position, tcp=bool((run + position) % 2))
        seen.registered[run] += 1
        until = chance.randrange(SIM_TIME // 4, SIM_TIME) if chance.random() < 0.25 else None
        before = (0, 0.0)
        while True:
            try:
                data = await asyncio.wait_for(agent.receive(), 60.0)
            except (OSError, asyncio.IncompleteReadError):
                break
            match = _TIME.search(data)
            if match is None:
                continue
            now, cycle = time.perf_counter(), int(match[1])
            if cycle:
                seen.heard[run][position] = seen.heard[run].get(position, 0) + 1
                if position == 1 and cycle == before[0] + 1 > 1:
                    seen.intervals.append((now - before[1]) * speed / PERIOD)
                before = (cycle, now)
            if _OVER in data:
                break
            if until is not None and cycle >= until:
                seen.left[run].add(position)
                break
            agent.send(ANSWER % (chance.uniform(-0.05, 0.15), chance.uniform(-0.05, 0.15)))
        agent.close()


async def look_on(url: str, number: int, seen: Seen) -> None:
    """Be a page, and every half a minute or so another one."""
    chance = random.Random(number)
    while True:
        until = time.monotonic() + chance.uniform(5.0, 40.0)
        async with connect(
            url.replace("http", "ws") + "socket",
            origin=Origin(url.rstrip("/")),
            max_size=None,
            ping_interval=None,
            compression=None,
            open_timeout=None,  # on a machine that has no time a page comes late, and not never
        ) as connection:
            while time.monotonic() < until:
                text = await connection.recv()
                assert isinstance(text, str)
                seen.frames += text.startswith('{"type":"frame"')


async def sample(name: str, pid: int, seen: Seen) -> None:
    """Note memory, descriptors and threads once a second."""
    samples = seen.samples.setdefault(name, [])
    while True:
        await asyncio.sleep(1.0)
        with contextlib.suppress(OSError, StopIteration):
            status = dict(
                line.split(":", 1)
                for line in Path(f"/proc/{pid}/status").read_text().splitlines()
                if ":" in line
            )
            descriptors = len(os.listdir(f"/proc/{pid}/fd"))
            samples.append((int(status["VmRSS"].split()[0]), descriptors, int(status["Threads"])))


@contextlib.contextmanager
def program(*words: str, errors: Path) -> Iterator[subprocess.Popen[str]]:
    """Run a program of ours while the block does."""
    with (
        open(errors, "w") as stderr,
        subprocess.Popen(
            [sys.executable, "-m", *words], stdout=subprocess.PIPE, stderr=stderr, text=True
        ) as process,
    ):
        try:
            yield process
        finally:
            process.kill()


def expect(process: subprocess.Popen[str], pattern: str) -> str:
    """Read lines until one fits; return its first group."""
    assert process.stdout is not None
    for line in process.stdout:
        if match := re.search(pattern, line):
            return match[1]
    raise AssertionError(f"no line has {pattern}")


async def soak(seconds: float, speed: float, folder: Path) -> Seen:
    """Let the agents take part in run after run until time is up, `speed` times real time; check all files.

    Raises
    ------
    AssertionError
        If anything is not as it has to be.
    """
    seen = Seen()
    parameters = folder / "parameters.xml"
    parameters.write_text(f'<Parameters SimTime="{SIM_TIME}" CycleTime="{PERIOD * 1000:.0f}"/>')
    words = ["simulator_stub", "--lab", "maze", "--grid", GRID, "--seed", "1", "--param", str(parameters)]
    words += ["--speed", f"{speed:g}", "--runs", str(MOST_RUNS), "--autostart", str(AGENTS), "--port", "0"]
    words += ["--truth", str(folder / "truth.csv"), "--result", str(folder / "result.json")]
    with program(*words, errors=folder / "simulator.err") as simulator:
        port = int(expect(simulator, r"listening on udp .*:(\d+)"))
        viewer_words = ("ciberrato.viewer", "--simulator", f"127.0.0.1:{port}", "--http", "0", "--no-overlay")
        with program(*viewer_words, errors=folder / "viewer.err") as viewer:
            url = expect(viewer, r"page: (\S+)")
            side = [
                asyncio.create_task(sample(name, process.pid, seen))
                for name, process in (("simulator", simulator), ("viewer", viewer))
            ]
            side += [asyncio.create_task(look_on(url, number, seen)) for number in range(PAGES)]
            end = time.monotonic() + seconds
            agents = [take_part(port, 1 + number, end, seen, speed) for number in range(AGENTS)]
            work = asyncio.gather(*agents)
            await asyncio.wait([work, *side], return_when=asyncio.FIRST_COMPLETED)
            if not work.done():  # who looks on has failed: an hour later is too late to say so
                work.cancel()
                raise AssertionError([task.exception() for task in side if task.done()])
            await work
            while len(json.loads((folder / "result.json").read_text())["runs"]) < len(seen.registered):
                await asyncio.sleep(0.1)  # the last run goes on to its end, and so does its record
            simulator.terminate()
            status = await asyncio.to_thread(simulator.wait, 60.0)
            failed = [task.exception() for task in side if task.done()]
            for task in side:
                task.cancel()
            await asyncio.gather(*side, return_exceptions=True)
            assert not failed, failed
            assert viewer.poll() is None
    assert status == 0
    for name in ("simulator", "viewer"):
        assert "Traceback" not in (folder / f"{name}.err").read_text()
    said = (folder / "simulator.err").read_text()
    seen.delays = next((line for line in said.splitlines() if "came late" in line), "no cycle came late")
    check_files(folder, len(seen.registered), seen)
    return seen


def check_files(folder: Path, runs: int, seen: Seen) -> None:
    """Compare every truth file with the result, and both with what the agents have heard."""
    result = json.loads((folder / "result.json").read_text())
    assert len(result["runs"]) == runs
    assert seen.registered == [AGENTS] * runs
    for number, (run, left, heard) in enumerate(zip(result["runs"], seen.left, seen.heard, strict=True), 1):
        lines = (folder / f"truth{f'-{number}' if number > 1 else ''}.csv").read_text().splitlines()
        rows = [line.split(",") for line in lines[1:]]
        assert all(len(row) == 6 for row in rows)
        times: dict[int, list[int]] = {}
        last: dict[int, list[str]] = {}
        for row in rows:
            robot, cycle = int(row[1]), int(row[0])
            times.setdefault(robot, []).append(cycle)
            if cycle > 1:  # motors: 0.15 units a cycle at most, and their noise
                moved = abs(float(row[2]) - float(last[robot][2])) + abs(
                    float(row[3]) - float(last[robot][3])
                )
                assert moved < 0.5, (number, row)
            last[robot] = row
        ended = run["time"]
        assert ended == SIM_TIME or len(left) == AGENTS
        assert sorted(times) == [robot["id"] for robot in run["robots"]] == list(range(1, AGENTS + 1))
        for robot in run["robots"]:
            position = robot["id"]
            assert times[position] == list(range(ended + 1)), (number, position)
            assert robot["state"].lower() == last[position][5].lower(), (number, position)
            assert robot["answered"] + robot["unanswered"] == ended
            if position in left:
                assert robot["answered"] < ended
            # Datagrams may be lost on a busy machine; more than were sent cannot come.
            assert heard.get(position, 0) <= ended + 2
            assert robot["answered"] <= heard.get(position, 0) + 1


def flat(samples: list[tuple[int, int, int]]) -> str:
    """Return the middle of the second and of the last quarter in words.

    Raises
    ------
    AssertionError
        If memory has grown by more than 5 %, or there are more descriptors or threads than before.
    """
    n = len(samples) // 4
    before, after = samples[n : 2 * n], samples[3 * n :]
    (kb, descriptors, threads), (kb2, descriptors2, threads2) = (
        tuple(median(column) for column in zip(*part, strict=True)) for part in (before, after)
    )
    peak = max(row[1] for row in samples)
    assert kb2 <= 1.05 * kb + 1024, f"memory grows: {kb:.0f} to {kb2:.0f} kB"
    assert descriptors2 <= descriptors + 3, f"descriptors: {descriptors} to {descriptors2}"
    assert threads2 <= threads + 1, f"threads: {threads} to {threads2}"
    return (
        f"{kb / 1024:.1f} -> {kb2 / 1024:.1f} MB, {descriptors:.0f} -> {descriptors2:.0f} descriptors "
        f"(at most {peak}), {threads:.0f} -> {threads2:.0f} threads"
    )


def summary(seen: Seen) -> str:
    """Return the figures in words."""
    intervals = sorted(seen.intervals)
    shares = (0.5, 0.9, 0.99, 0.999, 1.0)
    values = [intervals[min(len(intervals) - 1, int(share * len(intervals)))] for share in shares]
    lines = [f"{name:10} {flat(samples)}" for name, samples in seen.samples.items()]
    lines.append(
        f"{len(seen.registered)} runs, {sum(seen.registered)} registrations, "
        f"{sum(map(len, seen.left))} left early, {sum(sum(run.values()) for run in seen.heard)} Measures, "
        f"{seen.frames} frames on {PAGES} pages; every file right"
    )
    lines.append(
        "from one cycle to the next, in cycle times: "
        + ", ".join(f"{100 * share:g} % {value:.2f}" for share, value in zip(shares, values, strict=True))
    )
    lines.append(f"simulator: {seen.delays}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.soak")
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--speed", type=float, default=20.0, help="times real time")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(summary(asyncio.run(soak(60.0 * options.minutes, options.speed, Path(folder)))))


if __name__ == "__main__":
    main()
