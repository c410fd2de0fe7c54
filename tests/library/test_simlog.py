from __future__ import annotations

import gzip
import itertools
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from ciberrato.errors import LabError, UsageError
from ciberrato.files.lab import read_lab
from ciberrato.files.log_kind import is_simulator_log
from ciberrato.files.simulator_log import LogStream, read_simulator_log
from ciberrato.protocol import Actions
from tests.recordings import OWN

LOG1, LOG2 = (OWN / "logs" / name for name in ("log1_c4_noise_leds", "log2_two_robots"))


def text_of(folder: Path) -> str:
    with gzip.open(folder / "sim.log.gz", "rt") as file:
        return file.read()


@pytest.fixture
def log_file(tmp_path: Path) -> Path:
    return tmp_path / "sim.log"


def test_a_log_of_the_real_simulator_is_read_whole() -> None:
    log = read_simulator_log(LOG2 / "sim.log.gz")
    assert log.complete
    assert log.header.date == "Sun Nov 22 00:44:29 2026"
    assert (log.header.parameters.sim_time, log.header.parameters.compass_sensor) == (400, False)
    assert log.header.n_beacons == 3
    assert log.header.lab == read_lab(LOG2 / "lab.xml")
    assert [(p.x, p.y, p.direction_deg) for p in log.header.grid.positions] == [(5, 7, 0), (7.5, 7.1, 180)]
    assert [record.time for record in log.records] == list(range(401))
    assert log.robot_ids == (1, 2)
    first, last = log.records[0].robot(1), log.records[-1].robot(2)
    assert first is not None
    assert last is not None
    assert first.actions == Actions(left_motor=0.1, right_motor=0.1)
    assert first.measures.infrared == (0.7, 0.2, 0.2, 0.2)
    assert first.measures.start
    assert (last.x, last.y, last.direction_deg) == (0.511708, 4.90044, 83.9256)
    assert (last.score, last.arrival_time, last.collisions, last.visited_mask) == (416, 400, 8, "000")
    assert last.actions is None
    assert not last.measures.start
    assert log.records[0].robot(3) is None


def test_all_sensors_and_leds_are_read() -> None:
    log = read_simulator_log(LOG1 / "sim.log.gz")
    robot = log.records[120].robots[0]
    assert robot.actions is None, "a lone VisitingLed leaves no Action"
    assert robot.measures.visiting_led
    assert [reading.bearing for reading in robot.measures.beacons] == [156.0, None, None, None]
    assert robot.measures.gps == (851.9, 404.7)
    assert robot.measures.compass == 20.0
    assert log.records[300].robots[0].actions == Actions(end_led=True)
    assert log.records[-1].robots[0].state == "Finished"


def test_scores_below_zero_are_read_back(log_file: Path) -> None:
    log_file.write_text(text_of(LOG2).replace('Score="402"', 'Score="4294967291"'))
    assert {robot.score for record in read_simulator_log(log_file).records for robot in record.robots} >= {-5}


def test_a_log_that_ends_early_is_read_as_far_as_it_goes(log_file: Path) -> None:
    text = text_of(LOG2)
    middle = text.index('<LogInfo Time="7">') + 100
    log_file.write_text(text[:middle])
    log = read_simulator_log(log_file)
    assert not log.complete
    assert [record.time for record in log.records] == list(range(7))


def test_names_in_latin_1_and_in_utf_8_are_read(log_file: Path) -> None:
    text = text_of(LOG2)
    for encoding in ("latin-1", "utf-8"):
        # Enough of them that one falls on the border of two pieces.
        log_file.write_bytes(text.replace('Name="bot1"', 'Name="João é"').encode(encoding))
        names = {record.robots[0].name for record in read_simulator_log(log_file).records}
        assert names == {"João é"}


def test_records_come_one_by_one_in_constant_memory(log_file: Path) -> None:
    text = text_of(LOG2)
    head, tail = text.index("<LogInfo"), text.index("</Log>")
    with log_file.open("w") as file:
        file.write(text[:head])
        for _ in range(5):
            file.write(text[head:tail])
        file.write(text[tail:])
    assert log_file.stat().st_size > 2_500_000
    tracemalloc.start()
    try:
        stream = LogStream(log_file)
        assert stream.header.lab.name == "Open"
        assert sum(1 for _ in stream) == 5 * 401
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert stream.complete
    assert peak < 1_000_000


@pytest.mark.parametrize(
    ("change", "line", "problem"),
    [
        (lambda text: text.replace('Time="3">', 'Time="x">', 1), 143, "LogInfo Time: 'x' is not an integer"),
        (lambda text: text.replace("<Pos ", "<Place ", 1), 41, "element Pos is missing"),
        (lambda text: text.replace("</LogInfo>", "</Info>", 1), 74, "</LogInfo> of line 41 is due"),
        (lambda text: text + "<Log/>", None, "something follows the end"),
        (lambda text: "<Lab/>", 1, "begins with Lab"),
        (lambda text: "", 1, "has no Parameters"),
        (lambda text: '<Log Date="x"/>', 1, "has no Parameters"),
        (lambda text: "<!DOCTYPE Log>" + text, 1, "document type"),
        (lambda text: text.replace('SimTime="400"', 'SimTime="long"', 1), None, "SimTime"),
        (
            lambda text: text.replace("<Robot ", "<Robot>" + "<a>" * 20 + "<Robot ", 1),
            42,
            "nested too deeply",
        ),
    ],
    ids=itertools.count(),
)
def test_what_is_no_log_is_refused_with_its_line(
    log_file: Path, change: Callable[[str], str], line: int | None, problem: str
) -> None:
    log_file.write_text(change(text_of(LOG2)))
    with pytest.raises(LabError) as caught:
        read_simulator_log(log_file)
    assert problem in str(caught.value)
    assert str(caught.value).startswith(str(log_file))
    assert "\n" not in str(caught.value)
    if line is not None:
        assert caught.value.line == line


def test_a_file_that_cannot_be_read_is_an_error_of_use(tmp_path: Path) -> None:
    broken = tmp_path / "sim.log.gz"
    broken.write_bytes(gzip.compress(b"<Log>")[:12])
    damaged = tmp_path / "damaged.log.gz"  # the lengths of its block do not fit together
    damaged.write_bytes(b"\x1f\x8b\x08\0\0\0\0\0\0\x03" + b"\x00\x01\x02\x03\x04<Log>")
    for path in (tmp_path / "none.log", tmp_path, broken, damaged):
        with pytest.raises(UsageError, match=str(path)):
            read_simulator_log(path)
    with pytest.raises(LabError, match=r"invalid stored block lengths"):
        is_simulator_log(damaged)
