"""The command line, and agents' logs as something to watch."""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from ciberrato.errors import LabError, UsageError
from ciberrato.files.beliefs import write_beliefs
from ciberrato.files.lab import read_lab
from ciberrato.files.run_log import RunWriter
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.infrared.model import cell_readings, round_reading
from ciberrato.labs import find_lab
from ciberrato.viewer.cli import main
from ciberrato.viewer.page_messages import AskBelief, AskFrames
from ciberrato.viewer.recording import load_recording
from ciberrato.viewer.simulator_log import load_simulator_log
from ciberrato.world.parameters import Parameters

from .conftest import SECONDS

ANGLES = [0.0, 90.0, -90.0, 180.0]
LAB = find_lab("corridors")
START, STEPS = (0, 3), 5


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A log of a robot that drove five cells to the right from the left end of the middle row."""
    lab = read_lab(LAB)
    readings = round_reading(cell_readings(lab, ANGLES))
    header = {
        "format": "ciberrato-run",
        "format_version": 1,
        "lab_name": LAB.name,
        "lab_sha256": hashlib.sha256(LAB.read_bytes()).hexdigest(),
        "parameters": {"sim_time": 500, "cycle_time": 50, "obstacle_noise": 0.1, "motors_noise": 0.0},
        "sensor_angles": ANGLES,
        "robot_name": "santos",
        "robot_position": 2,
    }
    lines = [header]
    for time in range(20 * STEPS + 1):
        cell = time // 20
        cycle = {"time": time, "start": True, "displacement": 0.1 * time, "lateral": 0.01, "heading": 1.0}
        cycle["infrared"] = readings[START[1], START[0] + cell].tolist()
        if time % 20 == 0:
            cycle["step"] = cell
        lines.append(cycle)
    path = tmp_path / "run.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"time":1')
    return path


def frames(session):
    return json.loads(session.answer(AskFrames(0, 10_000, 512)))["frames"]


def test_a_log_is_laid_into_the_lab_from_the_most_likely_start(log):
    session = load_recording(log, None, None)
    assert [time for time, _, _ in frames(session)] == list(range(101))
    row = frames(session)[50][2][0]
    assert row[:4] == [2, 1.0 + 5.0, 7.01, 1.0]
    assert session.world.parameters.sim_time == 500
    [source] = session.overlays.sources.values()
    assert [entry[0] for entry in source.series()] == [0, 20, 40, 60, 80, 100]
    past = json.loads(session.answer(AskBelief("log", 99)))
    assert (past["belief"]["time"], past["belief"]["modes"][0][:2]) == (80, [3, 4])


def test_the_start_cell_can_be_given_and_the_agents_own_beliefs_shown(log, tmp_path):
    blocks = np.zeros((STEPS + 2, 7, 14))
    blocks[:, 6, 13] = 1.0
    text = "".join(
        "".join(" ".join(f"{p:.3f}" for p in row) + "\n" for row in block[::-1]) + "\n" for block in blocks
    )
    out = tmp_path / "localization.out"
    out.write_text(text)
    session = load_recording(log, "corridors", (1, 2), out)
    assert frames(session)[0][2][0][1:3] == [3.0, 5.01]
    past = json.loads(session.answer(AskBelief("log", 5)))
    assert past["belief"]["modes"] == [[6, 13, 1.0, 1.0]]
    out.write_text(text * 2)
    with pytest.raises(LabError, match="14 blocks; the log has 6 steps, so 7"):
        load_recording(log, "corridors", (1, 2), out)


def test_estimates_of_a_live_pose_filter_are_shown_as_they_are(log):
    lines = log.read_text().splitlines()[:3]
    cycle = json.loads(lines[2]) | {"estimate": [7.5, 8.25, -90.0, 0.3]}
    log.write_text("\n".join([*lines[:2], json.dumps(cycle)]) + "\n")
    shown = [rows[0][1:4] for _, _, rows in frames(load_recording(log, None, (0, 0)))]
    assert shown == [[1.0, 1.01, 1.0], [7.5, 8.25, -90.0]]


def test_beliefs_that_were_lost_and_begun_again_are_those_of_one_run(log, tmp_path):
    known, anew = np.zeros((7, 14)), np.full((7, 14), 1 / 98)
    known[6, 0] = 1.0
    out = tmp_path / "localization.out"
    write_beliefs(out, np.array([anew, known, known, anew, known, known, anew]))
    session = load_recording(log, None, (0, 0), out)
    shown = [json.loads(session.answer(AskBelief("log", time)))["belief"] for time in (0, 40, 60, 100)]
    assert [belief["modes"][0][2] for belief in shown] == pytest.approx([1.0, 1 / 98, 1.0, 1 / 98], rel=0.01)


@pytest.mark.parametrize(
    ("number", "line", "words"),
    [
        (1, "{}", ":1: .*format"),
        (1, "nonsense", ":1: .*JSON"),
        (2, '{"time":"x"}', ":2: time"),
        (3, "[]", ":3: .*object"),
    ],
)
def test_what_is_no_log_is_refused(log, number, line, words):
    lines = log.read_text().splitlines()
    lines[number - 1] = line
    log.write_text("\n".join(lines) + "\n")
    with pytest.raises(LabError, match=words):
        load_recording(log, None, None)


def test_a_log_of_another_lab_is_refused(log):
    with pytest.raises(LabError, match="another lab"):
        load_recording(log, "maze", None)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--nothing"], "--nothing"),
        (["--simulator", "a:b:c"], "more than one colon"),
        (["--simulator", "no.such.host.invalid"], "cannot be found"),
        (["--http", "x"], "not a port"),
        (["--http", "127.0.0.1:99999"], "not a port"),
        (["--http", "no.such.host.invalid:0"], "cannot open"),
        (["--run", "missing.jsonl"], "cannot read the log"),
        (["--start-cell", "1"], "COLUMN,ROW"),
        (["--angles", "0,60,x,180"], "not four angles"),
    ],
)
def test_wrong_arguments_are_one_line_and_status_2(arguments, words, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_port_in_use_is_said(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert main(["--http", str(taken.getsockname()[1]), "--overlay", "0"]) == 2
        assert "in use" in capsys.readouterr().err
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as busy:
        busy.bind(("127.0.0.1", 0))
        assert main(["--http", "0", "--overlay", str(busy.getsockname()[1])]) == 2
        assert "overlay" in capsys.readouterr().err


SIMULATOR_LOG = Path(__file__).parents[1] / "data" / "golden" / "logs" / "log2_two_robots" / "sim.log.gz"


def test_a_log_of_the_real_simulator_is_shown_as_it_says():
    session = load_simulator_log(SIMULATOR_LOG)
    shown = frames(session)
    assert [time for time, _, _ in shown] == list(range(401))
    # Read with another parser: every robot's pose, score and collisions of every cycle.
    root = ET.fromstring(gzip.decompress(SIMULATOR_LOG.read_bytes()))
    for info, (time, _, rows) in zip(root.iter("LogInfo"), shown, strict=True):
        assert int(info.attrib["Time"]) == time
        for robot, row in zip(info.iter("Robot"), rows, strict=True):
            place, scores = robot.find("Pos"), robot.find("Scores")
            assert place is not None
            assert scores is not None
            assert row[:4] == [int(robot.attrib["Id"]), *(float(place.attrib[n]) for n in ("X", "Y", "Dir"))]
            assert row[4] == int(scores.attrib["Score"])
            assert row[7] == int(scores.attrib["Collisions"])
            assert row[10] == robot.attrib["State"]
    news = dict(session.snapshot())
    world = json.loads(news["world"])
    assert (world["lab"]["name"], len(world["grid"]), world["simTime"]) == ("Open", 2, 400)
    assert (world["recording"], world["control"]) == (True, False)
    assert [robot["name"] for robot in json.loads(news["roster"])["robots"]] == ["bot1", "bot2"]


def test_the_angles_of_a_simulators_log_are_those_that_the_user_says():
    session = load_simulator_log(SIMULATOR_LOG, (0.0, 90.0, -90.0, 180.0))
    robots = json.loads(dict(session.snapshot())["roster"])["robots"]
    assert [robot["angles"] for robot in robots] == [[0.0, 90.0, -90.0, 180.0]] * 2


def test_a_log_that_was_cut_is_shown_as_far_as_it_goes_and_that_is_said(tmp_path):
    cut, lines = tmp_path / "cut", []
    cut.write_bytes(gzip.decompress(SIMULATOR_LOG.read_bytes())[:100_000])
    shown = frames(load_simulator_log(cut, notify=lines.append))
    assert 50 < len(shown) < 400
    assert len(lines) == 1
    assert "has no end" in lines[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--run", str(SIMULATOR_LOG), "-m", "maze"], "-m: a simulator's log holds the lab"),
        (["--run", str(SIMULATOR_LOG), "--start-cell", "0,0"], "--start-cell: "),
        (["--run", str(SIMULATOR_LOG), "--beliefs", "x"], "--beliefs: "),
    ],
)
def test_options_that_a_simulators_log_does_not_need_are_refused(arguments, words, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_angles_are_not_said_for_an_agents_log(log, capsys):
    assert main(["--run", str(log), "--angles", "0,60,-60,180"]) == 2
    assert "an agent's log tells how" in capsys.readouterr().err


def test_what_begins_like_a_log_and_is_none_is_refused(tmp_path, capsys):
    path = tmp_path / "x.log"
    path.write_text("<Log><Nothing></Log>")
    assert main(["--run", str(path)]) == 2
    error = capsys.readouterr().err
    assert str(path) in error
    assert error.count("\n") == 1


def started(*arguments: str, **options: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "ciberrato.viewer", "--http", "0", "--overlay", "0", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)  # type: ignore[call-overload, no-any-return]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_quietly(number):
    with started() as process:
        assert process.stdout.readline().startswith("page: http://127.0.0.1:")
        assert process.stdout.readline().startswith("overlay: 127.0.0.1:")
        process.send_signal(number)
        _, error = process.communicate(timeout=SECONDS)
    assert (process.returncode, error) == (0, "")


def test_it_ends_with_whoever_started_it():
    with started("--until-eof", stdin=subprocess.PIPE) as process:
        assert process.stdout.readline().startswith("page: ")
        process.stdin.close()
        assert process.wait(timeout=SECONDS) == 0


def test_a_clients_log_shows_its_live_poses_and_one_without_poses_says_so(tmp_path):
    cells = ((2, 3, 0.75), (0, 0, 0.25))
    found = Cycle(time=1, start=True, estimate=(7.0, 5.0, 90.0, 0.75), cells=cells)
    cycles = [Cycle(time=0, start=True), found]
    lab = find_lab("maze")
    common = {"parameters": Parameters(), "sensor_angles": (0.0, 60.0, -60.0, 180.0)}
    digest = hashlib.sha256(lab.read_bytes()).hexdigest()
    known = RunHeader(lab_name=lab.name, lab_sha256=digest, **common)
    unknown = RunHeader(lab_name="", lab_sha256=hashlib.sha256(b"").hexdigest(), **common)
    for name, header, written in [("a", known, cycles), ("b", known, cycles[:1]), ("c", unknown, cycles)]:
        with RunWriter(tmp_path / name, header) as writer:
            for cycle in written:
                writer.write(cycle)
    session = load_recording(tmp_path / "a", None, None)
    belief = json.loads(session.answer(AskBelief("log", 1)))["belief"]
    assert belief["modes"][0][:2] == [2, 3]
    assert belief["modes"][0][2] == pytest.approx(0.75, abs=0.01)
    with pytest.raises(UsageError, match="holds no poses"):
        load_recording(tmp_path / "b", None, None)
    with pytest.raises(LabError, match="name that with -m"):
        load_recording(tmp_path / "c", None, None)
    load_recording(tmp_path / "c", "maze", None)


def test_a_log_that_names_no_lab_takes_the_one_that_is_named(log: Path) -> None:
    """As a client writes it that was not told its lab."""
    header, *lines = log.read_text().splitlines(keepends=True)
    fields = json.loads(header) | {"lab_name": "", "lab_sha256": hashlib.sha256(b"").hexdigest()}
    log.write_text("".join([json.dumps(fields) + "\n", *lines]))
    with pytest.raises(LabError, match=r"run.jsonl:1: does not say in which lab .*; name that with -m"):
        load_recording(log, None, None)
    assert load_recording(log, "corridors", None).world.lab == read_lab(LAB)


def test_standard_input_that_cannot_be_watched_has_ended(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    for path in (Path(os.devnull), tmp_path / "empty"):
        with path.open() as file, started("--until-eof", stdin=file) as process:
            _, errors = process.communicate(timeout=SECONDS)
        assert process.returncode == 0
        assert "Traceback" not in errors
