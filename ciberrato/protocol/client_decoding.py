"""What clients send, bytes to records, read as the real simulator reads it.

Deliberate differences: a duplicate attribute, a document type, a NaN motor command, and an angle or height
that is not finite are refused.
"""

from __future__ import annotations

import math
import re

from ciberrato.errors import ProtocolError
from ciberrato.protocol.limits import ACTIONS_LIMIT, REGISTRATION_LIMIT, VIEW_COMMAND_LIMIT
from ciberrato.protocol.messages import (
    Actions,
    GridRequest,
    LabRequest,
    PanelRegistration,
    Registration,
    RemoveRobot,
    Reset,
    RobotBeaconRegistration,
    RobotRegistration,
    Start,
    Stop,
    ViewCommand,
    ViewRegistration,
)
from ciberrato.protocol.text import finite_real, lenient_integer, lenient_real, shown
from ciberrato.protocol.xmltree import Element, message_bytes, parse_document

_COMMANDS: dict[str, ViewCommand] = {
    "LabReq": LabRequest(),
    "GridReq": GridRequest(),
    "Start": Start(),
    "Stop": Stop(),
    "Reset": Reset(),
}

_NUMBER = rb"(-?[0-9]{1,9}(?:\.[0-9]{0,25})?(?:e[+-]?[0-9]{1,3})?)"
# What nearly every cycle brings, from our agent and from the Python, Java and C++ clients.
_PLAIN_ACTIONS = re.compile(
    rb'<Actions LeftMotor="' + _NUMBER + rb'" RightMotor="' + _NUMBER + rb'"'
    rb'(?: EndLed="(On|Off)")?(?: ReturningLed="(On|Off)")?(?: VisitingLed="(On|Off)")?'
    rb" ?/>[ \t\r\n]*(?:\0|\Z)"
)
_LED = {None: None, b"On": True, b"Off": False}


def decode_registration(data: bytes, *, limit: int | None = REGISTRATION_LIMIT) -> Registration:
    """Decode a datagram that came to the main port.

    Parameters
    ----------
    data : bytes
        The whole datagram; what follows the first NUL does not count.
    limit : int or None
        Bytes that are read; the rest is lost, which mostly leaves no XML.

    Returns
    -------
    Registration

    Raises
    ------
    ProtocolError
        If it is no registration. The real simulator does not answer these.
    """
    root = parse_document(message_bytes(data, limit), invalid_bytes="?")
    attributes = root.attributes
    if root.name == "Robot":
        angles = []
        for child in root.children:
            if child.name != "IRSensor":
                raise ProtocolError(
                    f"Robot: child element {shown(child.name)} is not known; only IRSensor is"
                )
            _refuse_children(child)
            sensor, angle = child.attributes.get("Id"), child.attributes.get("Angle")
            if sensor is not None and angle is not None:
                angles.append((lenient_integer(sensor), finite_real(angle, "IRSensor Angle")))
        return RobotRegistration(
            name=attributes.get("Name"),
            robot_id=lenient_integer(attributes.get("Id", "0")),
            sensor_angles=tuple(angles),
        )
    if root.name == "RobotBeacon":
        _refuse_children(root)
        return RobotBeaconRegistration(
            name=attributes.get("Name"),
            robot_id=lenient_integer(attributes.get("Id", "0")),
            height=finite_real(attributes.get("Height", "0"), "RobotBeacon Height"),
        )
    if root.name == "View":
        _refuse_children(root)
        return ViewRegistration()
    if root.name == "Panel":
        _refuse_children(root)
        return PanelRegistration()
    raise ProtocolError(f"{shown(root.name)}: not a registration; Robot, RobotBeacon, View and Panel are")


def decode_actions(data: bytes, *, limit: int | None = ACTIONS_LIMIT) -> Actions:
    """Decode a datagram that came to a robot's port.

    The text of several Say elements is joined, with what stands between the end of a Say and the next tag. An
    empty Say gives an empty text. Infinite motor commands are left for the simulation to clamp.

    Parameters
    ----------
    data : bytes
        The whole datagram; what follows the first NUL does not count.
    limit : int or None
        Bytes that are read; the rest is lost, which mostly leaves no XML.

    Returns
    -------
    Actions

    Raises
    ------
    ProtocolError
        If the roots Actions, SensorRequests and Say are not what it has, or a motor command is NaN.
    """
    plain = _PLAIN_ACTIONS.match(data)
    if plain and (limit is None or plain.end() <= limit):
        left, right, end_led, returning_led, visiting_led = plain.groups()
        return Actions(
            left_motor=float(left),
            right_motor=float(right),
            end_led=_LED[end_led],
            returning_led=_LED[returning_led],
            visiting_led=_LED[visiting_led],
        )
    root = parse_document(message_bytes(data, limit), invalid_bytes="?")
    if root.name == "Actions":
        attributes, parts = root.attributes, root.children
    elif root.name in ("SensorRequests", "Say"):
        attributes, parts = {}, [root]
    else:
        raise ProtocolError(f"{shown(root.name)}: not for robots; Actions, SensorRequests and Say are")
    requests: list[str] = []
    say: str | None = None
    for part in parts:
        _refuse_children(part)
        if part.name == "SensorRequests":
            requests.extend(name for name, value in part.attributes.items() if value == "Yes")
        elif part.name == "Say":
            say = (say or "") + part.text + part.tail
        else:
            raise ProtocolError(
                f"Actions: child element {shown(part.name)} is not known; SensorRequests and Say are"
            )
    return Actions(
        left_motor=_motor(attributes, "LeftMotor"),
        right_motor=_motor(attributes, "RightMotor"),
        end_led=_led(attributes, "EndLed"),
        returning_led=_led(attributes, "ReturningLed"),
        visiting_led=_led(attributes, "VisitingLed"),
        requests=tuple(requests),
        say=say,
        reset=attributes.get("Reset") == "On",
    )


def decode_view_command(data: bytes, *, limit: int | None = VIEW_COMMAND_LIMIT) -> ViewCommand:
    """Decode a datagram that came to a viewer's port.

    Parameters
    ----------
    data : bytes
        The whole datagram; what follows the first NUL does not count.
    limit : int or None
        Bytes that are read; the rest is lost, which mostly leaves no XML.

    Returns
    -------
    ViewCommand

    Raises
    ------
    ProtocolError
        If it is no command.
    """
    root = parse_document(message_bytes(data, limit), invalid_bytes="?")
    _refuse_children(root)
    if root.name == "Robot":
        if root.attributes.get("Removed") != "Yes":
            raise ProtocolError('Robot: attribute Removed="Yes" is missing; removal is all a viewer may ask')
        return RemoveRobot(robot_id=lenient_integer(root.attributes.get("Id", "0")))
    command = _COMMANDS.get(root.name)
    if command is None:
        raise ProtocolError(
            f"{shown(root.name)}: not a command; LabReq, GridReq, Start, Stop, Reset and Robot are"
        )
    return command


def _refuse_children(element: Element) -> None:
    if element.children:
        raise ProtocolError(
            f"{shown(element.name)}: child element {shown(element.children[0].name)} is not known"
        )


def _motor(attributes: dict[str, str], name: str) -> float | None:
    text = attributes.get(name)
    if text is None:
        return None
    power = lenient_real(text)
    if math.isnan(power):
        raise ProtocolError(f"Actions {name}: {shown(text.strip())!r} is not a motor command")
    return power


def _led(attributes: dict[str, str], name: str) -> bool | None:
    text = attributes.get(name)
    return None if text is None else text == "On"
