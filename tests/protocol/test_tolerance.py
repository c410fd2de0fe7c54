"""What is no XML, or not in the usual shape, and the real simulator takes all the same."""

from __future__ import annotations

from xml.parsers.expat import ExpatError, ParserCreate

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    Actions,
    GridRequest,
    RemoveRobot,
    RobotRegistration,
    ViewRegistration,
    decode_actions,
    decode_registration,
    decode_view_command,
    encode,
)
from ciberrato.protocol.client_decoding import PassedOverError
from ciberrato.protocol.limits import TOLERANCE_LIMIT
from ciberrato.protocol.tolerantxml import ENTITY, parse_tolerantly
from ciberrato.protocol.xmltree import Element, parse_document
from tests.cpu import cpu_seconds

DRIVE = Actions(left_motor=0.1, right_motor=0.05)
BOMB = (
    b'<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + n, (b"&%c;" % (97 + n)) * 10) for n in range(9))
    + b"]>"
)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        # an attribute twice: the last one counts
        (b'<Actions LeftMotor="0.3" RightMotor="0.05" LeftMotor="0.1"/>', DRIVE),
        (b'<Actions LeftMotor="0.1" RightMotor="0.05" EndLed="On" EndLed="Off"/>', Actions(
            left_motor=0.1, right_motor=0.05, end_led=False
        )),
        (b'<SensorRequests Ground="Yes" Compass="Yes" Ground="No"/>', Actions(requests=("Compass",))),
        # no blank between attributes
        (b'<Actions LeftMotor="0.1"RightMotor="0.05"/>', DRIVE),
        (b"<Actions LeftMotor='0.1'RightMotor=\"0.05\"/>", DRIVE),
        # document types, passed over
        (b'<!DOCTYPE Actions><Actions LeftMotor="0.1" RightMotor="0.05"/>', DRIVE),
        (b'<!DOCTYPE Actions SYSTEM "x.dtd">\n<Actions LeftMotor="0.1" RightMotor="0.05"/>', DRIVE),
        (
            b'<?xml version="1.0"?><!-- [ --><!DOCTYPE Actions [ <!ENTITY e "]>"> <!-- "\' --> ] >'
            b'<Actions LeftMotor="0.1" RightMotor="0.05"/>',
            DRIVE,
        ),
        # entities where text does not count
        (b'<Actions LeftMotor="0.1" RightMotor="0.05">&nothing;</Actions>', DRIVE),
        (b'<!DOCTYPE a [<!ENTITY e "x">]><Actions LeftMotor="0.1" RightMotor="0.05"> &e; </Actions>', DRIVE),
        (BOMB + b'<Actions LeftMotor="0.1" RightMotor="0.05">&j;</Actions>', DRIVE),
        # characters that XML does not have
        (b'<Actions LeftMotor="0.1" RightMotor="0.05" Other="\x01&#0;"/>', DRIVE),
        (b'<Actions LeftMotor="\x010.1" RightMotor="0.05"/>', Actions(left_motor=0.0, right_motor=0.05)),
        (b"<Say>a\x02b&#0;c&#x1b;d&#xD800;e&#x110000;f&amp;</Say>", Actions(say="a?b?c?d?e?f&")),
        (b"<Say><![CDATA[a\x02&lt;]]></Say>", Actions(say="a?&lt;")),
        ("<Say>\x03é€ \U0001f600</Say>".encode(), Actions(say="?é€ \U0001f600")),
        # shapes
        (b'<Actions LeftMotor="0.2"><Actions LeftMotor="0.1" RightMotor="0.05"/></Actions>', DRIVE),
        (
            b'<Actions><Actions EndLed="On"><SensorRequests GPS="Yes"/></Actions><Say>x</Say></Actions>',
            Actions(end_led=True, requests=("GPS",), say="x"),
        ),
        (
            b'<SensorRequests GPS="Yes"><Say>hello</Say></SensorRequests>',
            Actions(requests=("GPS",), say="hello"),
        ),
        (
            b'<Say>a<SensorRequests Ground="Yes"/>b<Say>c</Say>d</Say>e',
            None,  # text after the root
        ),
        (
            b'<Say>a<SensorRequests Ground="Yes"/>b<Say>c</Say>d</Say>',
            Actions(say="acd", requests=("Ground",)),
        ),
        # spaces around numbers
        ('<Actions LeftMotor="\u00a00.1\u2003" RightMotor="\u30000.05"/>'.encode(), DRIVE),
        ('<Actions LeftMotor="0\u00a0.1"/>'.encode(), Actions(left_motor=0.0)),
        # a byte order mark, also in later messages (the real simulator takes it in the first one only)
        (b'\xef\xbb\xbf<Actions LeftMotor="0.1" RightMotor="0.05"/>', DRIVE),
        (b'\xef\xbb\xbf<Actions LeftMotor="0.1"RightMotor="0.05"/>', DRIVE),
    ],
)  # fmt: skip
def test_actions_that_the_real_simulator_takes(data: bytes, expected: Actions | None) -> None:
    if expected is None:
        with pytest.raises(ProtocolError):
            decode_actions(data)
    else:
        assert decode_actions(data) == expected


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b'<Robot Id="1" Name="a" Id="2"/>', RobotRegistration(name="a", robot_id=2)),
        (b'<Robot Id="2"Name="a"><IRSensor Id="1"Angle="37"/></Robot>', RobotRegistration(
            name="a", robot_id=2, sensor_angles=((1, 37.0),)
        )),
        (b'<Robot Id="2" Name="a\x07&#1;b"/>', RobotRegistration(name="a??b", robot_id=2)),
        (b'<Robot Id="2" Name="a\tb\r\nc" Name="d\te\r\nf"/>', RobotRegistration(name="d e f", robot_id=2)),
        (b'<Robot Id="2" Name="a&lt;&#x41;" Name="&lt;&#65;"/>', RobotRegistration(name="<A", robot_id=2)),
        ('<Robot Id="\u00a02\u2003" Name="a"/>'.encode(), RobotRegistration(name="a", robot_id=2)),
        (b'<Robot Id="2" Name="a"><View/></Robot>', ViewRegistration()),
        (b"<!DOCTYPE x [<!ENTITY e '&#60;'>]><View/>", ViewRegistration()),
    ],
)  # fmt: skip
def test_registrations_that_the_real_simulator_takes(data: bytes, expected: object) -> None:
    assert decode_registration(data) == expected


