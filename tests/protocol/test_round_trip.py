"""Encoding and decoding undo each other, for every message."""

import math
import xml.sax

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from ciberrato.protocol import (
    Acceptance,
    Actions,
    BeaconReading,
    GridRequest,
    HeardMessage,
    LabRequest,
    Measures,
    PanelRegistration,
    Refusal,
    RemoveRobot,
    Reset,
    Restart,
    RobotBeaconRegistration,
    RobotRegistration,
    RobotStatus,
    ScoreReading,
    Start,
    Stop,
    ViewRegistration,
    decode_actions,
    decode_registration,
    decode_simulator_message,
    decode_view_command,
    encode,
)
from ciberrato.protocol.measures_text import measures_from_element, measures_from_layout
from ciberrato.protocol.xmltree import parse_document
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid

# --- random messages of every kind, of what the wire can carry

# Text that XML can carry: no control characters but three, no surrogates, no U+FFFE and U+FFFF.
letters = st.characters(codec="utf-8", exclude_characters="￾￿", exclude_categories=["Cc", "Cs"])
texts = st.text(letters | st.sampled_from("\t\n\r<>&\"'] "), max_size=40)
tricky_texts = texts | st.lists(st.sampled_from(["]]>", "]]", ">", "\r\n", "nan", "<![CDATA[", "é"])).map(
    "".join
)


def six_digits(value):
    """Round to what `%g` keeps."""
    return float(f"{value:g}")


reals = st.floats(allow_nan=False).map(six_digits)
finite = st.floats(allow_nan=False, allow_infinity=False)
lengths = finite.map(six_digits)
deviations = st.floats(min_value=0.0, allow_infinity=False).map(six_digits)
integers = st.integers(-(2**31), 2**31 - 1)
counts = st.integers(0, 2**32 - 1)
small = st.integers(0, 2**31 - 1)
digits = st.text("01", max_size=12)

robot_registrations = st.builds(
    RobotRegistration,
    name=st.none() | texts,
    robot_id=integers,
    sensor_angles=st.lists(st.tuples(integers, finite), max_size=4).map(tuple),
)
registrations = st.one_of(
    robot_registrations,
    st.builds(RobotBeaconRegistration, name=st.none() | texts, robot_id=integers, height=finite),
    st.just(ViewRegistration()),
    st.just(PanelRegistration()),
)
sensor_names = st.sampled_from(["IRSensor0", "IRSensor3", "Beacon0", "Beacon12", "Compass", "Ground", "GPS"])
actions = st.builds(
    Actions,
    left_motor=st.none() | st.floats(allow_nan=False),
    right_motor=st.none() | st.floats(allow_nan=False),
    end_led=st.none() | st.booleans(),
    returning_led=st.none() | st.booleans(),
    visiting_led=st.none() | st.booleans(),
    requests=st.lists(sensor_names, max_size=6).map(tuple),
    say=st.none() | tricky_texts.filter(lambda text: len(text) <= 40),
    reset=st.booleans(),
)
view_commands = st.one_of(
    st.sampled_from([LabRequest(), GridRequest(), Start(), Stop(), Reset()]),
    st.builds(RemoveRobot, robot_id=integers),
)

measures = st.builds(
    Measures,
    time=counts,
    start=st.booleans(),
    stop=st.booleans(),
    end_led=st.booleans(),
    returning_led=st.booleans(),
    visiting_led=st.booleans(),
    collision=st.none() | st.booleans(),
    compass=st.none() | reals,
    ground=st.none() | integers,
    infrared=st.tuples(*[st.none() | reals] * 4),
    beacons=st.lists(
        st.builds(BeaconReading, beacon=small, bearing=st.none() | reals | st.integers(-180, 180).map(float)),
        max_size=3,
    ).map(tuple),
    gps=st.none() | st.tuples(reals, reals),
    line=st.none() | st.text("01", min_size=7, max_size=7) | texts,
    messages=st.lists(st.builds(HeardMessage, sender=integers, text=tricky_texts), max_size=2).map(tuple),
    score=st.none()
    | st.builds(
        ScoreReading,
        score=integers,
        arrival_time=integers,
        returning_time=integers,
        collisions=integers,
        collision=st.booleans(),
        visited_mask=digits | texts,
    ),
)
statuses = st.builds(
    RobotStatus,
    name=texts,
    robot_id=integers,
    time=counts,
    score=integers,
    arrival_time=counts,
    returning_time=counts,
    collisions=counts,
    collision=st.booleans(),
    visited_mask=digits,
    state=st.sampled_from(["Stopped", "Running", "Waiting", "Returning", "Finished", "Removed"]),
    x=reals,
    y=reals,
    direction_deg=reals,
)
parameters = st.builds(
    Parameters,
    **{name: counts for name, kind in Parameters.__annotations__.items() if kind == "int"},
    **{name: st.booleans() for name, kind in Parameters.__annotations__.items() if kind == "bool"},
    **{
        name: deviations if name.endswith("_noise") else reals
        for name, kind in Parameters.__annotations__.items()
        if kind == "float" and name not in ("line_sensor_true_probability", "beacon_aperture")
    },
    beacon_aperture=st.integers(-(10**9), 10**9).map(lambda millionths: float(f"{millionths / 1e6:f}")),
    lab_file=st.none() | texts,
    grid_file=st.none() | texts,
)
labs = st.builds(
    Lab,
    name=texts,
    width=lengths,
    height=lengths,
    beacons=st.lists(st.builds(Beacon, x=reals, y=reals, height=reals), max_size=2).map(tuple),
    targets=st.lists(st.builds(Target, x=reals, y=reals, radius=reals), max_size=2).map(tuple),
    walls=st.lists(
        st.builds(Wall, height=reals, corners=st.lists(st.tuples(reals, reals), max_size=4).map(tuple)),
        max_size=3,
    ).map(tuple),
)
grids = st.builds(
    StartGrid,
    positions=st.lists(st.builds(GridPosition, x=reals, y=reals, direction_deg=reals), max_size=5).map(tuple),
)
simulator_messages = st.one_of(
    measures,
    statuses,
    st.builds(Acceptance, parameters=parameters, n_beacons=counts),
    labs,
    grids,
    st.sampled_from([Refusal(), Restart()]),
)


