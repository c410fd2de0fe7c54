"""What simulators send: lenient where the real clients are, strict where they are."""

import pytest

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    Acceptance,
    BeaconReading,
    HeardMessage,
    Measures,
    OtherReading,
    Refusal,
    Restart,
    RobotStatus,
    ScoreReading,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid

FULL = b"""<Measures Time="6">
\t<Sensors Collision="No" Compass="29" Ground="-1">
\t\t<IRSensor Id="0" Value="1.5"/>
\t\t<IRSensor Id="1" Value="3.4"/>
\t\t<IRSensor Id="2" Value="-0.2"/>
\t\t<IRSensor Id="3" Value="100"/>
\t\t<BeaconSensor Id="0" Value="NotVisible"/>
\t\t<BeaconSensor Id="1" Value="-17"/>
\t\t<GPS X="849.7" Y="397.5" />
\t\t<LineSensor Value="0011100" />
\t\t<Message From="2"><![CDATA[text]]></Message>
\t\t<Score Score="-200" ArrivalTime="6" ReturningTime="3" Collisions="1" Collision="True" VisitedMask="01" />
\t</Sensors>
\t<Leds EndLed="Off" ReturningLed="On" VisitingLed="Off"/>
\t<Buttons Start="On" Stop="Off"/>
</Measures>
\0"""
FULL_RECORD = Measures(
    time=6,
    start=True,
    returning_led=True,
    collision=False,
    compass=29.0,
    ground=-1,
    infrared=(1.5, 3.4, -0.2, 100.0),
    beacons=(BeaconReading(beacon=0, bearing=None), BeaconReading(beacon=1, bearing=-17.0)),
    gps=(849.7, 397.5),
    line="0011100",
    messages=(HeardMessage(sender=2, text="text"),),
    score=ScoreReading(
        score=-200, arrival_time=6, returning_time=3, collisions=1, collision=True, visited_mask="01"
    ),
)


def test_measures_with_everything():
    assert decode_simulator_message(FULL) == FULL_RECORD
    assert encode(FULL_RECORD) == FULL


def test_measures_in_another_layout():
    assert decode_simulator_message(b" ".join(FULL.split())) == FULL_RECORD
    assert decode_simulator_message(FULL.replace(b'"', b"'")) == FULL_RECORD