def test_commands_of_views_are_looked_at_twice_as_well() -> None:
    assert decode_view_command(b"<!DOCTYPE GridReq><GridReq/>") == GridRequest()
    assert decode_view_command(b'<Robot Id="1" Id="3"Removed="Yes"/>') == RemoveRobot(robot_id=3)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b'<Actions LeftMotor="&x;" RightMotor="0.1"/>', "Actions LeftMotor: entities are not part"),
        (b"<Say>a&x;</Say>", "Say: entities are not part"),
        (b"<Actions><Say>a</Say>&x;</Actions>", "Say: entities are not part"),
        (b'<!DOCTYPE a [<!ENTITY x "y">]><Say>a&x;</Say>', "Say: entities are not part"),
        (BOMB + b"<Actions><Say>&j;</Say></Actions>", "Say: entities are not part"),
        (b'<!DOCTYPE a [<!ENTITY x SYSTEM "/etc/passwd">]><Say>&x;</Say>', "Say: entities are not part"),
    ],
)  # fmt: skip
def test_entities_that_matter_are_refused_with_a_note(data: bytes, complaint: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        decode_actions(data)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [
        b'<Actions LeftMotor="1" LeftMotor="2">',
        b'<Actions LeftMotor="1" LeftMotor=2/>',
        b'<Actions LeftMotor="1" LeftMotor/>',
        b'<Actions LeftMotor="1" LeftMotor="<"/>',
        b'<Actions LeftMotor="1" LeftMotor="2"></Action>',
        b'<Actions LeftMotor="1" LeftMotor="2"/><Actions/>',
        b'<Actions LeftMotor="1" LeftMotor="2"/> trailing',
        b'<Actions LeftMotor="1" LeftMotor="2"/>\x0b',
        b'\x01<Actions LeftMotor="1"/>',
        b"<Say>\x01&</Say>",
        b"<Say>\x01&x</Say>",
        b"<Say>\x01&#;</Say>",
        b"<Say>\x01]]></Say>",
        b"<Say>\x01<!-- -- --></Say>",
        b"<!DOCTYPE><Actions/>",
        b"<!DOCTYPE a <Actions/>",
        b"<!DOCTYPE a [<Actions/>",
        b'<!DOCTYPE a [<!ENTITY x "]><Actions/>',
        b"<!DOCTYPE a><!DOCTYPE a><Actions/>",
        b"<Actions>" * 17 + b"\x01" + b"</Actions>" * 17,
        b'<?xml version="1.0" encoding="utf-16"?><Say>\x01</Say>',
    ],
)
def test_what_is_broken_in_other_ways_stays_refused(data: bytes) -> None:
    with pytest.raises(ProtocolError):
        decode_actions(data)


