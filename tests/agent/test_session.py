"""A run over a link that delivers what the test has written down: crowds, rubbish, endings, full disks."""

from __future__ import annotations

import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import agent.offline.expected_readings
import agent.run.session
from agent.cli import main
from agent.drives.exchange import Exchange
from ciberrato.client.pace import Pace
from ciberrato.errors import LabError
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.run_log import read_run
from ciberrato.net import LinkClosedError, LinkError
from ciberrato.net.link import Arrival
from ciberrato.protocol import Acceptance, Actions, Measures, Refusal, decode_actions, encode
from ciberrato.world.parameters import Parameters

PARAMETERS = Parameters(motors_noise=0.0)


class ScriptedLink:
    """Delivers the batches of a script, one a call; then the connection is gone."""

    def __init__(self, script: list[list[bytes]]) -> None:
        self.script = script
        self.sent: list[Actions] = []
        self.send_error: LinkError | None = None
        self._readable, self._other = socket.socketpair()
        self._other.send(b".")
        self._looked = False

    def register(self, data: bytes) -> None: ...

    def send(self, data: bytes) -> None:
        self.sent.append(decode_actions(data))
        if self.send_error is not None:
            raise self.send_error

    def receive(self, timeout: float | None) -> bytes | None: ...

    refused = False

    def receive_waiting(self) -> list[bytes]:
        if not self.script:
            raise LinkClosedError("the simulator has closed the connection")
        return self.script.pop(0)

    def receive_arrivals(self) -> list[Arrival]:
        # The first look after each batch finds nothing more: what is in a batch is what came together.
        self._looked = not self._looked
        return [] if self._looked else [Arrival(data, None) for data in self.receive_waiting()]

    def fileno(self) -> int:
        return self._readable.fileno()

    def close(self) -> None:
        self._readable.close()
        self._other.close()


def measures(time: int, **values: object) -> bytes:
    message = Measures(time=time, start=True, collision=False, compass=0.0, infrared=(0.6, 2.5, 2.5, 0.6))
    return encode(replace(message, **values))  # type: ignore[arg-type]


ACCEPTED = encode(Acceptance(parameters=PARAMETERS, n_beacons=1))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Runner:
    monkeypatch.chdir(tmp_path)
    return Runner(monkeypatch)


class Runner:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._monkeypatch = monkeypatch

    def __call__(
        self, *batches: list[bytes], options: tuple[str, ...] = (), error: LinkError | None = None
    ) -> tuple[int, ScriptedLink]:
        link = ScriptedLink([list(batch) for batch in batches])
        link.send_error = error
        self._monkeypatch.setattr(agent.run.session, "_open_link", lambda settings: link)
        return main(["--silence", "5", *options]), link


def test_of_a_crowd_the_newest_is_answered_and_all_are_logged(
    run: Runner, capsys: pytest.CaptureFixture[str]
) -> None:
    status, link = run([ACCEPTED, measures(0)], [measures(1), measures(2), measures(3)], [measures(5)])
    assert status == 0
    cycles = read_run(Path("run.jsonl")).cycles
    assert [(cycle.time, cycle.answered) for cycle in cycles] == [
        (0, True),
        (1, False),
        (2, False),
        (3, True),
        (5, True),
    ]
    # One answer each to 0, 3 and 5, and motors 0 at the end, before and after the file is written.
    assert [actions.left_motor for actions in link.sent] == [0.1, 0.1, 0.1, 0.0, 0.0]
    assert cycles[-1].displacement == pytest.approx(0.1 * 5 - 0.1 * (1 - 0.5**5), abs=1e-6)
    errors = capsys.readouterr().err
    assert "1 cycles without Measures; 2 Measures not answered" in errors
    assert "the simulator has closed the connection; finishing" in errors


@pytest.mark.parametrize("options", [(), ("--lockstep",)])
def test_in_lockstep_no_clock_has_a_say_however_real_the_time_looks(
    run: Runner, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...]
) -> None:
    seen = []

    def note(exchange: Exchange, now: float) -> None:
        exchange.round_trip = 1.0
        seen.append(exchange._on_the_way)

    monkeypatch.setattr(Pace, "is_real_time", property(lambda pace: True))
    monkeypatch.setattr(Exchange, "sent", note)
    run([ACCEPTED, measures(0)], [measures(1)], options=options)
    assert seen[1] == (0.0 if options else 1.0)


def test_rubbish_and_second_replies_are_passed_over(run: Runner, capsys: pytest.CaptureFixture[str]) -> None:
    rubbish = b"<Measures Time="
    status, _ = run(
        [ACCEPTED, measures(0)], [ACCEPTED, rubbish, measures(1), encode(Refusal())], [rubbish], [measures(2)]
    )
    assert status == 0
    assert [cycle.time for cycle in read_run(Path("run.jsonl")).cycles] == [0, 1, 2]
    assert capsys.readouterr().err.count("a message is left out") == 1


