"""The agent whose messages a process of its own answers: real programs over UDP, in real time, to any end."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agent.run.relayed_link import can_relay
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.run_log import read_run
from ciberrato.net import UdpLink
from ciberrato.protocol import RobotStatus, ViewRegistration, decode_simulator_message, encode

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (can_relay() and hasattr(os, "pidfd_open") and Path("/proc/self/task").exists()),
        reason="sockets are not handed over here, or there is no /proc",
    ),
]

PATIENCE = 300.0  # seconds; only a failure takes so long
REPOSITORY = Path(__file__).parents[2]
PAUSING_AGENT = REPOSITORY / "tests" / "agent" / "pausing_agent.py"
OLD = b"an older file\n"


def descendants(pid: int) -> set[int]:
    """Return the processes that a process has started, and theirs."""
    found = set()
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            found |= {child} | descendants(child)
    return found


class Run:
    """A simulator with a view on it, and an agent, each a program of its own."""

    def __init__(self, folder: Path, cache: Path, place: str | None = None, *pace: str) -> None:
        self.log, self.output = folder / "run.jsonl", folder / "localization.out"
        self.folder, self.result = folder, folder.with_name("result.json")
        self.output.write_bytes(OLD)
        words = ["--lab", "maze", "--grid", "maze", "--seed", "4", "--autostart", "1", "--port", "0"]
        if pace:
            parameters = folder.with_name("parameters.xml")
            parameters.write_text('<Parameters SimTime="60"/>')
            words += ["--param", str(parameters), *pace]
        self.simulator = subprocess.Popen(
            [sys.executable, "-m", "simulator_stub", *words, "--result", str(self.result)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert self.simulator.stdout is not None
        port = next(match[1] for line in self.simulator.stdout if (match := re.search(r"udp .*:(\d+)", line)))
        self.view = UdpLink("127.0.0.1", int(port))
        self.view.register(encode(ViewRegistration()))
        assert self.view.receive(PATIENCE) is not None
        command = ["-m", "agent"] if place is None else [str(PAUSING_AGENT), place]
        files = ["--log", str(self.log), "-o", str(self.output)]
        drive = ["-h", f"127.0.0.1:{port}", "-m", "maze", "-p", "0", "--drive", "explore"]
        self.agent = subprocess.Popen(
            [sys.executable, *command, *drive, *files],
            cwd=REPOSITORY,
            env=os.environ | {"CIBERRATO_CACHE": str(cache)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.ends: list[int] = []

    def statuses(self) -> Iterator[RobotStatus]:
        """Yield what the view is told of the robot, cycle by cycle."""
        while True:
            data = self.view.receive(PATIENCE)
            assert data is not None
            message = decode_simulator_message(data)
            if isinstance(message, RobotStatus):
                yield message

    def wait_paused(self) -> None:
        assert self.agent.stdout is not None
        assert b"paused\n" in iter(self.agent.stdout.readline, b"")

    def wait_moving(self) -> None:
        """Wait until the robot moves: another process drives it, whatever the agent does."""
        places = ((status.x, status.y) for status in self.statuses())
        first = next(places)
        next(place for place in places if place != first)

    def watch(self) -> None:
        """Note all processes of the agent."""
        for pid in descendants(self.agent.pid):
            with contextlib.suppress(ProcessLookupError):
                self.ends.append(os.pidfd_open(pid))

    def end(self, number: int) -> tuple[int, str]:
        """Send a signal to the agent, wait for its end and for that of all its processes."""
        self.agent.send_signal(number)
        _, errors = self.agent.communicate(b"\n", timeout=PATIENCE)
        for descriptor in self.ends:
            assert select.select([descriptor], [], [], PATIENCE)[0], "an orphan goes on"
        assert b"Traceback" not in errors
        return self.agent.returncode, errors.decode()

    def wait_for_rest(self) -> None:
        """Wait until the robot has stood in one place for some cycles."""
        places: list[tuple[float, float, float]] = []
        for status in self.statuses():
            places.append((status.x, status.y, status.direction_deg))
            if status.time > 1 and len(places) > 5 and len(set(places[-5:])) == 1:
                return

    def close(self) -> None:
        for descriptor in self.ends:
            os.close(descriptor)
        self.view.close()
        for process in (self.agent, self.simulator):
            process.kill()
            process.communicate()


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def start(tmp_path: Path, cache: Path) -> Iterator[Callable[..., Run]]:
    made: list[Run] = []
    folder = tmp_path / "files"
    folder.mkdir()

    def make(place: str | None = None, *pace: str) -> Run:
        made.append(Run(folder, cache, place, *pace))
        return made[-1]

    yield make
    for run in made:
        run.close()


def test_from_the_first_message_to_sigint(start: Callable[..., Run]) -> None:
    run = start()
    next(status for status in run.statuses() if status.time >= 40)
    run.watch()
    assert any(
        b"agent.run.answering" in Path(f"/proc/{pid}/cmdline").read_bytes()
        for pid in descendants(run.agent.pid)
    )
    status, errors = run.end(signal.SIGINT)
    assert status == 0, errors
    run.wait_for_rest()
    run.simulator.send_signal(signal.SIGINT)
    assert run.simulator.wait(PATIENCE) == 0
    (world,) = json.loads(run.result.read_text())["runs"]
    (robot,) = world["robots"]
    cycles = [cycle for cycle in read_run(run.log).cycles if cycle.start]
    unanswered = [cycle.time for cycle in cycles if not cycle.answered]
    counted = re.search(r"(\d+) Measures unanswered, (\d+) lost", errors)
    assert counted is not None, errors
    # The message that has just come when the run ends is not answered any more, but for the stop.
    assert 0 <= len(unanswered) - int(counted[1]) <= 1
    # Every answer that the log tells of has arrived; one that came a cycle late counts there as unanswered.
    assert robot["answered"] + robot["unanswered"] == world["time"]
    assert robot["answered"] > 0
    # On a busy machine the other process has answered more than the agent has come to log. And the stops.
    behind = max(0, robot["last_answer"] - cycles[-1].time)
    assert robot["answered"] + robot["caught_up"] <= len(cycles) - len(unanswered) + behind + 4
    assert len(read_beliefs(run.output)) == 1


ACCEPTED = [
    "call:agent.run.session:Session._drive",
    "call:agent.run.relayed_link:RelayedLink.decide",
]
BEFORE = [
    "call:agent.run.session:register",
    "call:agent.run.registration:_find_answer",
]
DRIVEN = [*ACCEPTED, BEFORE[1]]
"""Places where the other process drives already."""


@pytest.mark.parametrize("place", BEFORE + ACCEPTED)
def test_killed(start: Callable[..., Run], place: str) -> None:
    run = start(place)
    run.wait_paused()
    if place in DRIVEN:
        run.wait_moving()
    run.watch()
    assert run.end(signal.SIGKILL)[0] == -signal.SIGKILL
    assert run.output.read_bytes() == OLD
    assert {path.name for path in run.folder.iterdir()} <= {"run.jsonl", "localization.out"}
    if run.log.exists():
        assert run.log.read_bytes()[-1:] in (b"", b"\n")
    if place in DRIVEN:
        run.wait_for_rest()


@pytest.mark.parametrize("place", BEFORE + ACCEPTED)
def test_interrupted(start: Callable[..., Run], place: str) -> None:
    run = start(place)
    run.wait_paused()
    if place in DRIVEN:
        run.wait_moving()
    run.watch()
    status, errors = run.end(signal.SIGINT)
    if place in BEFORE or run.output.read_bytes() == OLD:
        assert status == 130, errors
        assert "nothing is written" in errors
        assert run.output.read_bytes() == OLD
    else:
        assert status == 0, errors
        read_run(run.log)
        assert len(read_beliefs(run.output)) == 1
    if place in DRIVEN:
        run.wait_for_rest()


def test_a_log_that_cannot_be_written(start: Callable[..., Run]) -> None:
    run = start(ACCEPTED[0])
    run.wait_paused()
    run.wait_moving()
    run.log.mkdir()
    _, errors = run.agent.communicate(b"\n", timeout=PATIENCE)
    assert run.agent.returncode == 2
    assert b"cannot be written" in errors
    run.wait_for_rest()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_while_it_finishes(start: Callable[..., Run], number: int) -> None:
    run = start("call:agent.run.live_method:LiveMethod._write_beliefs")
    next(status for status in run.statuses() if status.time >= 5)
    run.watch()
    run.agent.send_signal(signal.SIGINT)
    run.wait_paused()
    status, errors = run.end(number)
    assert status == (-number if number == signal.SIGKILL else 0), errors
    if number == signal.SIGKILL:
        assert run.output.read_bytes() == OLD
    else:
        assert len(read_beliefs(run.output)) == 1
    assert {path.name for path in run.folder.iterdir()} == {"run.jsonl", "localization.out"}
    read_run(run.log)
    run.wait_for_rest()


@pytest.mark.parametrize(
    ("pace", "told"),
    [
        (("--lockstep",), "in lockstep: the simulator waits for answers"),
        (("--speed", "40"), "Measures do not come every 50 ms"),
    ],
    ids=["lockstep", "faster"],
)
def test_what_is_assumed_of_the_pace_is_told(
    start: Callable[..., Run], pace: tuple[str, ...], told: str
) -> None:
    run = start(None, *pace)
    _, errors = run.agent.communicate(timeout=PATIENCE)
    assert run.agent.returncode == 0
    assert told in errors.decode()
