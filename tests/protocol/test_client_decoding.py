"""What clients send, as the real simulator takes it."""

import math

import pytest

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    ACTIONS_LIMIT,
    REGISTRATION_LIMIT,
    VIEW_COMMAND_LIMIT,
    Actions,
    GridRequest,
    LabRequest,
    PanelRegistration,
    RemoveRobot,
    Reset,
    RobotBeaconRegistration,
    RobotRegistration,
    Start,
    Stop,
    ViewRegistration,
    decode_actions,
    decode_registration,
    decode_view_command,
)

PLAIN_ROBOT = RobotRegistration(name="x", robot_id=1)
DEFAULTS = ((0, 0.0), (1, 60.0), (2, -60.0), (3, 180.0))
ALL_FOUR = RobotRegistration(name="x", robot_id=1, sensor_angles=DEFAULTS)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        # the literal forms of the Python, Java and C++ clients and the viewer
        (b'<Robot Id="1" Name="x" />', PLAIN_ROBOT),
        (
            b'<Robot Id="1" Name="x"><IRSensor Id="0" Angle="0.0" /> <IRSensor Id="1" Angle="60.0" /> '
            b'<IRSensor Id="2" Angle="-60.0" /> <IRSensor Id="3" Angle="180.0" /> </Robot>',
            ALL_FOUR,
        ),
        (b'<Robot Name="x" Id="1"></Robot>\0', PLAIN_ROBOT),
        (
            b'<Robot Name="x" Id="1"><IRSensor Id="0" Angle="0"/><IRSensor Id="1" Angle="60"/>'
            b'<IRSensor Id="2" Angle="-60"/><IRSensor Id="3" Angle="180"/></Robot>\0',
            ALL_FOUR,
        ),
        (
            b'<RobotBeacon Name="x" Id="1" Height="4.5"/>\0',
            RobotBeaconRegistration(name="x", robot_id=1, height=4.5),
        ),
        (b'<Robot Id="1" Name="jClient"/>', RobotRegistration(name="jClient", robot_id=1)),
        (b"<View/>\n\0", ViewRegistration()),
        (b"<Panel/>\0", PanelRegistration()),
        # odd ones that the real simulator took
        (b'<?xml version="1.0"?>\n<Robot Id="1" Name="x"></Robot>\n\0', PLAIN_ROBOT),
        (b"<Robot Name='x' Id='1'/>", PLAIN_ROBOT),
        (b'  \n<Robot Id="1" Name="x"/><!-- a comment -->', PLAIN_ROBOT),
        (b'<Robot Id="1" Name="x" Colour="red">text</Robot>', PLAIN_ROBOT),
        (b'<Robot Id="1"/>', RobotRegistration(robot_id=1)),
        (b'<Robot Name="x"/>', RobotRegistration(name="x", robot_id=0)),
        (b'<Robot Id="abc" Name="x"/>', RobotRegistration(name="x", robot_id=0)),
        (b'<Robot Id="1.5" Name="x"/>', RobotRegistration(name="x", robot_id=0)),
        (b'<Robot Id="99999999999" Name="x"/>', RobotRegistration(name="x", robot_id=0)),
        (b'<Robot Id=" +1 " Name="x"/>', PLAIN_ROBOT),
        (b'<Robot Id="-1" Name="x"/>', RobotRegistration(name="x", robot_id=-1)),
        (b'<Robot Id="1" Name="x"><IRSensor Id="0"/><IRSensor Angle="7"/><IRSensor/></Robot>', PLAIN_ROBOT),
        (
            b'<Robot Id="1" Name="x"><IRSensor Id="9" Angle="10"/></Robot>',
            RobotRegistration(name="x", robot_id=1, sensor_angles=((9, 10.0),)),
        ),
        (b'<Robot Id="1" Name="&lt;a&amp;&quot;b"/>', RobotRegistration(name='<a&"b', robot_id=1)),
        (b'<Robot Id="1" Name="\xc3\xa7"/>', RobotRegistration(name="ç", robot_id=1)),
        (b'<Robot Id="1" Name="a\xe7a"/>', RobotRegistration(name="a?a", robot_id=1)),
        (b'<Robot Id="1" Name="\xff\xfe"/>', RobotRegistration(name="??", robot_id=1)),
        (b'<?xml version="1.0" encoding="ISO-8859-1"?><Robot Name="\xe7"/>', RobotRegistration(name="ç")),
        (b'<?xml version="1.0" encoding="UTF-8"?><Robot Name="\xc3\xa7"/>', RobotRegistration(name="ç")),
        (b'<RobotBeacon Id="2" Name="b"></RobotBeacon>', RobotBeaconRegistration(name="b", robot_id=2)),
        (b"<View/>\0<bad", ViewRegistration()),
        (b"<View></View>", ViewRegistration()),
    ],
)
def test_registrations(data, expected):
    assert decode_registration(data) == expected