@pytest.mark.parametrize("end", [b"\n\0", b"\0", b"\n", b"", b"\n\0stale bytes", b"\0\0"])
def test_any_terminator_will_do(end):
    assert decode_simulator_message(FULL[:-2] + end) == FULL_RECORD
    usual = encode(Measures(time=1, line="0000000"))
    assert decode_simulator_message(usual[:-2] + end) == Measures(time=1, line="0000000")
    assert decode_simulator_message(b"<Restart/>" + end) == Restart()


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b'<Measures Time="3"/>', Measures(time=3)),
        (b'<Measures Time="3"><Sensors/></Measures>', Measures(time=3)),
        (b'<Measures Time=" 3 "><Sensors Compass="1.25"/></Measures>', Measures(time=3, compass=1.25)),
        (
            b'<Measures Time="3"><Sensors><IRSensor Id="2" Value="1e-05"/></Sensors></Measures>',
            Measures(time=3, infrared=(None, None, 1e-05, None)),
        ),
        (
            b'<Measures Time="3"><Sensors><IRSensor Id="7" Value="1"/><New x="1"><y/></New></Sensors>'
            b"<Other/></Measures>",
            Measures(time=3, others=(OtherReading(name="New", values=(("x", "1"),)),)),
        ),
        (
            b'<Measures Time="3"><Buttons Start="on" Stop="On" Pause="On"/></Measures>',
            Measures(time=3, stop=True),
        ),
        (
            b'<Measures Time="3"><Sensors><BeaconSensor Id="4" Value="3.5"/></Sensors></Measures>',
            Measures(time=3, beacons=(BeaconReading(beacon=4, bearing=3.5),)),
        ),
        (
            b'<Measures Time="3"><Sensors><Message From="1">a<!-- -->b<![CDATA[<]]></Message></Sensors>'
            b"</Measures>",
            Measures(time=3, messages=(HeardMessage(sender=1, text="ab<"),)),
        ),
        (
            b'<Measures Time="3"><Sensors><Message From="1"><![CDATA[\xe9]]></Message></Sensors></Measures>',
            Measures(time=3, messages=(HeardMessage(sender=1, text="é"),)),
        ),
        (
            b'<Measures Time="3"><Sensors><Score Score="5"/></Sensors></Measures>',
            Measures(time=3, score=ScoreReading(score=5)),
        ),
    ],
)
def test_measures_may_lack_sensors_and_have_unknown_ones(data, expected):
    assert decode_simulator_message(data) == expected


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (b' Time="6"', b"", "Measures: attribute Time is missing"),
        (b'<Measures Time="6"', b'<Measures Time="six"', "Measures Time: 'six' is not an integer"),
        (b'Compass="29"', b'Compass="north"', "Sensors Compass: 'north' is not a number"),
        (b'Compass="29"', b'Compass=""', "Sensors Compass: '' is not a number"),
        (b'Compass="29"', b'Compass="2_9"', "Sensors Compass"),
        (b'Ground="-1"', b'Ground="-1.5"', "Sensors Ground: '-1.5' is not an integer"),
        (b'Id="0" Value="1.5"', b'Value="1.5"', "IRSensor: attribute Id is missing"),
        (b'Id="0" Value="1.5"', b'Id="0"', "IRSensor: attribute Value is missing"),
        (b'Value="1.5"', b'Value="1,5"', "IRSensor Value: '1,5' is not a number"),
        (b'Id="1" Value="-17"', b'Value="-17"', "BeaconSensor: attribute Id is missing"),
        (b'Value="NotVisible"', b'Value="Hidden"', "BeaconSensor Value: 'Hidden' is not a number"),
        (b' Y="397.5"', b"", "GPS: attribute Y is missing"),
        (b'LineSensor Value="0011100"', b"LineSensor", "LineSensor: attribute Value is missing"),
        (b'From="2"', b"", "Message: attribute From is missing"),
        (b'From="2"', b'From="you"', "Message From: 'you' is not an integer"),
        (b'Score="-200"', b'Score="low"', "Score Score: 'low' is not an integer"),
        (b' ReturningLed="On"', b"", "Leds: attribute ReturningLed is missing"),
        (b' Stop="Off"', b"", "Buttons: attribute Stop is missing"),
        (b"</Measures>", b"", "XML"),
        (b"text]]>", b"te]]>xt]]>&", "XML"),
        (b'Measures Time="6"', b'Measures Time="' + b"9" * 5000 + b'"', "Measures Time: '9999"),
    ],
)
def test_what_is_there_must_be_complete(old, new, complaint):
    assert old in FULL
    with pytest.raises(ProtocolError) as caught:
        decode_simulator_message(FULL.replace(old, new))
    assert complaint in str(caught.value)
    assert len(str(caught.value)) < 200


def test_a_reply_with_the_short_parameters_of_a_log_player():
    data = (
        b'<Reply Status="Ok">\n\t<Parameters SimTime="400" CycleTime="30" CompassNoise="1" '
        b'BeaconNoise="2.5" ObstacleNoise="0.2" MotorsNoise="0"/>\n</Reply>\n\0'
    )
    parameters = Parameters(
        sim_time=400, cycle_time=30, compass_noise=1.0, beacon_noise=2.5, obstacle_noise=0.2, motors_noise=0.0
    )
    assert decode_simulator_message(data) == Acceptance(parameters=parameters, n_beacons=0)


def test_a_reply_says_whether_the_simulator_is_in_lockstep():
    plain = encode(Acceptance(parameters=Parameters()))
    told = encode(Acceptance(parameters=Parameters(), lockstep=True))
    assert told == plain.replace(b'Status="Ok"', b'Status="Ok" Lockstep="On"')
    assert [decode_simulator_message(data).lockstep for data in (plain, told)] == [False, True]


