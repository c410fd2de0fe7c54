from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from ciberrato.errors import UsageError
from ciberrato.files.lab import default_lab, read_lab
from ciberrato.files.simulator_log import read_simulator_log
from ciberrato.files.start_grid import default_grid, read_grid
from ciberrato.labs import find_grid, find_lab
from ciberrato.net import TcpLink, UdpLink
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Refusal,
    RobotRegistration,
    ViewRegistration,
    decode_simulator_message,
    encode,
)
from ciberrato.world.parameters import Parameters
from simulator_stub.assembly import _tell_who_is_heard, build_server, read_world
from simulator_stub.cli import main
from simulator_stub.options import parse_arguments
from simulator_stub.recording.date import log_date

REPOSITORY = Path(__file__).parents[2]
PATIENCE = 300.0  # seconds; only a failure takes so long


def world_of(*arguments: str) -> tuple[object, object, Parameters]:
    return read_world(parse_arguments(arguments), lambda line: None)


def test_without_options_the_world_is_the_real_simulators() -> None:
    assert world_of() == (default_lab(), default_grid(), Parameters())


def test_files_are_found_by_name_and_by_path_and_announced_as_given() -> None:
    path = str(find_grid("corridors"))
    lab, grid, parameters = world_of("--lab", "corridors", "--grid", path, "--param", "harsh")
    assert (lab, grid) == (read_lab(find_lab("corridors")), read_grid(path))
    assert (parameters.motors_noise, parameters.lab_file, parameters.grid_file) == (5.0, "corridors", path)


def test_scoring_modes_have_names() -> None:
    from simulator_stub.options import SCORING_MODES
    from simulator_stub.scoring import SCORINGS

    assert sorted(SCORING_MODES) == sorted(SCORINGS)
    for number, name in SCORING_MODES.items():
        assert SCORINGS[number].__name__.lower() == name.replace("-", "")
        for text in (str(number), name, name.upper(), name.replace("-", "_")):
            assert parse_arguments(["--scoring", text]).scoring == number
    with pytest.raises(
        UsageError, match=r"'contol' is not a scoring mode; .*1 control.*did you mean 'control'"
    ):
        parse_arguments(["--scoring", "contol"])


def test_poses_may_be_given_in_place_and_are_not_announced() -> None:
    _, grid, parameters = world_of("--grid", "5,7,0; 9.5,-3,-90.5;")
    positions = [(p.x, p.y, p.direction_deg) for p in grid.positions]  # type: ignore[attr-defined]
    assert positions == [(5.0, 7.0, 0.0), (9.5, -3.0, -90.5)]
    assert parameters.grid_file is None


def test_what_the_parameter_file_names_is_read_unless_the_command_line_says_otherwise(tmp_path: Path) -> None:
    file = tmp_path / "params.xml"
    file.write_text('<Parameters SimTime="77" Lab="maze" Grid="rooms"/>')
    lab, grid, parameters = world_of("--param", str(file))
    assert (lab, grid) == (read_lab(find_lab("maze")), read_grid(find_grid("rooms")))
    assert (parameters.sim_time, parameters.lab_file, parameters.grid_file) == (77, "maze", "rooms")
    lab, grid, parameters = world_of("--param", str(file), "--lab", "open", "--grid", "1,1,0")
    assert lab == read_lab(find_lab("open"))
    assert (parameters.lab_file, parameters.grid_file) == ("open", None)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--port", "70000"],
        ["--port", "x"],
        ["--seed", "-1"],
        ["--speed", "0"],
        ["--speed", "nan"],
        ["--speed", "inf"],
        ["--answer-limit", "0"],
        ["--autostart", "-2"],
        ["--scoring", "99"],
        ["--no-such-option"],
        ["stray"],
        ["--lab", "no-such-lab"],
        ["--grid", "1,2"],
        ["--param", "/"],
        ["--truth", "/no/such/folder/truth.csv"],
        ["--log", "/no/such/folder/run.log"],
        ["--result", "/no/such/folder/result.json"],
        ["--truth", "/dev/null", "--log", "/"],
        ["--runs", "0"],
        ["--reproducible"],
        ["--ready-fd", "0"],
        ["--ready-fd", "987"],
        ["--bind", "192.0.2.1"],
        ["--bind", "no such host"],
    ],
)
def test_what_cannot_be_used_is_one_line_and_exit_status_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    handler = signal.getsignal(signal.SIGTERM)
    try:
        where = [] if "--bind" in arguments else ["--bind", "127.0.0.1"]
        port = [] if "--port" in arguments else ["--port", "0"]
        assert main([*where, *port, *arguments]) == 2
    finally:
        signal.signal(signal.SIGTERM, handler)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("ciberrato-simulator: ")
    assert err.count("\n") == 1