def test_angles_are_filled_in_and_ids_beyond_the_fourth_do_not_count():
    assert decode_registration(b'<Robot><IRSensor Id="1" Angle="37"/></Robot>').angles == (0, 37, -60, 180)
    assert decode_registration(b'<Robot><IRSensor Id="9" Angle="37"/></Robot>').angles == (0, 60, -60, 180)
    assert decode_registration(b'<Robot><IRSensor Id="-1" Angle="37"/></Robot>').angles == (0, 60, -60, 180)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "no element found"),
        (b"\0", "no element found"),
        (b"hello\0", "XML"),
        (b'<Robot Id="1"\0', "XML"),
        (b"<View>\0", "no element found"),
        (b"<Unknown/>", "Unknown: not a registration"),
        (b'<Actions LeftMotor="0.1"/>', "Actions: not a registration"),
        (b'<robot Id="9"/>', "robot: not a registration"),
        (b'<IRSensor Id="0" Angle="10"/>', "IRSensor: not a registration"),
        (b'<Robot Id="2" Name="trail"/> trailing', "junk after document element"),
        (b"<View/><View/>", "junk after document element"),
        (b'<Robot Id="3"><Foo/></Robot>', "Foo is not known"),
        (b'<Robot><IRSensor Id="1" Angle="1"><Foo/></IRSensor></Robot>', "Foo is not known"),
        (b'<RobotBeacon Id="3"><IRSensor Id="0" Angle="0"/></RobotBeacon>', "IRSensor is not known"),
        (b"<View><Foo/></View>", "Foo is not known"),
        (b"<Panel><Foo/></Panel>", "Foo is not known"),
        (b'\n<?xml version="1.0"?><View/>', "XML or text declaration not at start"),
        (bytes(range(1, 33)), "XML"),
        # on purpose
        (b'<Robot><IRSensor Id="1" Angle="nan"/></Robot>', "IRSensor Angle: 'nan' is not a finite number"),
        (
            b'<Robot><IRSensor Id="1" Angle="1e999"/></Robot>',
            "IRSensor Angle: '1e999' is not a finite number",
        ),
        (b'<RobotBeacon Height="-inf"/>', "RobotBeacon Height: '-inf' is not a finite number"),
        (b'<!DOCTYPE Robot><Robot Id="1">&x;</Robo>', "DOCTYPE Robot"),
        (b'<?xml version="1.0" encoding="utf-16"?><View/>', "encoding 'utf-16' is not supported"),
        (b'<?xml version="1.0" encoding="rot13"?><View/>', "encoding 'rot13' is not supported"),
    ],
)
def test_registrations_that_are_refused(data, complaint):
    with pytest.raises(ProtocolError) as caught:
        decode_registration(data)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        # motors, as every client sends them
        (b'<Actions LeftMotor="0.1" RightMotor="0.1"/>', Actions(left_motor=0.1, right_motor=0.1)),
        (b'<Actions LeftMotor="0.1" RightMotor="-0.05"/>\n\0', Actions(left_motor=0.1, right_motor=-0.05)),
        (
            b'<Actions LeftMotor="0.0" RightMotor="0.0" EndLed="On"/>',
            Actions(left_motor=0.0, right_motor=0.0, end_led=True),
        ),
        (
            b'<Actions LeftMotor="0" RightMotor="0" ReturningLed="Off"/>\n\0',
            Actions(left_motor=0.0, right_motor=0.0, returning_led=False),
        ),
        (
            b'<Actions LeftMotor="0" RightMotor="0" VisitingLed="On" />',
            Actions(left_motor=0.0, right_motor=0.0, visiting_led=True),
        ),
        (
            b'<Actions EndLed="Off" LeftMotor="0.1" RightMotor="0.1"/>',
            Actions(left_motor=0.1, right_motor=0.1, end_led=False),
        ),
        # numbers, where no pattern is asked and where one is
        (b'<Actions LeftMotor="-.5" RightMotor="-0"/>', Actions(left_motor=-0.5, right_motor=-0.0)),
        (b'<Actions LeftMotor="1.2.3" RightMotor="4-5"/>', Actions(left_motor=0.0, right_motor=0.0)),
        (b'<Actions LeftMotor="." RightMotor="-"/>\n', Actions(left_motor=0.0, right_motor=0.0)),
        (b'<Actions LeftMotor="0.1" RightMotor="0.2"/>\0junk"', Actions(left_motor=0.1, right_motor=0.2)),
        (b'<Actions LeftMotor="0.1" RightMotor="2e-1" />\0', Actions(left_motor=0.1, right_motor=0.2)),
        (b'<Actions LeftMotor="abc" RightMotor=""/>', Actions(left_motor=0.0, right_motor=0.0)),
        (b'<Actions LeftMotor="0,1" RightMotor="1e-1"/>', Actions(left_motor=0.0, right_motor=0.1)),
        (b'<Actions LeftMotor=" 0.05 " RightMotor="+0.05"/>', Actions(left_motor=0.05, right_motor=0.05)),
        (
            b'<Actions LeftMotor="inf" RightMotor="-inf"/>',
            Actions(left_motor=math.inf, right_motor=-math.inf),
        ),
        (b'<Actions LeftMotor="1_0" RightMotor="0x1"/>', Actions(left_motor=0.0, right_motor=0.0)),
        (b'<Actions LeftMotor=".5" RightMotor="5."/>', Actions(left_motor=0.5, right_motor=5.0)),
        ('<Actions LeftMotor="٣" RightMotor="1"/>'.encode(), Actions(left_motor=0.0, right_motor=1.0)),
        (b'<Actions RightMotor="0.02"/>', Actions(right_motor=0.02)),
        (b"<Actions/>", Actions()),
        # LEDs: exactly On is on
        (b'<Actions EndLed="on" VisitingLed="true"/>', Actions(end_led=False, visiting_led=False)),
        (b'<Actions LeftMotor="0.03" Unknown="1"/>', Actions(left_motor=0.03)),
        (b'<Actions LeftMotor="0.04"/>\0 after NUL', Actions(left_motor=0.04)),
        (b'<Actions LeftMotor="1" RightMotor="2"/>\0<bad', Actions(left_motor=1.0, right_motor=2.0)),
        # requests
        (
            b'<Actions> <SensorRequests Compass="Yes" /> </Actions>\n\0',
            Actions(requests=("Compass",)),
        ),
        (
            b'<Actions><SensorRequests IRSensor0="No" Foo="Yes" LineSensor="Yes" Compass="yes"/></Actions>',
            Actions(requests=("Foo", "LineSensor")),
        ),
        (
            b'<Actions><SensorRequests GPS="Yes"/><SensorRequests Ground="Yes" GPS="Yes"/></Actions>',
            Actions(requests=("GPS", "Ground", "GPS")),
        ),
        (b'<SensorRequests IRSensor0="Yes"/>', Actions(requests=("IRSensor0",))),
        # say
        (b"<Actions><Say><![CDATA[hello]]></Say></Actions>", Actions(say="hello")),
        (b"<Actions><Say>plain &lt;x&gt; text</Say></Actions>", Actions(say="plain <x> text")),
        (b'<Actions><Say><![CDATA[<a b="c"/>]]></Say></Actions>', Actions(say='<a b="c"/>')),
        (b"<Actions><Say><![CDATA[a\nb]]></Say></Actions>", Actions(say="a\nb")),
        (b"<Actions><Say><![CDATA[a]]]]><![CDATA[>b]]></Say></Actions>", Actions(say="a]]>b")),
        (b"<Actions><Say></Say></Actions>", Actions(say="")),
        (b"<Say>root</Say>\0", Actions(say="root")),
        (b"<Say>root</Say>\n\0", Actions(say="root")),
        (b"<Actions><Say>a</Say><Say>b</Say></Actions>", Actions(say="ab")),
        (b"<Actions><Say>before</Say>after</Actions>", Actions(say="beforeafter")),
        (
            b'<Actions>\n<SensorRequests GPS="Yes"/> not <Say>x</Say> yes<SensorRequests/> not </Actions>',
            Actions(say="x yes", requests=("GPS",)),
        ),
        ("<Say>é€</Say>".encode(), Actions(say="é€")),
        (b"<Say>\xe9</Say>", Actions(say="?")),
        # the newer Python client
        (b'<Actions Reset="On"/>', Actions(reset=True)),
        (b'<Actions Reset="Off"/>', Actions()),
    ],
)
def test_actions(data, expected):
    decoded = decode_actions(data)
    assert decoded == expected
    assert math.copysign(1, decoded.left_motor or 1) == math.copysign(1, expected.left_motor or 1)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "no element found"),
        (b"garbage", "XML"),
        (b'<Actions LeftMotor="0.1" RightMotor="0.1"\0', "XML"),
        (b"<Foo/>", "Foo: not for robots"),
        (b"<View/>", "View: not for robots"),
        (b'<Robot Id="1" Name="z"/>', "Robot: not for robots"),
        (b'<Actions LeftMotor="0.1" RightMotor="0.1"><Foo/></Actions>', "Foo is not known"),
        (b"<Actions><Say><Foo/></Say></Actions>", "Foo is not known"),
        (b'<Actions LeftMotor="0.04"/> trailing', "junk after document element"),
        (b'<Actions LeftMotor="0.07"/><Actions LeftMotor="0.08"/>', "junk after document element"),
        (b'<Actions LeftMotor="1" RightMotor="1"/>x', "junk after document element"),
        (b'<Actions LeftMotor="1" RightMotor="1"/>\x0b', "XML"),
        # on purpose
        (b'<Actions LeftMotor="nan" RightMotor="0.1"/>', "Actions LeftMotor: 'nan' is not a motor command"),
        (b'<Actions RightMotor=" -NaN "/>', "Actions RightMotor: '-NaN' is not a motor command"),
        (b'<Actions LeftMotor="1" LeftMotor="2">', "duplicate attribute"),
        (b'<Actions LeftMotor="' + b"9" * 5000 + b'z"/>', "XML"),
    ],
)
def test_actions_that_are_refused(data, complaint):
    with pytest.raises(ProtocolError) as caught:
        decode_actions(data)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"<LabReq/>", LabRequest()),
        (b"<LabReq/>\n", LabRequest()),
        (b"  <LabReq/>\0", LabRequest()),
        (b"<GridReq></GridReq>\0", GridRequest()),
        (b'<?xml version="1.0"?><GridReq/>\0', GridRequest()),
        (b"<GridReq/>\0trailing after NUL", GridRequest()),
        (b"<Start/>\0", Start()),
        (b"<Stop/>\0", Stop()),
        (b"<Reset/>\n", Reset()),
        (b'<Robot Id="2" Removed="Yes"/>\0', RemoveRobot(robot_id=2)),
        (b'<Robot Removed="Yes"/>\0', RemoveRobot(robot_id=0)),
        (b'<Robot Removed="Yes" Id="x"></Robot>', RemoveRobot(robot_id=0)),
    ],
)
def test_view_commands(data, expected):
    assert decode_view_command(data) == expected


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"<Foo/>", "Foo: not a command"),
        (b"<labreq/>", "labreq: not a command"),
        (b"<View/>", "View: not a command"),
        (b"<LabReq>", "no element found"),
        (b"not xml", "XML"),
        (b"", "no element found"),
        (b"<GridReq/><LabReq/>", "junk after document element"),
        (b"<GridReq/>trailing", "junk after document element"),
        (b"<GridReq><LabReq/></GridReq>", "LabReq is not known"),
        (b'<Robot Id="1"/>', "Removed"),
        (b'<Robot Id="1" Removed="No"/>', "Removed"),
        (b'<Robot Id="1" Removed="yes"/>', "Removed"),
    ],
)
def test_view_commands_that_are_refused(data, complaint):
    with pytest.raises(ProtocolError) as caught:
        decode_view_command(data)
    assert complaint in str(caught.value)