# --- the tests


@settings(deadline=None)
@given(registrations)
def test_registrations_come_back(message):
    assert decode_registration(encode(message)) == message


@settings(deadline=None)
@given(actions)
def test_actions_come_back_with_every_bit_of_the_motor_commands(message):
    assert decode_actions(encode(message)) == message


@settings(deadline=None)
@given(view_commands)
def test_view_commands_come_back(message):
    assert decode_view_command(encode(message)) == message


@settings(deadline=None)
@given(simulator_messages)
def test_simulator_messages_come_back(message):
    data = encode(message)
    assert decode_simulator_message(data) == message
    assert encode(decode_simulator_message(data)) == data


@settings(deadline=None)
@given(simulator_messages)
def test_clients_that_drop_one_byte_or_stop_at_the_nul_can_read_what_simulators_send(message):
    data = encode(message)
    assert data.index(b"\0") == len(data) - 1
    assert data == b"<Restart/>\0" or data.endswith(b">\n\0")
    xml.sax.parseString(data[:-1], xml.sax.ContentHandler())
    etree.fromstring(data.rstrip(b"\0"))


@settings(deadline=None)
@given(st.one_of(registrations, actions, view_commands))
def test_what_clients_send_is_xml_with_one_nul_at_the_end(message):
    data = encode(message)
    assert data.index(b"\0") == len(data) - 1
    etree.fromstring(data.rstrip(b"\0"))


@settings(deadline=None)
@given(measures)
def test_the_short_way_of_measures_agrees_with_the_xml_parser(message):
    data = encode(message)
    long_way = measures_from_element(parse_document(data[:-1], invalid_bytes="latin-1"))
    short_way = measures_from_layout(data)
    assert long_way == message
    assert short_way is None or short_way == long_way


@settings(deadline=None)
@given(measures.filter(lambda m: not m.messages))
def test_measures_without_odd_text_take_the_short_way(message):
    plain = all(value is None or abs(value) < 1e18 for value in (message.compass, *message.infrared))
    plain = plain and all(reading.bearing is None for reading in message.beacons)
    plain = plain and (message.gps is None or all(abs(value) < 1e18 for value in message.gps))
    plain = plain and (message.line is None or (len(message.line) == 7 and set(message.line) <= set("01")))
    plain = plain and (message.score is None or set(message.score.visited_mask) <= set("01"))
    if plain and all(reading.beacon < 10**9 for reading in message.beacons):
        assert measures_from_layout(encode(message)) == message


@settings(deadline=None)
@given(actions)
def test_the_short_way_of_actions_agrees_with_the_xml_parser(message):
    data = encode(message)
    # A comment sends the same message through the parser.
    assert decode_actions(b"<!-- -->" + data) == decode_actions(data)


@settings(deadline=None)
@given(measures, st.sampled_from([math.nan, -math.nan]), st.integers(0, 3))
def test_not_a_number_keeps_its_sign_on_the_wire(message, nan, sensor):
    infrared = tuple(nan if index == sensor else 1.5 for index in range(4))
    data = encode(
        Measures(
            time=message.time, compass=nan, ground=-1, collision=False, infrared=infrared, line="0000000"
        )
    )
    word = b'"-nan"' if math.copysign(1, nan) < 0 else b'"nan"'
    assert data.count(word) == 2
    assert encode(decode_simulator_message(data)) == data


@pytest.mark.parametrize("score", [0, 5, -5, 2**31 - 1, -(2**31)])
def test_scores_wrap_on_the_wire_and_come_back_signed(score):
    data = encode(RobotStatus(name="x", robot_id=1, score=score))
    assert b' Score="%d"' % (score % 2**32) in data
    assert decode_simulator_message(data).score == score