def test_a_port_in_use_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    handler = signal.getsignal(signal.SIGTERM)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        port = holder.getsockname()[1]
        try:
            assert main(["--bind", "127.0.0.1", "--port", str(port)]) == 2
        finally:
            signal.signal(signal.SIGTERM, handler)
    err = capsys.readouterr().err
    assert err == f"ciberrato-simulator: cannot listen on udp 127.0.0.1:{port}: Address already in use\n"


@pytest.mark.parametrize("text", ["", "1,1", "1,1,zero", "nan,1,0", "1;1;0", "5"])
def test_poses_that_are_none_are_explained(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    handler = signal.getsignal(signal.SIGTERM)
    try:
        assert main(["--port", "0", "--bind", "127.0.0.1", "--grid", text]) == 2
    finally:
        signal.signal(signal.SIGTERM, handler)
    err = capsys.readouterr().err
    assert err == (
        f"ciberrato-simulator: argument --grid: {text!r} is no file, and not X,Y,DIR[;X,Y,DIR...] "
        "(units and degrees, a semicolon between robots); write for example 1,1,0\n"
    )


def told(*arguments: str) -> list[str]:
    lines: list[str] = []
    read_world(parse_arguments(arguments), lines.append)
    return lines


def test_what_is_odd_in_the_files_is_told_and_refused_if_asked(tmp_path: Path) -> None:
    lab, grid, params = (tmp_path / name for name in ("lab.xml", "grid.xml", "params.xml"))
    lab.write_text('<Lab Width="8" Heigth="4">\n<Row Pos="0" Pattern="     |     "/>\n</Lab>')
    grid.write_text('<Grid>\n<Position X="4" Y="1"/>\n</Grid>')
    params.write_text('<Parameters SimTime="9"\n MotorsNoise="1,5"/>')
    words = ("--lab", str(lab), "--grid", str(grid), "--param", str(params))
    starts = [line.removeprefix(f"{tmp_path}/").split(" and ")[0] for line in told(*words)]
    assert starts == [
        'params.xml:2: Parameters MotorsNoise="1,5" is not a number',
        'lab.xml:1: Lab Heigth="4" means nothing',
        "grid.xml:2: start 1 at (4, 1) is in a wall",
    ]
    with pytest.raises(UsageError, match="--strict: 3 warnings"):
        told(*words, "--strict")


def test_start_poses_in_place_are_looked_at_too(tmp_path: Path) -> None:
    lab = tmp_path / "lab.xml"
    lab.write_text('<Lab Name="small" Width="8" Height="4">\n<Row Pos="0" Pattern="     |     "/>\n</Lab>')
    for poses, message in (
        ("9,9,0", "--grid: start 1 at (9, 9) is outside the lab of 8 x 4 and the robot stands there"),
        ("4,1,0", "--grid: start 1 at (4, 1) is in a wall and the robot is stuck in it"),
        ("1,1,0;1.2,1,0", "--grid: start 2 at (1.2, 1) overlaps start 1 and two robots there collide"),
    ):
        assert told("--lab", str(lab), "--grid", poses) == [message]
    assert told("--lab", str(lab), "--grid", "1,1,0;") == []
    assert told("--lab", str(lab)) == [
        "built-in start grid: start 1 at (9, 3) is outside the lab of 8 x 4 and the robot stands there"
    ]
    for name in ("standard", "maze", "corridors", "lines"):
        assert told("--lab", name, "--grid", name) == []


class Process:
    """The simulator as a process of its own."""

    def __init__(self, *arguments: str, pass_fds: tuple[int, ...] = (), **environment: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "simulator_stub", "--bind", "127.0.0.1", "--port", "0", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=REPOSITORY,
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)} | environment,
            pass_fds=pass_fds,
        )

    def lines(self, count: int) -> list[str]:
        assert self.process.stdout is not None
        return [self.process.stdout.readline().rstrip("\n") for _ in range(count)]

    def finish(self, number: signal.Signals) -> tuple[int, str, str]:
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, out, err


