"""`ciberrato.croblink` as agents use it."""

import re
import socket
import subprocess
import sys
import textwrap
import threading
from dataclasses import replace

import pytest

from ciberrato import croblink
from ciberrato.errors import UsageError
from ciberrato.files.run_log import read_run
from ciberrato.protocol import Acceptance, BeaconReading, HeardMessage, Measures, ScoreReading, encode
from ciberrato.world.parameters import Parameters
from tests.client.conftest import PATIENCE, simulator

# As the course's agents are written: a star import, a subclass with a constructor of its own, a loop that
# ends with the program.
AGENT = """
import sys
from ciberrato.croblink import *

class MyRob(CRobLinkAngs):
    def __init__(self, rob_name, rob_id, angles, host):
        CRobLinkAngs.__init__(self, rob_name, rob_id, angles, host)

    def run(self):
        if self.status != 0:
            print("Connection refused or error")
            quit()
        while True:
            self.readSensors()
            if self.measures.endLed:
                print(self.robName + " exiting", self.measures.time, self.measures.compassReady)
                quit()
            if not self.measures.start:
                self.driveMotors(0.0, 0.0)
                continue
            if self.measures.time == 20:
                self.finish()
            elif self.measures.irSensor[0] > 2:
                self.driveMotors(-0.1, 0.1)
            else:
                self.driveMotors(0.1, 0.1)

MyRob("pClient1", int(sys.argv[2]), [0.0, 60.0, -60.0, 180.0], sys.argv[1]).run()
"""


def run(path, host, position="1", **environment):
    words = [sys.executable, str(path), host, position]
    return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, check=False, **environment)


@pytest.fixture
def agent(tmp_path):
    path = tmp_path / "main_rob.py"
    path.write_text(AGENT)
    return path


def test_an_agent_runs_with_one_import_changed(tmp_path, agent, monkeypatch):
    monkeypatch.setenv("CIBERRATO_LOG", str(tmp_path / "run.jsonl"))
    with simulator("--lab", "maze", "--grid", "maze", "--autostart", "1", "--lockstep") as host:
        done = run(agent, host)
    assert (done.stdout, done.stderr, done.returncode) == ("pClient1 exiting 21 True\n", "", 0)
    cycles = read_run(tmp_path / "run.jsonl").cycles
    assert [cycle.time for cycle in cycles if cycle.start] == list(range(21))


def test_a_refused_agent_sees_its_status(agent):
    with simulator("--lab", "maze", "--grid", "maze") as host:
        done = run(agent, host, position="99")
    assert (done.stdout, done.returncode) == ("Connection refused or error\n", 0)


