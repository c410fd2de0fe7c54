"""Files that are no labs, or too much of one, are told so at once; a silent pipe is given up."""

from __future__ import annotations

import math
import os
import sys
import threading
from pathlib import Path

import pytest
from lxml import etree

from ciberrato.checks.files import check_files
from ciberrato.checks.schema import schema_file
from ciberrato.errors import LabError, UsageError
from ciberrato.files.lab import MOST, parse_lab
from ciberrato.files.parameters import parse_parameter_file, parse_parameters
from ciberrato.files.run_log import read_run
from ciberrato.files.xml import MAX_FINDINGS, read_file
from ciberrato.files.xml_document import MAX_ATTRIBUTES, MAX_TAGS
from ciberrato.grading.course import CourseError, read_course
from ciberrato.labtool.cli import main
from ciberrato.system import opening

WALL = '<Wall><Corner X="1" Y="1"/><Corner X="2" Y="1"/><Corner X="2" Y="2"/></Wall>'
ROUND = "".join(
    f'<Corner X="{9 + 3 * math.cos(i / 600):.6f}" Y="{7 + 3 * math.sin(i / 600):.6f}"/>' for i in range(3000)
)


@pytest.mark.parametrize(
    ("inside", "problem"),
    [
        (WALL * (MOST["walls"] + 1), "more than 10000 walls"),
        ("<Wall/>" * 1_000_000, f"has 1000002 tags, {MAX_TAGS} at most"),
        (f"<Wall>{ROUND}</Wall>", "more than 1000 corners of a wall"),
        ('<Beacon X="5" Y="5"/>' * 5000, "more than 500 beacons"),
        ('<Target X="5" Y="5"/>' * 5000, "more than 500 targets"),
        (f'<Row Pos="1" Pattern="{"--+" * 2_000_000}"/>', "more than 1000000 characters in its rows"),
        (f'<Row Pos="0" Pattern="{"  |" * 20_000}"/>', "more than 10000 walls"),
        ("<Wall " + " ".join(f'A{i}="1"' for i in range(100_000)) + "/>", "attributes"),
        ('<Beacon X="a"/>' * (MAX_FINDINGS + 1), "more than 1000 mistakes"),
    ],
    ids=["walls", "tags", "corners", "beacons", "targets", "row", "row of walls", "attributes", "mistakes"],
)
def test_too_much_is_refused(inside: str, problem: str) -> None:
    with pytest.raises(LabError, match=problem):
        parse_lab(f'<Lab Width="28" Height="14">{inside}</Lab>'.encode())


def test_as_much_as_is_allowed_is_read() -> None:
    assert (
        len(parse_lab(f'<Lab Width="28" Height="14">{WALL * MOST["walls"]}</Lab>'.encode()).walls) == 10_000
    )
    banner = f'<!-- {"=" * 9999} --><Lab Width="28" Height="14"/>'
    assert parse_lab(banner.encode()).width == 28.0
    many = "".join(f' A{i}="1"' for i in range(MAX_ATTRIBUTES - 2))
    assert parse_lab(f'<Lab Width="28" Height="14"{many}/>'.encode()).height == 14.0


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("name", ['SYSTEM "file:///etc/passwd"', 'PUBLIC "-//X//Y" "http://127.0.0.1:9/x"'])
def test_documents_outside_are_refused(name: str, encoding: str) -> None:
    with pytest.raises(LabError, match=r"^my:2: has a DOCTYPE that names another document"):
        parse_lab(f'\n<!DOCTYPE Lab {name}>\n<Lab Width="8" Height="4"/>'.encode(encoding), "my")
    assert parse_lab('<!DOCTYPE Lab>\n<Lab Width="8" Height="4"/>'.encode(encoding)).width == 8.0


def test_all_errors_of_a_file_are_told(tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(
        '<Parameters\nObstacleNoise="-1"\nSimTime="x"\nMotorsNoise="inf"\nLineSensorTrueProb="3"/>'
    )
    with pytest.raises(LabError, match=r":2: ObstacleNoise=\"-1\" is below 0"):
        parse_parameters(path.read_bytes(), str(path))
    (checked,) = check_files([path])
    assert [(finding.line, finding.severity) for finding in checked.findings] == [
        (2, "error"),
        (3, "warning"),
        (4, "error"),
        (5, "error"),
    ]
    path.write_text('<Lab Width="8" Height="4">\n<Beacon X="inf"/>\n<Target Y="nan"/></Lab>')
    (checked,) = check_files([path])
    assert [finding.line for finding in checked.findings if finding.severity == "error"] == [2, 3]


@pytest.mark.parametrize(
    "name", ["SimTime", "ReturnTimePenalty", "CompassNoise", "LineSensorTrueProb", "GPS"]
)
@pytest.mark.parametrize(
    "text", ["0", "1", "-1", "1.5", "4294967296", "-2147483648", "", "a", "inf", ".5", "On"]
)
def test_schema_and_reader_agree_on_parameters(name: str, text: str) -> None:
    document = f'<Parameters {name}="{text}"/>'
    try:
        taken = not parse_parameter_file(document.encode()).findings
    except LabError:
        taken = False
    schema = etree.RelaxNG(etree.parse(str(schema_file("parameters"))))
    assert schema.validate(etree.fromstring(document)) is taken


@pytest.mark.skipif(sys.platform == "win32", reason="pipes have no names in the file system there")
def test_a_pipe_is_read_or_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = tmp_path / "pipe_lab.xml"
    os.mkfifo(pipe)
    text = '<Lab Width="8" Height="4"/>' + " " * 200_000  # more than a pipe holds
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert read_file(pipe) == text.encode()
    writer.join()
    monkeypatch.setattr(opening, "PIPE_PATIENCE", 0.01)
    with pytest.raises(UsageError, match=r"a pipe to which nothing is written for 0\.01 seconds"):
        read_file(pipe)
    with pytest.raises(LabError, match="a pipe to which nothing is written"):
        read_run(pipe)
    with pytest.raises(CourseError, match="a pipe to which nothing is written"):
        read_course(pipe)


@pytest.mark.parametrize("options", [["--size", "1000x1000", "--random"], ["--size", "1000x1000"]])
def test_labs_that_nothing_could_read_are_not_made(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "--seed", "1", "-o", str(tmp_path / "big"), *options]) == 2
    assert "--size: 1000x1000 cells" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
