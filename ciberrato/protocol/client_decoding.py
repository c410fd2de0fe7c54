"""Messages of clients, bytes to records, read as the real simulator reads them.

What is not well-formed XML gets a second, tolerant look (`ciberrato.protocol.tolerantxml`). Deliberate
differences: references to entities that XML does not predefine, where they matter, a NaN motor command, and
an angle or height that is not finite are refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

from ciberrato.errors import ProtocolError
from ciberrato.protocol.drafts import ActionsDraft
from ciberrato.protocol.limits import ACTIONS_LIMIT, REGISTRATION_LIMIT, VIEW_COMMAND_LIMIT
from ciberrato.protocol.messages import (
    Actions,
    GridRequest,
    LabRequest,
    RemoveRobot,
    Reset,
    Start,
    Stop,
    ViewCommand,
)
from ciberrato.protocol.registrations import (
    PanelRegistration,
    Registration,
    RobotBeaconRegistration,
    RobotRegistration,
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
_ROBOT_ELEMENTS = ("Actions", "SensorRequests", "Say")
# The shortest of these, with motors only, needs no pattern.
_LEFT, _RIGHT = b"<Actions LeftMotor=", b" RightMotor="
_ENDS = frozenset(blank + b"/>" + end for blank in (b"", b" ") for end in (b"", b"\0", b"\n", b"\n\0"))
_LED = {None: None, b"On": True, b"Off": False}


class PassedOverError(ProtocolError):
    """A message that is not answered, but does not end the reading of messages for the cycle either."""


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
    PassedOverError
        If it is one of those that do not keep the simulator from reading on.
    """
    root = _parse(message_bytes(data, limit))
    attributes = root.attributes
    if root.name == "Robot" and [child.name for child in root.children] == ["View"]:
        root = root.children[0]  # the real simulator goes by the last one that it meets
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
        if any(child.name == "IRSensor" and "Angle" not in child.attributes for child in root.children):
            raise PassedOverError("RobotBeacon: child element IRSensor is not known")
        _refuse_children(root)
        return RobotBeaconRegistration(
            name=attributes.get("Name"),
            robot_id=lenient_integer(attributes.get("Id", "0")),
            height=finite_real(attributes.get("Height", "0"), "RobotBeacon Height"),
        )
    if root.name == "View":
        _refuse_children(root)
        return ViewRegistration(root.attributes.get("Token"))
    if root.name == "Panel":
        _refuse_children(root)
        return PanelRegistration(root.attributes.get("Token"))
    raise ProtocolError(f"{shown(root.name)}: not a registration; Robot, RobotBeacon, View and Panel are")


def decode_actions(data: bytes, *, limit: int | None = ACTIONS_LIMIT) -> Actions:
    """Decode a datagram that came to a robot's port.

    Actions, SensorRequests and Say may be nested in any way, as in the real simulator. The text of several
    Say elements is joined, with what stands between the end of a Say and the next tag. An empty Say gives an
    empty text. Infinite motor commands are left for the simulation to clamp.

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
    parts = data.split(b'"', 5)
    if len(parts) == 5 and parts[4] in _ENDS and (limit is None or len(data) <= limit):
        before, left, between, right, _ = parts
        if before == _LEFT and between == _RIGHT and not (left + right).strip(b"0123456789.-"):
            try:
                return _actions(float(left), float(right))
            except ValueError:  # two points, or a sign in the middle
                pass
    plain = _PLAIN_ACTIONS.match(data)
    if plain and (limit is None or plain.end() <= limit):
        left, right, *leds = plain.groups()
        return _actions(float(left), float(right), *[_LED[led] for led in leds])
    root = _parse(message_bytes(data, limit))
    if root.name not in _ROBOT_ELEMENTS:
        raise ProtocolError(f"{shown(root.name)}: not for robots; Actions, SensorRequests and Say are")
    attributes: dict[str, str] = {}
    requests: list[str] = []
    say: str | None = None
    saying = False  # from the start of a Say to the next start tag
    for element, text in _walk(root):
        if element is not None:
            saying = element.name == "Say"
            if element.name == "Actions":
                attributes |= element.attributes
            elif element.name == "SensorRequests":
                requests.extend(name for name, value in element.attributes.items() if value == "Yes")
        if saying:
            say = (say or "") + text
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


def _actions(
    left: float,
    right: float,
    end_led: bool | None = None,
    returning_led: bool | None = None,
    visiting_led: bool | None = None,
) -> Actions:
    draft: Any = ActionsDraft()
    draft.left_motor = left
    draft.right_motor = right
    draft.end_led = end_led
    draft.returning_led = returning_led
    draft.visiting_led = visiting_led
    draft.requests = ()
    draft.say = None
    draft.reset = False
    draft.__class__ = Actions
    actions: Actions = draft
    return actions


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
    root = _parse(message_bytes(data, limit))
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


def _parse(data: bytes) -> Element:
    """Parse a client's message: strictly, and if that fails as the real simulator's parser does."""
    try:
        return parse_document(data, invalid_bytes="?")
    except ProtocolError:
        # Its patterns take 20 ms to compile, and a robot waits for that: clients decode nothing of clients.
        from ciberrato.protocol.tolerantxml import parse_tolerantly

        root = parse_tolerantly(data)
        if root is None:
            raise
        return root


def _walk(element: Element) -> Iterator[tuple[Element | None, str]]:
    """Yield the elements of a robot's message in the order of their start tags, nested in any way.

    Yields
    ------
    element : Element or None
        None after an end tag.
    text : str
        Text after the tag.

    Raises
    ------
    ProtocolError
        If an element is not one of those that robots may send.
    """
    yield element, element.text
    for child in element.children:
        if child.name not in _ROBOT_ELEMENTS:
            raise ProtocolError(
                f"{shown(element.name)}: child element {shown(child.name)} is not known; "
                "SensorRequests and Say are"
            )
        yield from _walk(child)
        yield None, child.tail


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
