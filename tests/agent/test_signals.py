"""Signals at every kind of moment, to a real process: no traceback, no lost file, no half-written file."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.run_log import read_run
from ciberrato.world.parameters import Parameters

pytestmark = [pytest.mark.slow, pytest.mark.thorough]

REPOSITORY = Path(__file__).parents[2]
PAUSING_AGENT = Path(__file__).with_name("pausing_agent.py")
PARAMETERS = Parameters(sim_time=0)
OLD = b"an older file\n"
PATIENCE = 300.0  # seconds; only a failure takes so long


class Agent:
    """An agent process whose files are in a folder of their own."""

    def __init__(self, folder: Path, port: int, place: str | None = None, *options: str) -> None:
        self.log, self.output = folder / "run.jsonl", folder / "localization.out"
        self.folder = folder
        command = ["-m", "agent"] if place is None else [str(PAUSING_AGENT), place]
        files = ["--log", str(self.log), "-o", str(self.output)]
        self.process = subprocess.Popen(
            [sys.executable, *command, "-h", f"127.0.0.1:{port}", "--silence", "250", *files, *options],
            cwd=REPOSITORY,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def wait_paused(self) -> None:
        assert self.process.stdout is not None
        assert b"paused\n" in iter(self.process.stdout.readline, b"")  # behind what it has printed

    def release(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(b"\n")
        self.process.stdin.flush()

    def send(self, count: int, number: int = signal.SIGINT) -> None:
        for index in range(count):
            if index:
                time.sleep(0.01)  # not to synchronize: the signals are to come 10 ms apart
            os.kill(self.process.pid, number)

    def wait_logged(self, cycle: int) -> None:
        """Wait until the log has the line of that cycle, wholly."""
        mark, deadline = f'{{"time":{cycle},'.encode(), time.monotonic() + PATIENCE
        while True:
            data = self.log.read_bytes() if self.log.exists() else b""
            place = data.rfind(mark)
            if place >= 0 and b"\n" in data[place:] and b'"start":true' in data[place:]:
                return
            assert time.monotonic() < deadline
            time.sleep(0.002)

    def end(self) -> tuple[int, str]:
        """Wait for the end; exit status and standard error."""
        _, errors = self.process.communicate(timeout=PATIENCE)
        text = errors.decode()
        assert "Traceback" not in text
        assert "Exception ignored" not in text
        return self.process.returncode, text

    def check_file(self, *, steps: int | None = None) -> bytes:
        """Check that the belief file is whole and belongs to the log."""
        (run,) = read_beliefs(self.output)
        recorded = len(read_run(self.log).steps)
        assert len(run.beliefs) == recorded + 1
        assert steps is None or recorded == steps
        assert sorted(path.name for path in self.folder.iterdir()) == ["localization.out", "run.jsonl"]
        return self.output.read_bytes()


@pytest.fixture
def agent(tmp_path: Path) -> Iterator[Callable[..., Agent]]:
    made: list[Agent] = []

    def make(port: int, place: str | None = None, *options: str, folder: str = "files") -> Agent:
        path = tmp_path / folder
        path.mkdir()
        (path / "localization.out").write_bytes(OLD)
        made.append(Agent(path, port, place, *options))
        return made[-1]

    yield make
    for process in made:
        process.process.kill()
        process.process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "place",
    [
        "import:agent.commands",
        "import:argparse",
        "call:agent.commands.drive:settings_of",
        "import:agent.run.settings",
    ],
)
def test_before_there_is_anything_to_save_it_ends_at_once(
    agent: Callable[..., Agent], place: str, number: int
) -> None:
    process = agent(9, place)
    process.wait_paused()
    process.send(1, number)
    status, errors = process.end()
    assert status == 128 + number
    assert errors == "ciberrato-agent: interrupted; nothing is written\n"
    assert process.output.read_bytes() == OLD
    assert not process.log.exists()


@pytest.mark.parametrize("count", [1, 3])
def test_while_no_simulator_answers(agent: Callable[..., Agent], count: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        nobody.bind(("127.0.0.1", 0))
        nobody.settimeout(PATIENCE)
        process = agent(nobody.getsockname()[1])
        assert b"<Robot" in nobody.recv(2000)
        process.send(count)
        status, errors = process.end()
    assert status == 130
    assert "interrupted before anything was recorded; nothing is written" in errors
    assert process.output.read_bytes() == OLD


@pytest.mark.parametrize(
    "place",
    [
        "call:agent.run.session:_open_link",
        "call:agent.run.registration:_attempt",
        "call:agent.run.registration:_find_answer",
        "import:agent.drives.right.controller",
        "call:ciberrato.files.run_log:RunWriter.__init__",
    ],
)
def test_before_the_first_reading_nothing_is_written(
    agent: Callable[..., Agent], fake_simulator: Any, place: str
) -> None:
    process = agent(fake_simulator(PARAMETERS).port, place)
    process.wait_paused()
    process.send(2)
    process.release()
    status, errors = process.end()
    assert status == 130
    assert "interrupted before anything was recorded; nothing is written" in errors
    assert process.output.read_bytes() == OLD


@pytest.mark.parametrize(
    ("cycle", "steps", "count", "number"),
    [
        (0, 1, 1, signal.SIGINT),
        (1, 1, 2, signal.SIGINT),
        (20, 1, 3, signal.SIGINT),
        (21, 2, 1, signal.SIGTERM),
        (150, 8, 3, signal.SIGINT),
        (300, 12, 1, signal.SIGHUP),
    ],
)
def test_in_the_middle_of_the_run(
    agent: Callable[..., Agent], fake_simulator: Any, cycle: int, steps: int, count: int, number: int
) -> None:
    simulator = fake_simulator(PARAMETERS, hold_at=cycle)
    process = agent(simulator.port)
    assert simulator.held.wait(PATIENCE)
    process.wait_logged(cycle)
    process.send(count, number)
    status, errors = process.end()
    assert status == 0
    assert "interrupted; finishing: writing" in errors
    process.check_file(steps=steps)
    deadline = time.monotonic() + PATIENCE
    while simulator.commands[-1] != (0.0, 0.0):  # sent, but perhaps not read yet
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_before_the_worker_is_done(agent: Callable[..., Agent], fake_simulator: Any) -> None:
    simulator = fake_simulator(PARAMETERS, hold_at=60)
    process = agent(simulator.port, "call:agent.offline.expected_readings:compute_expected_readings")
    process.wait_paused()
    assert simulator.held.wait(PATIENCE)  # the control loop has not waited for the worker
    process.wait_logged(60)
    process.send(1)
    assert process.process.stderr is not None
    for line in process.process.stderr:
        if b"finishing" in line:
            break
    process.send(2)
    process.release()
    assert process.end()[0] == 0
    process.check_file(steps=3)


FINISHING = [
    "call:agent.run.session:Session._stop",
    "import:agent.offline.localization",
    "call:agent.offline.localizer:localize",
    "call:ciberrato.files.atomic:replace_file",
    "call:os:fsync",
    "call:os:replace",
    "call:agent.offline.localization:print_localization",
    "call:agent.run.signals:Interrupts.ignore",
]


@pytest.mark.parametrize("place", FINISHING)
def test_again_while_it_finishes(agent: Callable[..., Agent], fake_simulator: Any, place: str) -> None:
    simulator = fake_simulator(PARAMETERS, hold_at=60)
    process = agent(simulator.port, place)
    assert simulator.held.wait(PATIENCE)
    process.wait_logged(60)
    process.send(1)
    process.wait_paused()
    process.send(3)
    process.release()
    assert process.end()[0] == 0
    process.check_file(steps=3)


def test_when_the_run_ends_by_itself(agent: Callable[..., Agent], fake_simulator: Any) -> None:
    process = agent(fake_simulator(PARAMETERS).port, "call:os:replace", "--exit-at-wall")
    process.wait_paused()
    process.send(3)
    process.release()
    status, errors = process.end()
    assert status == 0
    assert "a wall is ahead; finishing" in errors
    process.check_file(steps=12)


@pytest.mark.parametrize(
    ("cycle", "place"),
    [
        (0, None),
        (100, None),
        (100, "call:agent.offline.localizer:localize"),
        (100, "call:os:fsync"),
        (100, "call:os:replace"),
    ],
)
def test_killed(agent: Callable[..., Agent], fake_simulator: Any, cycle: int, place: str | None) -> None:
    """The old file stays, and from the log comes what a clean stop at the same moment writes."""
    simulator = fake_simulator(PARAMETERS, hold_at=cycle)
    clean = agent(simulator.port, folder="clean")
    assert simulator.held.wait(PATIENCE)
    clean.wait_logged(cycle)
    clean.send(1)
    assert clean.end()[0] == 0

    simulator = fake_simulator(PARAMETERS, hold_at=cycle)
    killed = agent(simulator.port, place, folder="killed")
    assert simulator.held.wait(PATIENCE)
    killed.wait_logged(cycle)
    if place is not None:
        killed.send(1)
        killed.wait_paused()
    killed.send(1, signal.SIGKILL)
    assert killed.end()[0] == -signal.SIGKILL
    assert killed.output.read_bytes() == OLD
    left = {path.name for path in killed.folder.iterdir()} - {"localization.out", "run.jsonl"}
    if place in ("call:os:fsync", "call:os:replace"):
        assert left == {f".localization.out.{killed.process.pid}.partial"}
    else:
        assert left == set()

    assert read_run(killed.log) == read_run(clean.log)
    localize = [sys.executable, "-m", "agent", "localize", str(killed.log), "-m", "standard"]
    subprocess.run([*localize, "-o", str(killed.output), "--quiet"], cwd=REPOSITORY, check=True)
    assert killed.output.read_bytes() == clean.output.read_bytes()
