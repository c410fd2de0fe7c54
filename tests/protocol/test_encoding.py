"""The bytes that we send."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ciberrato.errors import UsageError
from ciberrato.protocol import (
    Acceptance,
    Actions,
    GridRequest,
    HeardMessage,
    LabRequest,
    Measures,
    PanelRegistration,
    Refusal,
    Registration,
    RemoveRobot,
    Reset,
    Restart,
    RobotBeaconRegistration,
    RobotRegistration,
    RobotStatus,
    Start,
    Stop,
    ViewRegistration,
    decode_simulator_message,
    encode,
    fit_reply,
    grid_to_xml,
    lab_to_xml,
    measures_to_xml,
)
from ciberrato.protocol.registrations import encode_registration
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (RobotRegistration(name="x", robot_id=3), b'<Robot Id="3" Name="x"/>\0'),
        (RobotRegistration(), b'<Robot Id="0"/>\0'),
        (
            RobotRegistration(name="x", robot_id=1, sensor_angles=((0, 0.0), (1, 90.0))),
            b'<Robot Id="1" Name="x"><IRSensor Id="0" Angle="0.0"/><IRSensor Id="1" Angle="90.0"/></Robot>\0',
        ),
        (RobotRegistration(name='<a&"b\n'), b'<Robot Id="0" Name="&lt;a&amp;&quot;b&#10;"/>\0'),
        (RobotRegistration(name="ç"), b'<Robot Id="0" Name="\xc3\xa7"/>\0'),
        (
            RobotBeaconRegistration(name="b", robot_id=2, height=4.0),
            b'<RobotBeacon Id="2" Name="b" Height="4.0"/>\0',
        ),
        (ViewRegistration(), b"<View/>\0"),
        (PanelRegistration(), b"<Panel/>\0"),
        (Actions(left_motor=0.1, right_motor=0.1), b'<Actions LeftMotor="0.1" RightMotor="0.1"/>\0'),
        (Actions(), b"<Actions/>\0"),
        (
            Actions(left_motor=0.0, end_led=True, returning_led=False, visiting_led=True, reset=True),
            b'<Actions LeftMotor="0.0" EndLed="On" ReturningLed="Off" VisitingLed="On" Reset="On"/>\0',
        ),
        (
            Actions(requests=("Compass", "Beacon0"), say="hi"),
            b'<Actions><SensorRequests Compass="Yes" Beacon0="Yes"/><Say><![CDATA[hi]]></Say></Actions>\0',
        ),
        (
            Actions(requests=("GPS", "Ground", "GPS")),
            b'<Actions><SensorRequests GPS="Yes" Ground="Yes"/><SensorRequests GPS="Yes"/></Actions>\0',
        ),
        (Actions(say="a]]>b"), b"<Actions><Say><![CDATA[a]]]]><![CDATA[>b]]></Say></Actions>\0"),
        (LabRequest(), b"<LabReq/>\0"),
        (GridRequest(), b"<GridReq/>\0"),
        (Start(), b"<Start/>\0"),
        (Stop(), b"<Stop/>\0"),
        (Reset(), b"<Reset/>\0"),
        (RemoveRobot(robot_id=2), b'<Robot Id="2" Removed="Yes"/>\0'),
        (Refusal(), b'<Reply Status="Refused"></Reply>\n\0'),
        (Restart(), b"<Restart/>\0"),
        (
            StartGrid(positions=(GridPosition(x=9.0, y=3.0, direction_deg=-0.0),)),
            b'<Grid>\n\t<Position X="9" Y="3" Dir="-0"/>\n</Grid>\n\0',
        ),
        (
            RobotStatus(
                name="<x>", robot_id=1, time=4, score=-5, x=1e-5, y=1234567.0, direction_deg=math.inf
            ),
            b'<Robot Name="&lt;x&gt;" Id="1" Time="4" Score="4294967291" ArrivalTime="0" ReturningTime="0"'
            b' Collisions="0" Collision="False" VisitedMask="" State="Stopped">\n'
            b'\t<Position X="1e-05" Y="1.23457e+06" Dir="inf"/>\n</Robot>\n\0',
        ),
        (
            Lab(
                name="L",
                width=28.0,
                height=14.0,
                beacons=(Beacon(x=25.0, y=7.0, height=4.0),),
                targets=(Target(x=25.0, y=7.0, radius=1.0),),
                walls=(Wall(height=0.0, corners=((1.9, 12.0), (2.1, 12.0))),),
            ),
            b'<Lab Name="L" Height="14" Width="28">\n\t<Beacon X="25" Y="7" Height="4"/>\n'
            b'\t<Target X="25" Y="7" Radius="1"/>\n\t<Wall Height="0">\n\t\t<Corner X="1.9" Y="12"/>\n'
            b'\t\t<Corner X="2.1" Y="12"/>\n\t</Wall>\n</Lab>\n\0',
        ),
        (
            Measures(time=0, stop=True),
            b'<Measures Time="0">\n\t<Sensors>\n\t</Sensors>\n'
            b'\t<Leds EndLed="Off" ReturningLed="Off" VisitingLed="Off"/>\n'
            b'\t<Buttons Start="Off" Stop="On"/>\n</Measures>\n\0',
        ),
    ],
)
def test_the_bytes_of_each_message(message, expected):
    assert encode(message) == expected
    if isinstance(message, Registration):
        assert encode_registration(message) == expected


def test_numbers_may_be_numpys():
    plain = Measures(
        time=3, collision=True, compass=12.0, ground=-1, infrared=(0.1, 2.0, 3.3, 100.0), line="0" * 7
    )
    odd = Measures(
        time=np.uint32(3),
        collision=np.bool_(True),
        compass=np.float32(12.0),
        ground=np.int64(-1),
        infrared=tuple(np.array([0.1, 2.0, 3.3, 100.0])),
        line="0" * 7,
    )
    assert encode(odd) == encode(plain)
    assert encode(Actions(left_motor=np.float64(0.1), end_led=np.bool_(True))) == (
        b'<Actions LeftMotor="0.1" EndLed="On"/>\0'
    )
    assert encode(
        RobotRegistration(robot_id=np.int64(1), sensor_angles=((np.int8(0), np.float64(90.0)),))
    ) == (b'<Robot Id="1"><IRSensor Id="0" Angle="90.0"/></Robot>\0')


def test_motor_commands_are_written_to_the_last_bit():
    assert encode(Actions(left_motor=0.1 + 2**-55)) == b'<Actions LeftMotor="0.10000000000000003"/>\0'


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (RobotRegistration(name="a\x07b"), "Robot Name: character U+0007"),
        (RobotRegistration(name="\udce7"), "Robot Name: character U+DCE7"),
        (RobotRegistration(name="a\0b"), "Robot Name: character U+0000"),
        (RobotRegistration(sensor_angles=((0, math.nan),)), "IRSensor Angle"),
        (RobotBeaconRegistration(height=math.inf), "RobotBeacon Height"),
        (Actions(left_motor=math.nan), "Actions LeftMotor"),
        (Actions(right_motor=math.nan), "Actions RightMotor"),
        (Actions(say="\x1b[0m"), "Say: character U+001B"),
        (Actions(requests=('GPS="Yes" x',)), "SensorRequests"),
        (Actions(requests=("",)), "SensorRequests"),
        (Measures(time=1, messages=(HeardMessage(sender=1, text="￾"),)), "Message: character U+FFFE"),
        (RobotStatus(name="\x01", robot_id=1), "Robot Name: character U+0001"),
        (Lab(name="\x02"), "Lab Name: character U+0002"),
        (Acceptance(parameters=Parameters(lab_file="\x03")), "Parameters Lab: character U+0003"),
    ],
)
def test_what_cannot_be_sent_is_refused(message, complaint):
    with pytest.raises(UsageError) as caught:
        encode(message)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    ("longest", "too_long", "element"),
    [
        (RobotRegistration(name="n" * 1000), RobotRegistration(name="n" * 1001), "Robot"),
        (RobotRegistration(name="é" * 500), RobotRegistration(name="é" * 501), "Robot"),
        (RobotBeaconRegistration(name="n" * 981), RobotBeaconRegistration(name="n" * 982), "RobotBeacon"),
        (Actions(say="s" * 981), Actions(say="s" * 982), "Actions"),
    ],
)
def test_what_a_simulator_would_not_read_to_the_end_is_refused(longest, too_long, element):
    assert len(encode(longest)) == 1024, "1023 bytes count, the NUL behind them does not"
    with pytest.raises(UsageError, match=rf"^{element}: 102[45] bytes are too many"):
        encode(too_long)


def test_what_is_no_message_is_a_type_error():
    with pytest.raises(TypeError, match="str is not a message"):
        encode("<View/>")


def test_a_reply_that_is_too_long_for_the_clients_loses_folders_then_names():
    def reply(lab_file, grid_file):
        return Acceptance(parameters=Parameters(lab_file=lab_file, grid_file=grid_file), n_beacons=1)

    short = reply("labs/lab.xml", "labs/grid.xml")
    assert fit_reply(short) == short
    deep = "folder/" * 20
    assert len(encode(reply(deep + "lab.xml", deep + "grid.xml"))) > 1024
    assert fit_reply(reply(deep + "lab.xml", deep + "grid.xml")) == reply("lab.xml", "grid.xml")
    assert fit_reply(reply("x" * 300, None)) == reply(None, None)
    assert len(encode(fit_reply(reply("x" * 300, "grid.xml")))) <= 1024


def test_the_pieces_that_the_log_document_shares():
    lab, grid = Lab(name="L"), StartGrid(positions=(GridPosition(x=1.0),))
    assert encode(lab) == lab_to_xml(lab).encode() + b"\0"
    assert encode(grid) == grid_to_xml(grid).encode() + b"\0"
    heard = (HeardMessage(sender=1, text="x"),)
    measures = Measures(time=1, collision=True, compass=5.0, ground=0, infrared=(1.0,) * 4, messages=heard)
    assert measures_to_xml(measures).encode() + b"\0" == encode(measures)
    log = measures_to_xml(measures, log=True)
    assert '<Sensors Compass="5" Collision="Yes" Ground="0">' in log
    assert "Message" not in log
    assert replace(measures, messages=()) == decode_simulator_message(log.encode())