def heard(link: UdpLink | TcpLink) -> bytes:
    """Wait for a message."""
    data = link.receive(PATIENCE)
    assert data is not None
    return data


@pytest.fixture
def processes() -> Iterator[list[Process]]:
    started: list[Process] = []
    yield started
    for each in started:
        if each.process.poll() is None:
            each.process.kill()
        each.process.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_cleanly_in_the_middle_of_a_run(
    number: signal.Signals, processes: list[Process], tmp_path: Path
) -> None:
    truth = tmp_path / "truth.csv"
    simulator = Process("--truth", str(truth), "--autostart", "1", "--lockstep", "--answer-limit", "inf")
    processes.append(simulator)
    seed, udp, tcp = simulator.lines(3)
    assert seed.startswith("seed ")
    assert int(seed.split()[1]) >= 0
    assert udp.startswith("listening on udp 127.0.0.1:")
    assert tcp.startswith("listening on tcp 127.0.0.1:")
    port = int(udp.rsplit(":", 1)[1])
    assert tcp.endswith(f":{port}")
    with UdpLink("127.0.0.1", port) as link:
        link.register(encode(RobotRegistration(name="santos")))
        heard(link)
        # Time 0 twice, then times 1 to 10: it then waits, for ever, for an answer.
        for _ in range(2 + 9):
            heard(link)
            link.send(encode(Actions(left_motor=0.1, right_motor=0.1)))
        assert b'<Measures Time="10">' in heard(link)
        lines = truth.read_text().splitlines()
        assert lines[-1].startswith("10,1,"), "what robots have been told is in the file"
        status, out, err = simulator.finish(number)
    assert (status, out) == (0, "")
    assert "Traceback" not in err
    assert "'santos'" in err
    assert truth.read_text().splitlines() == lines
    assert {len(line.split(",")) for line in lines} == {6}


def test_runs_follow_one_another_and_the_process_ends(processes: list[Process], tmp_path: Path) -> None:
    parameters = tmp_path / "short.xml"
    parameters.write_text('<Parameters SimTime="20" CycleTime="1"/>')
    names = {name: tmp_path / f"run.{name}" for name in ("log", "truth", "result")}
    files = [text for name, path in names.items() for text in (f"--{name}", str(path))]
    pace = "--lockstep --answer-limit inf --autostart 1 --seed 5 --gps"
    options = ["--param", str(parameters), *pace.split()]
    simulator = Process(*options, "--runs", "2", *files)
    processes.append(simulator)
    port = int(simulator.lines(3)[1].rsplit(":", 1)[1])
    for _ in range(2):
        with TcpLink("127.0.0.1", port) as link:
            link.register(encode(RobotRegistration(name="santos")))
            assert b'GPS="On"' in heard(link)
            last = b""
            while b'Start="Off" Stop="Off"' not in last:
                last = heard(link)
                link.send(encode(Actions(left_motor=0.1, right_motor=0.1)))
    out, err = simulator.process.communicate(timeout=PATIENCE)
    assert (simulator.process.returncode, out) == (0, "")
    assert "Traceback" not in err
    assert "robot 1, 'santos': running, score 200" in err
    runs = json.loads(names["result"].read_text())["runs"]
    assert [(run["seed"], run["time"], run["state"]) for run in runs] == [
        (5, 20, "Finished"),
        (6, 20, "Finished"),
    ]
    for name in ("log", "truth"):
        first, second = names[name], tmp_path / f"run-2.{name}"
        if name == "log":
            logs = [read_simulator_log(path) for path in (first, second)]
            assert [(log.complete, len(log.records)) for log in logs] == [(True, 21)] * 2
            assert logs[0].records != logs[1].records
            for log, run in zip(logs, runs, strict=True):
                assert log.records[-1].robots[0].x == pytest.approx(run["robots"][0]["x"], rel=1e-5)
        else:
            assert [len(path.read_text().splitlines()) for path in (first, second)] == [22, 22]


