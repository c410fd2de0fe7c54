"""Records where no room is left: a warning, whole pieces only, and a run that goes on.

A limit on the size of files (`resource.RLIMIT_FSIZE`) stands for a disk that is full: the write fails after
the part that fits, as on a disk. A full device (Linux's ``/dev/full``) fails at once.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file
from ciberrato.files.simulator_log import read_simulator_log
from tests.chaos.scenario import Outcome, honest, simulator

CYCLES = 60


def drive(
    folder: Path, *options: str, limit: int | None = None, meanwhile: Callable[[int], None] | None = None
) -> tuple[Outcome, int, str]:
    """Let an honest robot drive a run; return what it met, the exit status and what was said."""
    outcome = Outcome()

    def small_disk() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))

    words = ("--lockstep", "--answer-limit", "inf", "--autostart", "1")
    words += ("--result", str(folder / "result.json"), *options)
    with simulator(*words, cycles=CYCLES, period=50, folder=folder, preexec=small_disk) as (process, port):
        honest(port, outcome)
        status = process.wait(300.0)
    return outcome, status, (folder / "stderr").read_text()


def run_of(folder: Path) -> dict[str, Any]:
    (run,) = json.loads((folder / "result.json").read_text())["runs"]
    return run


@pytest.fixture
def calm(tmp_path: Path) -> Path:
    """The records of an undisturbed run."""
    folder = tmp_path / "calm"
    folder.mkdir()
    words = ("--truth", str(folder / "truth.csv"), "--log", str(folder / "run.log"))
    outcome, status, said = drive(folder, *words)
    assert (outcome.registered, status) == (True, 0)
    assert "cannot be written" not in said
    assert run_of(folder)["losses"] == []
    return folder


@pytest.mark.parametrize("name", ["truth.csv", "run.log"])
def test_a_record_ends_with_its_last_whole_piece_and_the_run_goes_on(
    name: str, calm: Path, tmp_path: Path
) -> None:
    whole = (calm / name).read_bytes()
    folder = tmp_path / "full"
    folder.mkdir()
    limit = 1500 if name == "truth.csv" else 30_000
    words = ("--truth" if name == "truth.csv" else "--log", str(folder / name))
    _, status, said = drive(folder, *words, limit=min(limit, len(whole) - 100))
    kept = (folder / name).read_bytes()
    if name == "run.log":  # the date differs
        whole, kept = (data[data.index(b">") :] for data in (whole, kept))
        assert kept.endswith(b"</LogInfo>\n")
    assert 0 < len(kept) < len(whole)
    assert whole.startswith(kept)
    assert kept.endswith(b"\n")
    assert status == 2
    assert said.count(f"{folder / name}: cannot be written (File too large); this record ends here") == 1
    assert "not all that was to be recorded could be" in said
    run = run_of(folder)
    assert (run["time"], run["robots"][0]["answered"]) == (CYCLES, CYCLES)
    assert len(run["losses"]) == 1
    calm_run = run_of(calm)
    for key in ("score", "collisions", "x", "y", "direction"):
        assert run["robots"][0][key] == calm_run["robots"][0][key], "the run is the same"
    if name == "run.log":
        assert not read_simulator_log(folder / name).complete


@pytest.fixture
def full_device(tmp_path: Path) -> Path:
    """A device that is always full: the test's own where it may make one, so that the system's is safe."""
    own = tmp_path / "full"
    with contextlib.suppress(PermissionError):
        os.mknod(own, stat.S_IFCHR | 0o666, os.makedev(1, 7))
        with contextlib.suppress(OSError), open(own, "wb", buffering=0) as stream:
            with pytest.raises(OSError, match="No space left"):
                stream.write(b"x")
            return own
    system = Path("/dev/full")
    if not system.is_char_device() or os.access("/dev", os.W_OK):
        pytest.skip("there is no full device that could not be replaced")
    return system


@pytest.mark.parametrize("option", ["--truth", "--log", "--result"])
def test_a_full_device_is_a_warning_and_is_still_a_device(
    option: str, full_device: Path, tmp_path: Path
) -> None:
    outcome, status, said = drive(tmp_path, option, str(full_device))
    assert outcome.registered
    assert status == 2
    assert f"{full_device}: cannot be written" in said
    assert "Traceback" not in said
    assert full_device.is_char_device()
    if option != "--result":
        assert run_of(tmp_path)["time"] == CYCLES


def test_a_result_that_could_not_be_written_comes_whole_when_there_is_room_again(tmp_path: Path) -> None:
    from simulator_stub.recording.results import Results

    lines: list[str] = []
    path = tmp_path / "result.json"
    results = Results(seed=1, scoring=0, path=path, notify=print, lost=lines.append)
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    results._runs = [b'{"run": %d}' % number for number in range(200)]
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, hard))
    try:
        results._save()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before, "the old one stays, whole"
    assert os.listdir(tmp_path) == ["result.json"], "and no draft of the new one"
    assert not results.current
    assert len(lines) == 1
    results._save()
    assert results.current
    assert len(json.loads(path.read_text())["runs"]) == 200


def test_the_next_world_tries_again(tmp_path: Path) -> None:
    from simulator_stub.recording.observer import WorldFile

    lines: list[str] = []
    file = WorldFile(tmp_path / "a.txt", lines.append)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, hard))
    try:
        file.write("12345678\n")
        file.flush()
        file.write("12345678\n")
        file.flush()
        file.write("more\n")
        file.flush()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    file.world_ended(None)  # type: ignore[arg-type]
    file.write("second\n")
    file.close()
    assert (tmp_path / "a.txt").read_text() == "12345678\n"
    assert (tmp_path / "a-2.txt").read_text() == "second\n"
    assert len(lines) == 1


def test_a_device_is_written_to_and_never_replaced(full_device: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        replace_file(pipe, b"6000\n")
        assert os.read(reader, 100) == b"6000\n"
    finally:
        os.close(reader)
    assert pipe.is_fifo()
    with pytest.raises(UsageError, match="No space left"):
        replace_file(full_device, b"x")
    assert full_device.is_char_device()


@pytest.mark.parametrize("closed", [False, True])
def test_a_standard_output_that_takes_nothing_changes_nothing(
    closed: bool, full_device: Path, tmp_path: Path
) -> None:
    """Full, or a pipe whose reader has gone: the port is in the ready file."""
    ready = tmp_path / "ready"
    command = [sys.executable, "-m", "simulator_stub", "--port", "0", "--ready-file", str(ready)]
    with contextlib.ExitStack() as stack:
        if closed:
            reader, writer = os.pipe()
            os.close(reader)
            out: Any = stack.enter_context(os.fdopen(writer, "wb", buffering=0))
        else:
            out = stack.enter_context(open(full_device, "wb", buffering=0))
        parameters = tmp_path / "p.xml"
        parameters.write_text('<Parameters SimTime="5" CycleTime="10"/>')
        command += ["--param", str(parameters), "--autostart", "1", "--exit-at-end"]
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.PIPE, text=True)
        try:
            while not ready.exists():
                assert process.poll() is None, process.communicate()[1]
            honest(int(ready.read_text()), Outcome())
            _, said = process.communicate(timeout=300.0)
        finally:
            process.kill()
    assert process.returncode == 0
    assert "Traceback" not in said
    assert "Exception" not in said
