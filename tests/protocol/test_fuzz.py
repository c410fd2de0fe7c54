"""Whatever comes in, only ProtocolError comes out."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    decode_actions,
    decode_registration,
    decode_simulator_message,
    decode_view_command,
    encode,
)
from tests.cpu import cpu_seconds

DECODERS = (decode_registration, decode_actions, decode_view_command, decode_simulator_message)


def decode_all(data):
    """Decode with all decoders and without limits; what is a message must be one that can be sent again."""
    taken = 0
    complaint = None
    for decode in DECODERS:
        keywords = {} if decode is decode_simulator_message else {"limit": None}
        try:
            message = decode(data, **keywords)
        except ProtocolError as error:
            complaint = str(error)
        else:
            taken += 1
            # The names of requested sensors may have letters that no sensor's name has.
            if len(data) < 900 and all(name.isascii() for name in getattr(message, "requests", ())):
                encode(message)
    assert complaint, "no datagram is a message on every port"
    assert "\n" not in complaint
    return taken


@settings(max_examples=400, deadline=None)
@given(st.binary(max_size=300))
def test_random_bytes(data):
    decode_all(data)


NAMES = ["Robot", "IRSensor", "View", "Actions", "SensorRequests", "Say", "Measures", "Sensors", "Reply"]
NAMES += [
    "Parameters",
    "Lab",
    "Wall",
    "Corner",
    "Beacon",
    "Grid",
    "Position",
    "Leds",
    "Buttons",
    "Message",
    "Score",
]
KEYS = [
    "Id",
    "Name",
    "Angle",
    "LeftMotor",
    "Time",
    "Status",
    "X",
    "Value",
    "From",
    "Removed",
    "Score",
    "SimTime",
]
VALUES = st.sampled_from(
    [
        "1",
        "-1",
        "",
        "nan",
        "-nan",
        "inf",
        "1e400",
        "9" * 30,
        "Ok",
        "Yes",
        "On",
        "é",
        "&#10;",
        "1_0",
        "²",
        "&lt;",
    ]
)


@st.composite
def documents(draw, depth=0):
    name = draw(st.sampled_from(NAMES))
    attributes = draw(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=4))
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    if depth == 3 or draw(st.booleans()):
        return f"<{name}{text}/>"
    inside = draw(
        st.lists(
            st.sampled_from(["text", " ", "<![CDATA[x]]>", "&amp;"]) | documents(depth=depth + 1), max_size=3
        )
    )
    return f"<{name}{text}>{''.join(inside)}</{name}>"


@settings(max_examples=400, deadline=None)
@given(documents(), st.sampled_from(["utf-8", "latin-1", "utf-16"]))
def test_random_documents_of_the_protocols_words(document, encoding):
    decode_all(document.encode(encoding, "replace"))


@pytest.fixture(scope="module")
def corpus(recorded_from_simulator, recorded_from_clients):
    """Recorded datagrams of different shapes, the same in each run."""
    shapes = {}
    for data in [*recorded_from_simulator, *recorded_from_clients]:
        shapes.setdefault((len(data) // 4, data[:6]), data)
    return list(shapes.values())


def test_recorded_datagrams_cut_anywhere(corpus):
    taken = 0
    for data in corpus:
        for end in range(0, len(data), max(1, len(data) // 60)):
            taken += decode_all(data[:end])
    assert taken < len(corpus) * 10, "most cut datagrams are no messages"


def test_recorded_datagrams_with_bits_flipped_and_bytes_moved(corpus):
    rng = np.random.default_rng(20240229)
    taken = 0
    for _ in range(6000):
        data = bytearray(corpus[rng.integers(len(corpus))])
        for _ in range(rng.integers(1, 4)):
            if not data:
                break
            position = int(rng.integers(len(data)))
            kind = rng.integers(4)
            if kind == 0:
                data[position] ^= 1 << int(rng.integers(8))
            elif kind == 1:
                data[position] = int(rng.integers(256))
            elif kind == 2:
                del data[position : position + int(rng.integers(1, 20))]
            else:
                other = corpus[rng.integers(len(corpus))]
                data[position:position] = other[: int(rng.integers(1, 60))]
        taken += decode_all(bytes(data))
    assert taken > 100, "some of them stay messages"


@pytest.mark.parametrize(
    "data",
    [
        b"\xff" * 65507,
        b"<" * 65507,
        b"<a>" * 21_000,
        b"<Measures>" * 6_000,
        b"<Robot>" + b"<IRSensor Id='1' Angle='1'/>" * 2_000 + b"</Robot>",
        b"<Actions>" + b"<Say>x</Say>" * 5_000 + b"</Actions>",
        b"<Actions><SensorRequests " + b" ".join(b'a%d="Yes"' % n for n in range(5_000)) + b"/></Actions>",
        b'<Measures Time="' + b"1" * 65_000 + b'"/>',
        b'<Measures Time="1"><Sensors Compass="' + b"1" * 65_000 + b'x"/></Measures>',
        b'<Measures Time="1"><Sensors Compass="1.' + b"1" * 65_000 + b'"/></Measures>',
        b'<Actions LeftMotor="' + b"1" * 65_000 + b'e"/>',
        b'<Robot Id="' + b" " * 65_000 + b'1"/>',
        b"<?xml " + b"encoding " * 7_000,
        b"<?xml version='1.0' encoding='" + b"a" * 65_000 + b"'?><View/>",
        b"<Say>" + b"&amp;" * 13_000 + b"</Say>",
        b"<Say>" + b"]]" * 30_000 + b"</Say>",
        b"<!--" + b"--" * 30_000 + b"-->",
        b'<Measures Time="1">\n' * 3_000,
        b'<Measures Time="1">\n\t<Sensors>\n' + b'\t\t<BeaconSensor Id="1" Value="1"/>\n' * 1_800,
        "é".encode() * 30_000,
    ],
    ids=itertools.count(),
)
def test_large_datagrams_do_not_take_long(data):
    """Nothing grows with the square of the size: 64 kB in well under a second (measured in CPU time)."""
    assert any(cpu_seconds(lambda: decode_all(data)) < 1.0 for _ in range(5))