def test_answers_that_cannot_be_sent_are_reported_once(
    run: Runner, capsys: pytest.CaptureFixture[str]
) -> None:
    status, link = run([ACCEPTED, measures(0)], [measures(1)], [measures(2)], error=LinkError("no route"))
    assert status == 0
    assert len(link.sent) == 5
    assert capsys.readouterr().err.count("no route") == 1


def test_gone_before_the_first_reading(run: Runner, capsys: pytest.CaptureFixture[str]) -> None:
    status, _ = run([ACCEPTED])
    assert status == 2
    assert (
        "closed the connection, before anything was recorded; nothing is written" in capsys.readouterr().err
    )
    assert not Path("localization.out").exists()


@pytest.mark.parametrize("freed", [False, True])
def test_a_full_disk_stops_the_log_but_not_the_run(
    run: Runner, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, freed: bool
) -> None:
    disk = FullDisk(room=4000, until=40 if freed else 10**9)
    messages = [[measures(time)] for time in range(1, 25)]
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", lambda path, *words, **more: disk.open(path, *words, **more))
        assert run([ACCEPTED, measures(0)], *messages)[0] == 0
    errors = capsys.readouterr().err
    assert errors.count("run.jsonl: cannot be written: No space left on device") == 1
    (written,) = read_beliefs(Path("localization.out"))
    assert len(written.beliefs) == 3
    cycles = read_run(Path("run.jsonl")).cycles  # whole lines, whatever was missing meanwhile
    assert [cycle.time for cycle in cycles] == list(range(len(cycles)))
    assert (len(cycles) == 25) is freed
    if freed:
        assert "run.jsonl: nothing is missing, there was room again" in errors
    else:
        assert f"run.jsonl: lacks the last {25 - len(cycles)} of 26 lines: No space left on device" in errors


class FullDisk:
    """Makes files that take so many bytes, then parts of lines, until so many writes were tried."""

    def __init__(self, room: int, until: int) -> None:
        self.room, self.until, self.tried = room, until, 0

    def open(self, path: Path, *arguments: Any, **options: Any) -> Any:
        file = open(path, *arguments, **options)  # noqa: SIM115
        return Limited(self, file) if path.name == "run.jsonl" else file


class Limited:
    def __init__(self, disk: FullDisk, file: Any) -> None:
        self.disk, self.file = disk, file

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)

    def write(self, data: bytes) -> int:
        self.disk.tried += 1
        room = len(data) if self.disk.tried > self.disk.until else self.disk.room - self.file.tell()
        if room <= 0:
            raise OSError(28, "No space left on device")
        return int(self.file.write(data[:room]))


def test_a_log_that_cannot_be_opened(run: Runner, capsys: pytest.CaptureFixture[str]) -> None:
    Path("gone").mkdir()
    Path("gone/run.jsonl").symlink_to("nowhere/run.jsonl")
    status, _ = run([ACCEPTED, measures(0)], options=("--log", "gone/run.jsonl"))
    assert status == 2
    assert "gone/run.jsonl: cannot be written: No such file" in capsys.readouterr().err


def test_a_worker_that_fails_ends_the_run_and_the_log_stays(
    run: Runner, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise LabError("this lab is broken", source="lab.xml")

    monkeypatch.setattr(agent.offline.expected_readings, "compute_expected_readings", fail)
    status, _ = run([ACCEPTED, measures(0)], *([measures(time)] for time in range(1, 5)))
    assert status == 2
    errors = capsys.readouterr().err
    assert "lab.xml: this lab is broken" in errors
    assert "localization.out is not written; the log run.jsonl has the whole run" in errors
    assert read_run(Path("run.jsonl")).steps
    assert not Path("localization.out").exists()


def test_quiet_is_quiet(run: Runner, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([ACCEPTED, measures(0)], [measures(1)], options=("--quiet",))[0] == 0
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_a_robot_that_waits_for_start_says_so_once(run: Runner, capsys: pytest.CaptureFixture[str]) -> None:
    stopped = encode(Measures(time=0, stop=True, infrared=(0.5, 0.5, 0.5, 0.5)))
    status, _ = run([ACCEPTED, stopped], *([stopped] for _ in range(12)), [measures(0)], [measures(1)])
    assert status == 0
    assert capsys.readouterr().err.count("waiting for Start") == 1
    status, _ = run([ACCEPTED, stopped], [stopped], [measures(0)], [measures(1)])
    assert status == 0
    assert "waiting for Start" not in capsys.readouterr().err