def test_it_can_end_by_itself_when_the_robots_have_gone(processes: list[Process], tmp_path: Path) -> None:
    result = tmp_path / "result.json"
    simulator = Process("--exit-at-end", "--autostart", "1", "--lockstep", "--result", str(result), "--quiet")
    processes.append(simulator)
    port = int(simulator.lines(3)[1].rsplit(":", 1)[1])
    with TcpLink("127.0.0.1", port) as link:
        link.register(encode(RobotRegistration(name="leaver")))
        while b'Time="5"' not in heard(link):
            link.send(encode(Actions(left_motor=0.1, right_motor=0.1)))
    out, err = simulator.process.communicate(timeout=PATIENCE)
    assert (simulator.process.returncode, out, err) == (0, "", "")
    (run,) = json.loads(result.read_text())["runs"]
    assert (run["state"], run["robots"][0]["name"]) == ("Running", "leaver")
    assert run["time"] >= 5


def test_it_ends_when_all_have_fallen_silent_and_tells_since_when(
    processes: list[Process], tmp_path: Path
) -> None:
    result, ready = tmp_path / "result.json", tmp_path / "ready"
    simulator = Process(
        # Waited for once, and so long that a busy machine does not make the client below a silent one.
        *("--exit-when-silent", "0.5", "--autostart", "1", "--lockstep", "--answer-limit", "10"),
        *("--ready-file", str(ready), "--result", str(result), "--quiet"),
    )
    processes.append(simulator)
    port = int(simulator.lines(3)[1].rsplit(":", 1)[1])
    answered = 0
    with UdpLink("127.0.0.1", port) as link:
        link.register(encode(RobotRegistration(name="faint")))
        while answered < 6:
            data = heard(link)
            link.send(encode(Actions(left_motor=0.1, right_motor=0.1)))
            answered += b'Start="On"' in data
        out, err = simulator.process.communicate(timeout=PATIENCE)  # the socket is still open
    assert (simulator.process.returncode, out, err) == (0, "", "")
    assert ready.read_text() == f"{port}\n"
    (run,) = json.loads(result.read_text())["runs"]
    (robot,) = run["robots"]
    assert robot["answered"] == 6
    assert robot["silent_since"] == robot["last_answer"] + 1
    assert robot["unanswered"] == 10 + 1  # half a second of 50 ms, and the cycle of farewell
    assert robot["answered"] + robot["unanswered"] == run["time"]


def test_the_port_is_written_to_a_descriptor_and_it_is_closed(processes: list[Process]) -> None:
    reader, writer = os.pipe()
    simulator = Process("--ready-fd", str(writer), pass_fds=(writer,))
    os.close(writer)
    processes.append(simulator)
    with open(reader) as pipe:
        text = pipe.read()  # comes to an end although the simulator goes on
    assert simulator.process.poll() is None
    assert simulator.lines(3)[1] == f"listening on udp 127.0.0.1:{text.strip()}"
    assert text.endswith("\n")


