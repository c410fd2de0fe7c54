"""The agent and the simulator that ships, two processes on this machine."""

from __future__ import annotations

import contextlib
import csv
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.run_log import read_run

REPOSITORY = Path(__file__).parents[2]
PATIENCE = 300.0  # seconds; only a failure takes so long
MAP_OR_NOT = (0, 3)
"""Status of runs at 50 times real time: their robot goes on blindly while a busy machine leaves the agent
behind, and then its readings need not fit the map."""


@contextlib.contextmanager
def simulator(*options: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "simulator_stub", "--port", "0", "--bind", "127.0.0.1", *options],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        for line in process.stdout:
            found = re.match(r"listening on udp 127\.0\.0\.1:(\d+)", line)
            if found:
                yield process, int(found[1])
                break
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)


def endless(folder: Path) -> list[str]:
    """Return words for a run in real time that no wait outlasts, however slow the machine is."""
    path = folder / "endless.xml"
    path.write_text('<Parameters SimTime="100000000"/>')
    return ["--param", str(path), "--autostart", "1", "--speed", "50"]


def run_agent(folder: Path, port: int, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port}", "-r", "santos", "-m", "standard"]
    files = ["--log", str(folder / "run.jsonl"), "-o", str(folder / "localization.out")]
    return subprocess.run(
        [*command, *files, *options],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_a_whole_run(tmp_path: Path, transport: str) -> None:
    truth = tmp_path / "truth.csv"
    world = ["--lab", "standard", "--grid", "5,7,0", "--seed", "3"]
    with simulator(
        *world, "--lockstep", "--answer-limit", "300", "--autostart", "1", "--truth", str(truth)
    ) as (_, port):
        result = run_agent(tmp_path, port, "--transport", transport, "--exit-at-wall")
    assert result.returncode == 0, result.stderr
    assert "noise: motors 1.5 %, compass 2 degrees, IR 0.1; cycle 50 ms; 1800 cycles" in result.stderr
    assert "a wall is ahead; finishing" in result.stderr
    run = read_run(tmp_path / "run.jsonl")
    assert len(run.steps) == 12
    (written,) = read_beliefs(tmp_path / "localization.out")
    assert written.beliefs.shape == (13, 7, 14)
    places = {int(row["time"]): float(row["x"]) for row in csv.DictReader(truth.read_text().splitlines())}
    for step in run.steps:
        assert places[step.time] == pytest.approx(5.0 + 2.0 * step.index, abs=0.25)
    # The cell at the end of the row is known for certain.
    assert written.beliefs[-1][3, 13] > 0.99
    assert "(27, 7)" in result.stdout


def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    logs = []
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        with simulator(
            "--lab",
            "standard",
            "--grid",
            "19,7,0",
            "--seed",
            "9",
            "--lockstep",
            "--answer-limit",
            "300",
            "--autostart",
            "1",
        ) as (
            _,
            port,
        ):
            assert run_agent(folder, port, "--lockstep", "--exit-at-wall", "--quiet").returncode == 0
        logs.append(read_run(folder / "run.jsonl"))
    first, second = logs
    assert first.steps == second.steps
    moving = [[cycle for cycle in run.cycles if cycle.time > 0] for run in logs]
    assert moving[0] == moving[1]


def test_a_position_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with simulator("--lab", "standard", "--grid", "5,7,0") as (_, port):
        result = run_agent(tmp_path, port, "-p", "2")
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "refuses 'santos' at position 2: the position is taken or not in its start grid" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_simulator_that_goes_away(tmp_path: Path) -> None:
    """Killed in mid-run: over TCP the end of the connection is seen at once."""
    with simulator("--lab", "standard", "--grid", "5,7,0", *endless(tmp_path)) as (process, port):
        command = [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port}", "--transport", "tcp"]
        files = ["--log", str(tmp_path / "run.jsonl"), "-o", str(tmp_path / "localization.out")]
        agent = subprocess.Popen(
            [*command, *files], cwd=REPOSITORY, stderr=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert agent.stderr is not None
        for line in agent.stderr:
            if b"step 2" in line:
                break
        process.kill()
        _, errors = agent.communicate(timeout=PATIENCE)
    assert agent.returncode in MAP_OR_NOT, errors
    assert b"finishing" in errors
    (written,) = read_beliefs(tmp_path / "localization.out")
    assert len(written.beliefs) == len(read_run(tmp_path / "run.jsonl").steps) + 1 >= 4


def test_silence_ends_the_run(tmp_path: Path) -> None:
    with simulator("--lab", "standard", "--grid", "5,7,0", *endless(tmp_path)) as (process, port):
        command = [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port}", "--silence", "10"]
        files = ["--log", str(tmp_path / "run.jsonl"), "-o", str(tmp_path / "localization.out")]
        agent = subprocess.Popen(
            [*command, *files], cwd=REPOSITORY, stderr=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert agent.stderr is not None
        for line in agent.stderr:
            if b"step 1" in line:
                break
        process.send_signal(signal.SIGSTOP)
        try:
            _, errors = agent.communicate(timeout=PATIENCE)
        finally:
            process.send_signal(signal.SIGCONT)
    assert agent.returncode in MAP_OR_NOT, errors
    assert b"no Measures for 10 s; finishing" in errors
    assert (tmp_path / "localization.out").exists()
