"""The simulator serves clients as strict as the real ones, on real sockets."""

from __future__ import annotations

import contextlib
import importlib.util
import threading
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from simulator_stub.assembly import build_server
from simulator_stub.options import parse_arguments
from simulator_stub.service.pace import IDLE_LIMIT


def _load() -> ModuleType:
    path = Path(__file__).with_name("strict_client.py")
    spec = importlib.util.spec_from_file_location("strict_client", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


strict = _load()
EVERYTHING = (
    '<Parameters SimTime="60" CycleTime="10" GPS="On" BeaconSensor="On" ScoreSensor="On"'
    ' CollisionWallPenalty="5"/>'
)


@contextlib.contextmanager
def serving(parameters: Path, *arguments: str) -> Iterator[int]:
    lines: list[str] = []
    options = parse_arguments(
        ["--bind", "127.0.0.1", "--port", "0", "--seed", "1", "--param", str(parameters), *arguments]
    )
    server = build_server(options, print_line=lines.append, notify=lambda line: None)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield int(lines[1].rsplit(":", 1)[1])
    finally:
        server.stop()
        thread.join(300.0)
        server.close()


@pytest.fixture
def parameters(tmp_path: Path) -> Path:
    path = tmp_path / "everything.xml"
    path.write_text(EVERYTHING)
    return path


@pytest.mark.parametrize("style", ["python", "java", "c++"])
def test_a_strict_robot_drives_a_whole_run(style: str, parameters: Path) -> None:
    with serving(parameters, "--lab", "standard", "--grid", "standard") as port:
        robot = strict.StrictRobot(port, style=style)
        viewer = strict.StrictViewer(port)
        assert robot.accepted
        assert robot.sim_time == 60
        first = robot.read()
        assert (first["time"], first["start"], first["stop"]) == (0, False, True)
        viewer.read_status()
        viewer.read_world()
        assert viewer.positions >= 1
        viewer.send("<Start/>")
        times: list[object] = []
        states = set()
        while not (first["stop"] is False and first["start"] is False):
            first = robot.read()
            assert set(first["infrared"]) == {0, 1, 2, 3}
            assert {"Compass", "Collision", "Ground", "line", "gps", "score"} <= set(first)
            assert len(first["beacons"]) == robot.beacons > 0
            times.append(first["time"])
            states.add(viewer.read_status()["state"])
            if first["start"]:
                # LEDs stop the motors: the command to move comes after them.
                robot.act('<Actions LeftMotor="0.0" RightMotor="0.0" VisitingLed="Off"/>')
                robot.act('<Actions LeftMotor="0.1" RightMotor="0.09"/>')
        assert sorted(set(times)) == list(range(61)), "no cycle is skipped"
        assert states == {"Stopped", "Running"}
        robot.close()
        viewer.close()


def test_the_second_robot_on_a_place_is_refused_in_words(parameters: Path) -> None:
    with serving(parameters) as port:
        robot = strict.StrictRobot(port)
        other = strict.StrictRobot(port)
        assert (robot.accepted, other.accepted) == (True, False)
        robot.close()
        other.close()


def test_before_the_start_a_silent_robot_keeps_no_other_waiting(tmp_path: Path) -> None:
    slow = tmp_path / "slow.xml"
    slow.write_text('<Parameters CycleTime="400"/>')
    # In lockstep, where others may keep the simulator waiting, but not as long as a client waits.
    assert IDLE_LIMIT + 0.4 < strict.TIME_LIMIT
    with serving(slow, "--lockstep", "--grid", "3,3,0;5,5,0", "--answer-limit", "inf") as port:
        silent = strict.StrictRobot(port, position=1)
        robot = strict.StrictRobot(port, position=2)
        for _ in range(4):
            robot.read()
        silent.close()
        robot.close()


def test_the_longest_reply_and_measures_fit_into_the_clients_buffers(tmp_path: Path) -> None:
    folder = tmp_path / ("long" * 50)
    folder.mkdir()
    lab, grid = folder / ("lab" * 60 + ".xml"), folder / ("grid" * 60 + ".xml")
    beacons = "".join(f'<Beacon X="{x}" Y="9" Height="5"/><Target X="{x}" Y="9"/>' for x in range(1, 25))
    lab.write_text(f'<Lab Name="many" Height="14" Width="28">{beacons}</Lab>')
    grid.write_text("<Grid>" + '<Position X="3" Y="3"/>' * 5 + "</Grid>")
    parameters = tmp_path / "p.xml"
    parameters.write_text(EVERYTHING)
    with serving(parameters, "--lab", str(lab), "--grid", str(grid)) as port:
        robots = [strict.StrictRobot(port, position=number) for number in range(1, 6)]
        for robot in robots:
            robot.act(f"<Actions><Say><![CDATA[{'x' * 100}]]></Say></Actions>")
        for robot in robots:
            for _ in range(4):
                assert len(robot.read()["beacons"]) == 24
            robot.close()


def test_names_and_messages_that_would_break_xml_arrive_whole(parameters: Path) -> None:
    with serving(parameters) as port:
        viewer = strict.StrictViewer(port)
        robot = strict.StrictRobot(port, name="&lt;a&amp;&quot;é")
        robot.act("<Actions><Say>]]&gt; &lt;/Measures&gt; é</Say></Actions>")
        heard = None
        while heard is None:
            heard = robot.read().get("heard")
        assert heard == "]]> </Measures> é"
        status = viewer.read()
        assert status.attrib["Name"] == '<a&"é'
        robot.close()
        viewer.close()


def test_after_a_reset_the_viewer_has_to_come_again(parameters: Path) -> None:
    with serving(parameters) as port:
        viewer = strict.StrictViewer(port)
        robot = strict.StrictRobot(port)
        robot.read()
        viewer.send("<Reset/>")
        while viewer.read().tag != "Restart":
            pass
        viewer.close()
        again = strict.StrictViewer(port)
        robot.close()
        fresh = strict.StrictRobot(port)
        assert fresh.accepted
        assert fresh.read()["time"] == 0
        again.read_status()
        again.read_world()
        assert again.read_status()["pose"] == (9.0, 3.0, 0.0)
        fresh.close()
        again.close()
