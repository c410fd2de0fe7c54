"""The binary protocol, word by word."""

from __future__ import annotations

import random
import struct

import pytest

from ciberrato.errors import ProtocolError
from ciberrato.protocol import Acceptance, Actions, BeaconReading, Measures, Refusal, encode
from ciberrato.protocol.binary import (
    decode_binary_actions,
    decode_binary_registration,
    encode_binary_measures,
    encode_binary_reply,
    is_binary_registration,
)
from ciberrato.world.parameters import Parameters


def words(data: bytes) -> list[int]:
    """Take it to pieces by hand."""
    return [256 * data[place] + data[place + 1] for place in range(0, len(data), 2)]


@pytest.mark.parametrize(
    ("name", "read"),
    [(b"mouse", "mouse"), (b"", ""), (b"x" * 20, "x" * 20), (b"\xe9\x01\0rest", "é?"), (b'<&">', '<&">')],
)
def test_registrations(name: bytes, read: str) -> None:
    data = b"\0\n" + name.ljust(20, b"\0")
    assert is_binary_registration(data)
    registration = decode_binary_registration(data)
    assert (registration.name, registration.robot_id) == (read, 0)
    assert len(encode(registration)) < 1023


@pytest.mark.parametrize(
    "data", [b"", b"\0\n", b"\0\n" + b"x" * 21, b"\0\x0b" + b"x" * 20, b"<View/>" + b" " * 15]
)
def test_what_is_no_registration(data: bytes) -> None:
    assert not is_binary_registration(data)
    with pytest.raises(ProtocolError):
        decode_binary_registration(data)


@pytest.mark.parametrize("thousandths", [-2000, -150, -1, 0, 1, 100, 150, 2000])
def test_motors_are_thousandths_above_minus_two(thousandths: int) -> None:
    actions = decode_binary_actions(struct.pack(">3H", thousandths + 2000, 2000, 0))
    assert actions.left_motor == pytest.approx(thousandths / 1000.0, abs=1e-12)
    assert (actions.right_motor, actions.end_led) == (0.0, None)


def test_any_end_but_0_is_the_end() -> None:
    for end in (1, 256, 65535):
        assert decode_binary_actions(struct.pack(">3H", 2000, 2000, end) + b"more").end_led
    for length in range(6):
        with pytest.raises(ProtocolError):
            decode_binary_actions(b"\x07" * length)


def test_random_actions_are_actions_in_xml_as_well() -> None:
    chance = random.Random(3)
    for _ in range(2000):
        actions = decode_binary_actions(chance.randbytes(chance.randrange(6, 40)))
        assert isinstance(actions, Actions)
        encode(actions)


def test_replies() -> None:
    accepted = encode_binary_reply(Acceptance(parameters=Parameters(cycle_time=75), n_beacons=0))
    assert (len(accepted), words(accepted)[:2]) == (22, [25, 75])
    assert (len(encode_binary_reply(Refusal())), words(encode_binary_reply(Refusal()))[0]) == (22, 26)


def test_measures() -> None:
    full = Measures(
        time=65540,
        collision=True,
        compass=-180.0,
        ground=2,
        infrared=(1.5, 12.3, -0.1, 9.9),
        beacons=(BeaconReading(beacon=0, bearing=-90.0), BeaconReading(beacon=1, bearing=7.0)),
        start=True,
        end_led=True,
    )
    assert words(encode_binary_measures(full)) == [4, 15, 65535, 123, 270, 180, 2, 1, 1, 0, 1]
    hidden = Measures(time=7, ground=-1, beacons=(BeaconReading(beacon=0, bearing=None),), stop=True)
    assert words(encode_binary_measures(hidden)) == [7, 0, 0, 0, 65535, 360, 65535, 0, 0, 1, 0]
