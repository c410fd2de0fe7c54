"""`Robot` and `ciberrato.croblink` on what the real simulator sent, byte for byte.

The recorded sessions are those of a Python agent of the course. Their datagrams are sent to our clients, one
after each message of theirs, and what the clients make of them is held against another XML parser.
"""

import base64
import json
import socket
import threading
from pathlib import Path
from xml.etree import ElementTree

import pytest

from ciberrato import Robot, croblink
from ciberrato.client.errors import SilenceError
from tests.client.conftest import PATIENCE, until_silent

SESSIONS = sorted((Path(__file__).parents[1] / "data" / "golden" / "seed_runs").glob("*/datagrams.jsonl"))
MOST = 300
"""Measures of a session that are played."""


class Player(threading.Thread):
    """Plays the simulator's side of a recorded session; notes what the client sent."""

    def __init__(self, path):
        super().__init__(daemon=True)
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        sent = [base64.b64decode(line["bytes"]) for line in lines if line["from"] == "simulator"]
        self.reply, *rest = sent
        self.measures = [data for data in rest if data.startswith(b"<Measures")][:MOST]
        self.recorded_registration = base64.b64decode(lines[0]["bytes"])
        self.heard = []
        self._main, self._robot = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for one in (self._main, self._robot):
            one.bind(("127.0.0.1", 0))
            one.settimeout(PATIENCE)
        self.host = f"127.0.0.1:{self._main.getsockname()[1]}"

    def run(self):
        registration, peer = self._main.recvfrom(2048)
        self.heard.append(registration)
        self._robot.sendto(self.reply, peer)
        for data in self.measures:
            self._robot.sendto(data, peer)
            self.heard.append(self._robot.recvfrom(2048)[0])

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.join(PATIENCE)
        self._main.close()
        self._robot.close()


def parsed(data):
    """Time, button, compass and readings of a recorded message, by ElementTree."""
    root = ElementTree.fromstring(data.rstrip(b"\0"))
    readings = {int(one.get("Id")): float(one.get("Value")) for one in root.iter("IRSensor")}
    return (
        int(root.get("Time")),
        root.find("Buttons").get("Start") == "On",
        float(root.find("Sensors").get("Compass")),
        [readings[sensor] for sensor in range(4)],
    )


def position_of(path):
    """Start position of a session, the last figure of its name."""
    return int(path.parent.name[-1])


def angles_in(registration):
    return [(one.get("Id"), float(one.get("Angle"))) for one in registration.iter("IRSensor")]


def test_there_are_sessions():
    assert len(SESSIONS) == 3


@pytest.mark.parametrize("path", SESSIONS, ids=lambda path: path.parent.name)
def test_robot_sees_what_was_recorded(path):
    seen = []
    with Player(path) as player:
        wanted = [parsed(data) for data in player.measures]
        assert wanted[-1][1]
        robot = Robot("pClient1", player.host, position=1, angles=(0, 90, -90, 180), timeout=PATIENCE)
        with pytest.raises(SilenceError, match="after time"), robot:
            seen += (
                (measures.time, measures.start, measures.compass, list(measures.infrared))
                for measures in until_silent(robot, wanted[-1][0])
            )
    assert seen == [one for one in wanted if one[1]]
    # One message a cycle; with motors 0 while the recorded simulator did not run.
    assert len(player.heard) == 1 + len(wanted)
    for data, (_, running, *_) in zip(player.heard[1:], wanted, strict=True):
        motors = ElementTree.fromstring(data.rstrip(b"\0")).attrib
        assert running or (float(motors["LeftMotor"]), float(motors["RightMotor"])) == (0.0, 0.0)


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("path", SESSIONS, ids=lambda path: path.parent.name)
def test_the_drop_in_sees_what_was_recorded_and_registers_alike(path):
    with Player(path) as player:
        robot = croblink.CRobLinkAngs("pClient1", position_of(path), [0.0, 90.0, -90.0, 180.0], player.host)
        assert (robot.status, robot.nBeacons, robot.simTime) == (0, 1, 5000)
        for data in player.measures:
            robot.readSensors()
            measures = robot.measures
            seen = (measures.time, measures.start, measures.compass, measures.irSensor)
            assert seen == parsed(data)
            robot.driveMotors(0.1, 0.1)
        robot.sock.close()
    ours, theirs = (
        ElementTree.fromstring(data.rstrip(b"\0")) for data in (player.heard[0], player.recorded_registration)
    )
    assert (ours.tag, ours.attrib) == (theirs.tag, theirs.attrib)
    assert angles_in(ours) == angles_in(theirs)