def test_nobody_there_raises_what_a_socket_would(monkeypatch):
    monkeypatch.setattr(croblink, "_SECONDS", 0.2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        with pytest.raises(socket.timeout, match="start one"):
            croblink.CRobLink("r", 1, f"127.0.0.1:{deaf.getsockname()[1]}")


def read_on(robot):
    for _ in range(1000):
        robot.readSensors()


@pytest.mark.usefixtures("patient")
def test_silence_ends_the_program(monkeypatch, capsys):
    with simulator("--lab", "maze", "--grid", "maze") as host:
        robot = croblink.CRobLinkAngs("r", 1, [0, 60, -60, 180], host)
        robot.readSensors()
    monkeypatch.setattr(croblink, "_SECONDS", 0.3)
    with pytest.raises(SystemExit) as ended:
        read_on(robot)
    robot.sock.close()
    assert ended.value.code == 1
    assert re.match(r"r: no Measures from the simulator for 0\.3 s \(last time 0\)", capsys.readouterr().err)


@pytest.mark.usefixtures("patient")
def test_silence_after_the_last_cycle_is_the_end_of_the_run(tmp_path, monkeypatch, capsys):
    (tmp_path / "p.xml").write_text('<Parameters SimTime="3"/>')
    words = ("--param", str(tmp_path / "p.xml"), "--autostart", "1", "--exit-at-end")
    with simulator("--lab", "maze", "--grid", "maze", *words) as host:
        robot = croblink.CRobLinkAngs("r", 1, [0, 60, -60, 180], host)
        while robot.measures.time < 3:
            robot.readSensors()
        monkeypatch.setattr(croblink, "_SECONDS", 0.3)
        with pytest.raises(SystemExit) as ended:
            read_on(robot)
    robot.sock.close()
    assert ended.value.code == 0
    assert capsys.readouterr().err == "r: the run is over (time 3)\n"


def test_the_names_and_their_first_values():
    first = croblink.CMeasures()
    assert (first.compassReady, first.compass, first.time, first.ground) == (False, 0.0, 0, -1)
    assert (first.irSensorReady, first.irSensor) == ([False] * 4, [0.0] * 4)
    assert (first.beaconReady, first.beacon, first.hearMessage) == ([], [], "")
    assert (first.score, first.arrivalTime, first.returningTime, first.collisions) == (
        100000,
        10000,
        10000,
        0,
    )
    assert (first.x, first.y, first.dir, first.gpsReady, first.gpsDirReady) == (0.0, 0.0, 0.0, False, False)
    assert not any((first.start, first.stop, first.endLed, first.returningLed, first.visitingLed))
    assert (croblink.NUM_IR_SENSORS, croblink.NUM_LINE_ELEMENTS, croblink.UDP_PORT) == (4, 7, 6000)


def test_readings_under_their_names():
    measures = Measures(
        time=9,
        start=True,
        compass=-12.0,
        ground=1,
        collision=True,
        infrared=(1.5, None, 0.4, 2.0),
        beacons=(BeaconReading(beacon=0, bearing=None), BeaconReading(beacon=1, bearing=-30.0)),
        gps=(3.5, 4.5),
        line="0011100",
        messages=(HeardMessage(sender=2, text="hello"), HeardMessage(sender=1, text="myself")),
        score=ScoreReading(score=-3, arrival_time=5, collisions=2),
    )
    taken = croblink.CMeasures.from_measures(measures, n_beacons=2, own_id=1)
    assert (taken.time, taken.start, taken.compass, taken.compassReady) == (9, True, -12.0, True)
    assert (taken.irSensorReady, taken.irSensor) == ([True, False, True, True], [1.5, 0.0, 0.4, 2.0])
    assert taken.beacon == [(False, 0.0), (True, -30.0)]
    assert (taken.gpsReady, taken.x, taken.y) == (True, 3.5, 4.5)
    assert taken.lineSensor == ["0", "0", "1", "1", "1", "0", "0"]
    assert taken.hearMessage == "hello"
    assert (taken.score, taken.arrivalTime, taken.collisions) == (-3, 5, 2)
    bare = croblink.CMeasures.from_measures(
        replace(measures, compass=None, line=None, beacons=()), n_beacons=1
    )
    assert (bare.compassReady, bare.lineSensorReady, bare.beacon) == (False, False, [(False, 0.0)])


def test_both_spellings_are_one():
    for camel, snake in [
        ("readSensors", "read_sensors"),
        ("syncRobot", "sync_robot"),
        ("driveMotors", "drive_motors"),
        ("setReturningLed", "set_returning_led"),
        ("setVisitingLed", "set_visiting_led"),
    ]:
        assert getattr(croblink.CRobLink, camel) is getattr(croblink.CRobLink, snake)


def test_the_star_import_brings_the_constants_and_the_classes():
    names = {}
    exec(textwrap.dedent("from ciberrato.croblink import *"), names)
    assert {"CRobLink", "CRobLinkAngs", "CMeasures", "NUM_IR_SENSORS", "UDP_IP", "UDP_PORT"} <= set(names)


class Peer(threading.Thread):
    """A simulator over UDP: a Reply, then some datagrams."""

    def __init__(self, *datagrams):
        super().__init__(daemon=True)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(PATIENCE)
        self._datagrams = (encode(Acceptance(parameters=Parameters())), *datagrams)
        self.host = f"127.0.0.1:{self._socket.getsockname()[1]}"

    def run(self):
        _, peer = self._socket.recvfrom(2048)
        for data in self._datagrams:
            self._socket.sendto(data, peer)

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.join(PATIENCE)
        self._socket.close()


@pytest.mark.usefixtures("patient")
def test_a_broken_message_does_not_end_the_agent():
    with Peer(b"<Measures", b"", encode(Measures(time=4, start=True))) as peer:
        robot = croblink.CRobLink("r2", 1, peer.host)
        robot.readSensors()
        assert robot.measures.time == 4
        robot.sock.close()


def test_a_log_that_cannot_be_written_is_told_before_registering(tmp_path, monkeypatch):
    monkeypatch.setenv(croblink.LOG_VARIABLE, str(tmp_path / "none" / "run.jsonl"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.setblocking(False)
        with pytest.raises(UsageError, match="cannot be written"):
            croblink.CRobLink("r2", 1, f"127.0.0.1:{peer.getsockname()[1]}")
        with pytest.raises(BlockingIOError):
            peer.recv(2048)


@pytest.mark.usefixtures("patient")
def test_a_message_that_a_newer_one_has_overtaken_is_not_read():
    peer, main = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with peer, main:
        for one in (peer, main):
            one.bind(("127.0.0.1", 0))
            one.settimeout(PATIENCE)
        answer = threading.Thread(target=accept, args=(main, peer, [5, 7, 6, 8, *[0] * 10]))
        answer.start()
        robot = croblink.CRobLink("r", 1, f"127.0.0.1:{main.getsockname()[1]}")
        answer.join()
        times = []
        while not times or times[-1]:
            robot.readSensors()
            times.append(robot.measures.time)
        robot.sock.close()
    assert 6 not in times
    assert times[-1] == 0  # a new run


def accept(main, peer, times):
    _, client = main.recvfrom(2048)
    peer.sendto(encode(Acceptance(parameters=Parameters())), client)
    for time in times:
        peer.sendto(encode(Measures(time=time, start=True)), client)