def padded(start, end, length):
    return start + b" " * (length - len(start) - len(end)) + end


@pytest.mark.parametrize(
    ("decode", "limit", "start", "end"),
    [
        (decode_registration, REGISTRATION_LIMIT, b'<Robot Id="1">', b"</Robot>"),
        (decode_actions, ACTIONS_LIMIT, b'<Actions LeftMotor="0.05">', b"</Actions>"),
        (decode_actions, ACTIONS_LIMIT, b'<Actions LeftMotor="0.05" RightMotor="0"/>', b"<!---->"),
        (decode_view_command, VIEW_COMMAND_LIMIT, b"<GridReq>", b"</GridReq>"),
    ],
)
def test_what_is_beyond_the_size_limit_is_lost(decode, limit, start, end):
    decode(padded(start, end, limit))
    decode(padded(start, end, limit) + b"\0 more")
    decode(padded(start, end, limit) + b"<even more")
    with pytest.raises(ProtocolError):
        decode(padded(start, end, limit + 1))
    decode(padded(start, end, limit + 1), limit=limit + 1)
    decode(padded(start, end, 60_000), limit=None)


def test_the_limits_are_those_of_the_real_simulator():
    assert (REGISTRATION_LIMIT, ACTIONS_LIMIT, VIEW_COMMAND_LIMIT) == (1023, 1023, 63)


def test_the_usual_actions_are_cut_like_others():
    usual = b'<Actions LeftMotor="0.1" RightMotor="0.1"/>'
    assert decode_actions(usual, limit=len(usual)) == Actions(left_motor=0.1, right_motor=0.1)
    with pytest.raises(ProtocolError):
        decode_actions(usual, limit=len(usual) - 1)
    assert decode_actions(usual + b" " * 2000) == Actions(left_motor=0.1, right_motor=0.1)