def test_replies():
    assert decode_simulator_message(b'<Reply Status="Refused"></Reply>\n\0') == Refusal()
    assert decode_simulator_message(b'<Reply Status="ok"/>') == Refusal()
    assert decode_simulator_message(b'<Reply Status="Ok"><New/><Parameters New="1"/></Reply>') == Acceptance(
        parameters=Parameters()
    )


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"<Reply/>", "Reply: attribute Status is missing"),
        (b'<Reply Status="Ok"/>', "Reply: child element Parameters is missing"),
        (
            b'<Reply Status="Ok"><Parameters SimTime="x"/></Reply>',
            "Parameters SimTime: 'x' is not an integer",
        ),
        (
            b'<Reply Status="Ok"><Parameters NBeacons=""/></Reply>',
            "Parameters NBeacons: '' is not an integer",
        ),
        (b'<Reply Status="Ok"><Parameters CompassNoise="x"/></Reply>', "Parameters CompassNoise"),
        (b'<Robot Name="x" State="Running"/>', "Robot: attribute Id is missing"),
        (b'<Robot Name="x" Id="1"/>', "Robot: attribute State is missing"),
        (b'<Robot Id="1" State="Running" Score="x"/>', "Robot Score: 'x' is not an integer"),
        (b'<Robot Id="1" State="Running"><Position X="x"/></Robot>', "Position X: 'x' is not a number"),
        (b'<Lab><Row Pos="1" Pattern="|"/></Lab>', "Row"),
        (b'<Lab Width="wide"/>', "Lab Width: 'wide' is not a number"),
        (b'<Lab><Wall><Corner X="x"/></Wall></Lab>', "Corner X: 'x' is not a number"),
        (b'<Grid><Position Dir="up"/></Grid>', "Position Dir: 'up' is not a number"),
        (b"<Start/>", "Start: not a simulator's"),
        (b"", "no element found"),
        (b"\0", "no element found"),
        (b"<" + b"a" * 5000 + b"/>", "aaaa…: not a simulator's"),
    ],
)
def test_messages_that_are_refused(data, complaint):
    with pytest.raises(ProtocolError) as caught:
        decode_simulator_message(data)
    assert complaint in str(caught.value)
    assert len(str(caught.value)) < 200


def test_statuses_may_be_short():
    assert decode_simulator_message(b'<Robot Id="2" State="Waiting"/>') == RobotStatus(
        name="", robot_id=2, state="Waiting"
    )
    signed = b'<Robot Id="2" State="Running" Score="-5" Collision="True"/>'
    assert decode_simulator_message(signed) == RobotStatus(
        name="", robot_id=2, state="Running", score=-5, collision=True
    )


def test_labs_and_grids_take_the_defaults_of_the_lab_file():
    data = b"<Lab><Beacon/><Target/><New/><Wall><Corner/><New/></Wall></Lab>"
    assert decode_simulator_message(data) == Lab(
        beacons=(Beacon(),), targets=(Target(),), walls=(Wall(corners=((0.0, 0.0),)),)
    )
    assert decode_simulator_message(b"<Lab/>") == Lab()
    assert decode_simulator_message(b'<Grid>\\n"<Position X="1"/><New/></Grid>') == StartGrid(
        positions=(GridPosition(x=1.0),)
    )


@pytest.mark.parametrize(
    "data",
    [
        b'<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;&b;">]><Measures Time="1">&c;</Measures>',
        b'<!DOCTYPE a SYSTEM "file:///etc/passwd"><Measures Time="1"/>',
        b'<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1/">%p;]><Measures Time="1"/>',
        b"<!DOCTYPE a [<!ATTLIST Measures Time CDATA '7'>]><Measures/>",
    ],
)
def test_document_types_and_entities_are_refused(data):
    with pytest.raises(ProtocolError, match="DOCTYPE a"):
        decode_simulator_message(data)


def test_undeclared_entities_are_refused_and_predefined_ones_are_not():
    with pytest.raises(ProtocolError, match="undefined entity"):
        decode_simulator_message(b'<Robot Name="&nbsp;" Id="1" State="Running"/>')
    status = decode_simulator_message(b'<Robot Name="&amp;&#233;&#x20AC;" Id="1" State="Running"/>')
    assert status.name == "&é€"


def test_nesting_is_bounded():
    with pytest.raises(ProtocolError, match="deep"):
        decode_simulator_message(b"<a>" * 20_000)
    with pytest.raises(ProtocolError, match="not a simulator's"):
        decode_simulator_message(b"<a>" * 16 + b"</a>" * 16)
