"""The agent's log: what is written is read back; broken logs are refused by line."""

import dataclasses
import itertools
import json
from pathlib import Path

import pytest

from ciberrato.errors import LabError
from ciberrato.files.run_log import RunWriter, read_run
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
from ciberrato.world.parameters import Parameters

HEADER = RunHeader(
    lab_name="corridors_lab.xml",
    lab_sha256="00" * 32,
    parameters=Parameters(motors_noise=0.0, lab_file="corridors_lab.xml"),
    n_beacons=1,
    sensor_angles=(0.0, 90.0, -90.0, 180.0),
    seed=7,
    robot_name="santos",
)
CYCLES = (
    Cycle(time=0, stop=True, compass=1.0, infrared=(0.7, 2.6, 2.7, 0.6), step=0),
    Cycle(time=0, start=True, collision=False, ground=-1, command=(0.1, 0.1), answered=True),
    Cycle(
        time=21,
        start=True,
        infrared=(None, 2.5, None, -0.1),
        leds=(False, True, False),
        command=(0.1, 0.1 / 3),
        displacement=2.0000000000000004,
        lateral=-0.01,
        heading=1.5,
        spread=(0.01, 0.02, 0.5),
        phase="drive",
        step=1,
        readings=(0.6, 2.5, 2.4, -0.1),
    ),
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "run.jsonl"
    with RunWriter(path, HEADER) as writer:
        for cycle in CYCLES:
            writer.write(cycle)
    return path


def test_what_is_written_is_read_back(log: Path) -> None:
    assert read_run(log) == RecordedRun(HEADER, CYCLES)


def test_each_line_is_in_the_file_before_the_next_is_written(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    writer = RunWriter(path, HEADER)
    assert read_run(path) == RecordedRun(HEADER, ())
    writer.write(CYCLES[0])
    assert read_run(path).cycles == CYCLES[:1]
    writer.close()


def test_steps_are_the_marked_cycles(log: Path) -> None:
    first, second = read_run(log).steps
    assert (first.index, first.time, first.readings) == (0, 0, (0.7, 2.6, 2.7, 0.6))
    assert (second.index, second.time, second.readings) == (1, 21, (0.6, 2.5, 2.4, -0.1))
    assert second.along == pytest.approx(4.4e-16, abs=1e-15)
    assert (second.lateral, second.heading, second.spread) == (-0.01, 1.5, (0.01, 0.02, 0.5))


def test_a_log_cut_anywhere_is_good_to_its_last_full_line(log: Path) -> None:
    data = log.read_bytes()
    ends = [index + 1 for index, byte in enumerate(data) if byte == ord("\n")]
    around = {end + shift for end in ends for shift in (-2, -1, 0, 1)}
    for cut in sorted({cut for cut in around if cut <= len(data)} | set(range(0, len(data), 17))):
        log.write_bytes(data[:cut])
        complete = sum(end <= cut for end in ends)
        if complete == 0:
            with pytest.raises(LabError, match="no complete line"):
                read_run(log)
        else:
            assert read_run(log).cycles == CYCLES[: complete - 1]


def _change(line: str, **values: object) -> str:
    return json.dumps({**json.loads(line), **values})


@pytest.mark.parametrize(
    ("number", "broken", "complaint"),
    [
        (1, lambda line: "{}", ':1: the first line does not say "format"'),
        (1, lambda line: _change(line, format_version=2), ":1: format version 2"),
        (1, lambda line: _change(line, parameters=3), ":1: parameters: an object"),
        (1, lambda line: _change(line, parameters={"sim_time": "long"}), ":1: sim_time: int was expected"),
        (1, lambda line: _change(line, sensor_angles=[0, 90]), ":1: sensor_angles"),
        (1, lambda line: line.replace('"lab_name"', '"lab_nam"'), ":1: unknown entry 'lab_nam'"),
        (2, lambda line: "{", ":2: not a line of JSON"),
        (2, lambda line: "", ":2: not a line of JSON"),
        (2, lambda line: "[" * 100_000, ":2: "),
        (2, lambda line: line.replace("2.6", "NaN"), ":2: not a line of JSON: NaN"),
        (2, lambda line: "[1]", ":2: a JSON object"),
        (2, lambda line: "{}", ":2: time is missing"),
        (3, lambda line: _change(line, time=1.5), ":3: time: int was expected"),
        (3, lambda line: _change(line, time=True), ":3: time: int was expected"),
        (3, lambda line: _change(line, infrared=[1, 2, 3]), ":3: infrared"),
        (3, lambda line: _change(line, leds=[0, 0, 0]), ":3: leds"),
        (3, lambda line: _change(line, command="none"), ":3: command"),
        (4, lambda line: _change(line, step=2), ":4: step 2 where step 1 was due"),
    ],
    ids=itertools.count(),
)
def test_broken_lines_are_named(log: Path, number: int, broken, complaint: str) -> None:
    lines = log.read_text().splitlines()
    lines[number - 1] = broken(lines[number - 1])
    log.write_text("\n".join(lines) + "\n")
    with pytest.raises(LabError) as caught:
        read_run(log)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(LabError, match="cannot read the log"):
        read_run(tmp_path / "none")
    with pytest.raises(LabError, match="cannot read the log"):
        read_run(tmp_path)


def test_every_field_type_is_checked() -> None:
    from ciberrato.files.run_log import _CHECKS

    for kind in (RunHeader, Cycle, Parameters):
        for field in dataclasses.fields(kind):
            assert str(field.type).removesuffix(" | None") in _CHECKS


def test_torn_lines_and_missing_steps_are_left_out_with_a_warning_if_asked(log: Path) -> None:
    lines = log.read_text().splitlines()
    torn = lines[2][:40] + lines[2]
    log.write_text("\n".join([*lines[:2], torn, _change(lines[3], step=3), ""]))
    with pytest.raises(LabError, match=r":3: not a line of JSON.*--salvage"):
        read_run(log)
    told: list[str] = []
    run = read_run(log, salvage=told.append)
    assert [(step.index, step.readings) for step in run.steps] == [
        (0, (0.7, 2.6, 2.7, 0.6)),
        (1, (None, None, None, None)),
        (2, (None, None, None, None)),
        (3, (0.6, 2.5, 2.4, -0.1)),
    ]
    assert [line.partition(": ")[0] for line in told] == [f"{log}:3", f"{log}:4"]
    assert "the line is left out" in told[0]
    assert "steps 1 to 2 are missing" in told[1]
    assert "--salvage" not in "".join(told)


def test_of_very_many_torn_lines_a_few_are_told(log: Path) -> None:
    with log.open("a") as file:
        file.writelines("{\n" for _ in range(100))
    told: list[str] = []
    assert read_run(log, salvage=told.append).cycles == CYCLES
    assert len(told) == 6
    assert told[-1] == f"{log}: 100 lines are left out in all"
