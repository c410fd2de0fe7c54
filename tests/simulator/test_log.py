from __future__ import annotations

import gzip
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.conformance import logs
from ciberrato.errors import UsageError
from ciberrato.files.simulator_log import read_simulator_log
from ciberrato.protocol import Actions, RobotRegistration, ViewRegistration, encode
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.recording.log import LogFile
from simulator_stub.service.session import Session
from simulator_stub.simulation import Simulation
from tests.recordings import GOLDEN, OWN, needs

DATE = "Thu Jan  1 00:00:00 1970"


@pytest.mark.parametrize(
    "golden", [pytest.param(OWN, id="own"), pytest.param(GOLDEN, id="all", marks=needs("CIBERRATO_GOLDEN"))]
)
def test_the_real_simulators_logs_come_out_again(golden: Path) -> None:
    rows = list(logs.rows(golden, None))
    assert rows
    assert [row.note for row in rows if not row.passed or not row.cases] == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('Collisions="1"', 'Collisions="2"'),
        ("0.1", "0.11"),
        ("</Log>\n", "</Log>"),
        ('Start="Off"', 'Start="On"'),
    ],
)
def test_the_comparison_notices_a_difference(tmp_path: Path, old: str, new: str) -> None:
    folder = tmp_path / "logs/log2_two_robots"
    shutil.copytree(OWN / "logs/log2_two_robots", folder)
    with gzip.open(folder / "sim.log.gz", "rt") as file:
        text = file.read()
    place = text.rindex(old)
    (folder / "sim.log.gz").write_bytes(
        gzip.compress((text[:place] + new + text[place + len(old) :]).encode())
    )
    (row,) = logs.rows(tmp_path, None)
    assert not row.passed
    assert row.note.startswith("line ")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.log"


@pytest.fixture
def session(open_lab: Lab, three_places: StartGrid, path: Path) -> Iterator[Session]:
    parameters = replace(Parameters(), sim_time=5, cycle_time=1, gps=True, compass_requestable=True)
    simulation = Simulation(open_lab, three_places, parameters, seed=3)
    session = Session(simulation, autostart=2, observers=[LogFile(path, DATE)])
    yield session
    session.close()


def test_a_log_holds_every_running_cycle_and_the_end(session, newcomer, path: Path) -> None:  # type: ignore[no-untyped-def]
    robots = [newcomer(), newcomer()]
    for robot, name in zip(robots, ("one", "two <&> é"), strict=True):
        session.welcome(robot, encode(RobotRegistration(name=name)))
    session.cycle()
    session.cycle()
    assert path.read_text() == "", "nothing has happened yet"
    poses = []
    for cycle in range(5):
        if cycle == 1:
            robots[0].peer.deliver(encode(Actions(left_motor=9.0, right_motor=-0.05, say="hm")))
            robots[1].peer.deliver(encode(Actions(visiting_led=True)))
        if cycle == 3:
            robots[0].peer.deliver(encode(Actions(end_led=True, visiting_led=False)))
        poses.append([(robot.x, robot.y) for robot in session.simulation.robots])
        session.cycle()
    session.cycle()
    poses.append([(robot.x, robot.y) for robot in session.simulation.robots])
    log = read_simulator_log(path)  # written to the end, though the simulator goes on
    assert log.complete
    assert log.header.date == DATE
    parameters = session.simulation.world.parameters
    assert log.header.parameters == replace(parameters, beacon_aperture=3.141593)
    assert log.header.grid == session.simulation.world.grid
    assert [record.time for record in log.records] == [0, 1, 2, 3, 4, 5]
    for record, places in zip(log.records, poses, strict=True):
        assert [robot.x for robot in record.robots] == pytest.approx([x for x, _ in places], rel=1e-5)
    one = [record.robots[0] for record in log.records]
    two = [record.robots[1] for record in log.records]
    assert (one[0].name, two[0].name) == ("one", "two <&> é")
    assert [robot.actions for robot in one] == [
        None,
        Actions(left_motor=0.15, right_motor=-0.05),
        None,
        Actions(end_led=True, visiting_led=False),
        None,
        None,
    ]
    assert [robot.actions for robot in two] == [None] * 6, "a lone VisitingLed leaves nothing"
    assert [robot.measures.visiting_led for robot in two] == [False] + [True] * 5
    assert all(robot.measures.compass is not None for robot in one), "asked for or not"
    assert [robot.measures.start for robot in one] == [True] * 5 + [False]
    assert [robot.state for robot in one] == ["Running"] * 4 + ["Finished"] * 2


def test_a_pause_leaves_nothing_in_the_log_and_a_reset_begins_another(session, newcomer, path: Path) -> None:  # type: ignore[no-untyped-def]
    def begin() -> None:
        for registration in (RobotRegistration(), RobotRegistration(), ViewRegistration()):
            client = newcomer()
            session.welcome(client, encode(registration))
        session.cycle()
        session.cycle()

    begin()
    session.cycle()
    session.simulation.stop()
    for _ in range(5):
        session.cycle()
    session.simulation.start()
    session.cycle()
    session.cycle()
    session.views[0].peer.deliver(b"<Reset/>")
    session.cycle()
    log = read_simulator_log(path)
    assert log.complete
    assert [record.time for record in log.records] == [0, 1, 2, 3]
    assert not path.with_name("run-2.log").exists()
    begin()
    session.cycle()
    session.close()
    second = read_simulator_log(path.with_name("run-2.log"))
    assert [record.time for record in second.records] == [0]
    assert second.complete, "closing finishes it"
    assert [record.time for record in read_simulator_log(path).records] == [0, 1, 2, 3]


def test_a_file_that_cannot_be_written_is_an_error_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"none/run\.log: cannot be written"):
        LogFile(tmp_path / "none/run.log", DATE)