def test_a_reader_of_the_port_that_has_gone_is_no_fault(processes: list[Process]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    simulator = Process("--ready-fd", str(writer), pass_fds=(writer,))
    os.close(writer)
    processes.append(simulator)
    simulator.lines(3)
    assert simulator.finish(signal.SIGTERM)[0] == 0


def drive_reproducibly(folder: Path, processes: list[Process], seed: str, **environment: str) -> list[bytes]:
    """Do a short run; return all that was written."""
    paths = [folder / name for name in ("run.log", "truth.csv", "result.json")]
    log, truth, result = map(str, paths)
    simulator = Process(
        *("--lab", "maze", "--seed", seed, "--reproducible", "--autostart", "1", "--exit-at-end"),
        *("--lockstep", "--answer-limit", "inf", "--log", log, "--truth", truth, "--result", result),
        **environment,
    )
    processes.append(simulator)
    port = int(simulator.lines(3)[1].rsplit(":", 1)[1])
    with TcpLink("127.0.0.1", port) as link:
        link.register(encode(RobotRegistration(name="twin")))
        while b'Time="30"' not in heard(link):
            link.send(encode(Actions(left_motor=0.1, right_motor=0.08)))
    assert simulator.process.wait(timeout=PATIENCE) == 0
    return [path.read_bytes() for path in paths]


def test_reproducible_runs_are_the_same_bytes_date_and_all(
    processes: list[Process], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    once = drive_reproducibly(tmp_path, processes, "5")
    assert once == drive_reproducibly(tmp_path, processes, "5")
    assert read_simulator_log(tmp_path / "run.log").header.date == "Sat Jan  1 00:00:05 2000"
    other = drive_reproducibly(tmp_path, processes, "6")
    assert all(one != another for one, another in zip(once, other, strict=True))
    dated = drive_reproducibly(tmp_path, processes, "5", SOURCE_DATE_EPOCH="1700000000")
    assert dated[0] == once[0].replace(b"Sat Jan  1 00:00:05 2000", b"Tue Nov 14 22:13:20 2023")
    assert dated[1:] == once[1:]


@pytest.mark.parametrize("text", ["-1", "now", "1e9", "9" * 30, "253402300800"])
def test_a_source_date_that_is_none_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", text)
    with pytest.raises(UsageError, match=f"SOURCE_DATE_EPOCH={text}: not a number of seconds since 1970"):
        log_date(None)


def test_dates_of_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "")
    before = time.time()
    assert before - 1 <= time.mktime(time.strptime(log_date(None))) <= time.time()
    assert log_date(0) == "Sat Jan  1 00:00:00 2000"
    assert log_date(10**9 + 7) == log_date(7)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "253402300799")
    assert log_date(None) == log_date(7) == "Fri Dec 31 23:59:59 9999"


def test_signals_at_any_moment_of_the_start_end_it_quietly(processes: list[Process]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        simulator = Process()
        processes.append(simulator)
        simulator.lines(1)
        status, _, err = simulator.finish(number)
        assert status == 0
        assert "Traceback" not in err


@pytest.mark.parametrize(
    ("arguments", "address", "told"),
    [
        pytest.param([], "127.0.0.1", "only programs on this machine can connect", id="default"),
        pytest.param(["--bind", "127.0.0.1"], "127.0.0.1", None, id="said"),
        pytest.param(["--bind", "127.0.0.2"], "127.0.0.2", None, id="another-loopback"),
    ],
)
def test_it_is_heard_on_this_machine_unless_told_otherwise_and_says_so(
    arguments: list[str], address: str, told: str | None
) -> None:
    lines: list[str] = []
    notes: list[str] = []
    options = parse_arguments(["--port", "0", *arguments])
    server = build_server(options, print_line=lines.append, notify=notes.append)
    try:
        assert [line.rpartition(":")[0] for line in lines[1:]] == [
            f"listening on udp {address}",
            f"listening on tcp {address}",
        ]
        assert len(notes) == (told is not None)
        if told is not None:
            assert told in notes[0]
            assert "--bind 0.0.0.0 --views local" in notes[0]
    finally:
        server.close()


@pytest.mark.parametrize(
    ("limits", "told"), [((), True), (("--views", "local"), False), (("--view-token", "s"), False)]
)
def test_who_binds_wide_is_told_who_may_command(limits: tuple[str, ...], told: bool) -> None:
    notes: list[str] = []
    # No socket is opened: nothing of a test is to be heard on a network.
    _tell_who_is_heard(parse_arguments(["--bind", "0.0.0.0", *limits]), "0.0.0.0", notes.append)
    assert len(notes) == told
    if told:
        assert "--views local or --view-token TEXT" in notes[0]


@pytest.mark.parametrize("token", ["", "a\nb", "é", "x" * 201])
def test_a_token_that_no_view_could_show_is_refused(token: str) -> None:
    with pytest.raises(UsageError, match="token must be"):
        parse_arguments(["--view-token", token])


def test_the_token_comes_from_the_environment_too_and_a_view_shows_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CIBERRATO_VIEW_TOKEN", "secret")
    options = parse_arguments(["--port", "0", "--bind", "127.0.0.1"])
    assert options.view_token == "secret"
    server = build_server(options, print_line=lambda line: None, notify=lambda line: None)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        for token, kind in ((None, Refusal), ("wrong", Refusal), ("secret", Acceptance)):
            with UdpLink("127.0.0.1", server.port) as link:
                link.register(encode(ViewRegistration(token)))
                assert isinstance(decode_simulator_message(heard(link)), kind)
    finally:
        server.stop()
        thread.join(PATIENCE)
        server.close()