def test_an_angle_that_a_beacon_robot_lacks_does_not_end_the_reading() -> None:
    with pytest.raises(PassedOverError):
        decode_registration(b'<RobotBeacon Id="1"><IRSensor Id="0"/></RobotBeacon>')
    with pytest.raises(ProtocolError) as caught:
        decode_registration(b'<RobotBeacon Id="1"><IRSensor Id="0" Angle="0"/></RobotBeacon>')
    assert not isinstance(caught.value, PassedOverError)


# --- by other methods ---------------------------------------------------------------------------------------


def shape(element: Element) -> tuple[object, ...]:
    children = [shape(child) for child in element.children]
    return element.name, element.attributes, element.text, element.tail, children


TAGS = ["<Say>", "</Say>", "<Say/>", "<Actions>", "</Actions>", "<a b='c'/>", '<a b="&lt;" c=" \t\n"/>']
TEXTS = [
    "&amp;",
    "&#65;",
    "&#x42;",
    "<!-- - -->",
    "<?p i?>",
    "<![CDATA[<&]]]>",
    "\r\n",
    "\r",
    "é",
    "]]",
    "x",
    " ",
]
BROKEN = ["<a b='1' b='2'/>", "<a b='1'c='2'/>", "&e;", "\x01", "&#0;", "<", ">", "<!DOCTYPE a>"]
PIECES = st.sampled_from([*TAGS, *TEXTS, *BROKEN])


@settings(max_examples=600, deadline=None)
@given(st.lists(PIECES, max_size=12))
def test_what_is_xml_is_read_as_the_strict_parser_reads_it(pieces: list[str]) -> None:
    data = ("<Actions>" + "".join(pieces) + "</Actions>").encode()
    try:
        expected = shape(parse_document(data, invalid_bytes="?"))
    except ProtocolError:
        return
    root = parse_tolerantly(data)
    assert root is not None
    assert shape(root) == expected


def strictly(data: bytes) -> bool:
    try:
        ParserCreate("utf-8").Parse(data, True)
    except ExpatError:
        return False
    return True


@settings(max_examples=600, deadline=None)
@given(st.lists(PIECES, max_size=12))
def test_every_message_that_is_taken_can_be_sent_on(pieces: list[str]) -> None:
    data = ("<Actions>" + "".join(pieces) + "</Actions>").encode()
    try:
        actions = decode_actions(data)
    except ProtocolError:
        return
    assert ENTITY not in (actions.say or "")
    assert strictly(encode(actions)[:-1])


def test_random_bytes_of_xml_never_break_the_second_look() -> None:
    rng = np.random.default_rng(11)
    letters = np.frombuffer(b"<>/!?-[]&;#x0a='\" \n\x01\xc3\xa9\xffDOCTYPE", np.uint8)
    taken = 0
    for _ in range(20_000):
        body = rng.choice(letters, rng.integers(0, 60)).tobytes()
        for data in (body, b"<Say>" + body + b"</Say>", b"<!DOCTYPE a [" + body + b"]><Say/>"):
            try:
                taken += parse_tolerantly(data) is not None
            except ProtocolError:
                continue
    assert taken > 100


HARDEST = [
    b"<!DOCTYPE a [" + b"<!---->" * 140,
    b"<!DOCTYPE a [" + b"<!--" * 250,
    b"<!DOCTYPE a " + b"''" * 490 + b"[",
    b"<!DOCTYPE a [" + b"\"'" * 500,
    b"<a" + b" b" * 500,
    b"<a" + b" b=''" * 200,
    b"<" + b"a" * 1000,
    b"<a " + b" " * 1000,
    b"<Say>" + b"&#1;" * 250,
    b"<Say>" + b"&a" * 500,
    b"<Say>" + b"<![CDATA[" * 110,
    b"<Say>" + b"<!-- -" * 160,
    b"<Say>" + b"<?a " * 250,
    b"<?xml " + b"?" * 1000,
    b"<Say>" * 200,
    b"<Say>\x01" + b"a" * 1000,
]


@pytest.mark.parametrize("data", HARDEST, ids=range(len(HARDEST)))
def test_the_second_look_is_never_slow(data: bytes) -> None:
    """A message as long as may be, in CPU time; what goes with a power of the length takes far longer."""
    data = data[:TOLERANCE_LIMIT]

    def look() -> None:
        with pytest.raises(ProtocolError):
            decode_actions(data, limit=None)

    assert any(cpu_seconds(look) < 1.0 for _ in range(5))


def test_what_is_longer_than_a_message_gets_no_second_look() -> None:
    start, end = b'<Actions LeftMotor="1" LeftMotor="2">', b"</Actions>"
    fill = TOLERANCE_LIMIT - len(start) - len(end)
    assert parse_tolerantly(start + b" " * fill + end) is not None
    assert parse_tolerantly(start + b" " * (fill + 1) + end) is None
