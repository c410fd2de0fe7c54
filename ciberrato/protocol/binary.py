"""The binary protocol of the oldest agents: unsigned words of 16 bits, most significant byte first.

It carries what the first robots had: two motors, three obstacle sensors, one beacon, compass and ground. An
agent is answered in it that registers in it.
"""

from __future__ import annotations

import struct

from ciberrato.errors import ProtocolError
from ciberrato.protocol.messages import (
    Acceptance,
    Actions,
    Measures,
    Refusal,
)
from ciberrato.protocol.registrations import RobotRegistration
from ciberrato.protocol.text import NOT_XML

REGISTER, ACCEPTED, REFUSED = 10, 25, 26
"""First words of a registration and of the answers to it."""

NOT_VISIBLE = 0xFFFF
"""In the place of a beacon's bearing."""

_REGISTRATION = struct.Struct(">H20s")
_REPLY = struct.Struct(">2H18x")
_ACTIONS = struct.Struct(">3H")
_MEASURES = struct.Struct(">11H")


def is_binary_registration(data: bytes) -> bool:
    """Return whether a datagram to the main port is one: by its length and its first word."""
    return len(data) == _REGISTRATION.size and data.startswith(REGISTER.to_bytes(2, "big"))


def decode_binary_registration(data: bytes) -> RobotRegistration:
    """Decode a registration: a name of up to 20 letters in Latin-1, for the first free position.

    Raises
    ------
    ProtocolError
        If it is none.
    """
    if not is_binary_registration(data):
        raise ProtocolError(
            f"not a binary registration: {_REGISTRATION.size} bytes, the first word {REGISTER}"
        )
    name: bytes = _REGISTRATION.unpack(data)[1]
    return RobotRegistration(name=NOT_XML.sub("?", name.partition(b"\0")[0].decode("latin-1")))


def decode_binary_actions(data: bytes) -> Actions:
    """Decode what a robot sends: left and right motor as (power + 2) 1000, and whether it has finished.

    Parameters
    ----------
    data : bytes
        Bytes of the message; those after the third word do not count.

    Raises
    ------
    ProtocolError
        If it is shorter than three words.
    """
    if len(data) < _ACTIONS.size:
        raise ProtocolError(f"binary actions of {len(data)} bytes; there must be {_ACTIONS.size}")
    left, right, end = _ACTIONS.unpack_from(data)
    return Actions(
        left_motor=left / 1000.0 - 2.0, right_motor=right / 1000.0 - 2.0, end_led=bool(end) or None
    )


def encode_binary_reply(reply: Acceptance | Refusal) -> bytes:
    """Encode the answer to a registration; it holds only the cycle time, in ms."""
    if isinstance(reply, Refusal):
        return _REPLY.pack(REFUSED, 0)
    return _REPLY.pack(ACCEPTED, _word(reply.parameters.cycle_time))


def encode_binary_measures(measures: Measures) -> bytes:
    """Encode what a robot measures.

    The words are time; ten times the readings of IR sensors 0, 2 and 1; the bearing of beacon 0 and the
    compass, each in degrees plus 360; ground, -1 as 65535; collision, start, stop and EndLed as 0 or 1. What
    the message does not have reads as 0, a beacon that is not visible, or not there, as `NOT_VISIBLE`.
    """
    tenths = [round(10.0 * (reading or 0.0)) for reading in measures.infrared]
    bearing = next((beacon.bearing for beacon in measures.beacons if beacon.beacon == 0), None)
    words = (
        *(measures.time, tenths[0], tenths[2], tenths[1]),
        NOT_VISIBLE if bearing is None else round(bearing) + 360,
        round(measures.compass or 0.0) + 360,
        -1 if measures.ground is None else measures.ground,
        *(bool(measures.collision), measures.start, measures.stop, measures.end_led),
    )
    return _MEASURES.pack(*(_word(word) for word in words))


def _word(number: int) -> int:
    """Return the lowest 16 bits, as C does."""
    return number & 0xFFFF
