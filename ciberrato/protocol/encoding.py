"""Records to the final bytes of a datagram, terminator included."""

from __future__ import annotations

import math
import posixpath
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.protocol.lab_text import grid_to_xml, lab_to_xml
from ciberrato.protocol.limits import ACTIONS_LIMIT, REPLY_LIMIT
from ciberrato.protocol.measures_text import measures_to_xml
from ciberrato.protocol.messages import (
    Acceptance,
    Actions,
    ClientMessage,
    GridRequest,
    LabRequest,
    Measures,
    Refusal,
    RemoveRobot,
    Reset,
    Restart,
    RobotStatus,
    SimulatorMessage,
    Start,
    Stop,
)
from ciberrato.protocol.parameters_text import encode_parameters
from ciberrato.protocol.registrations import (
    PanelRegistration,
    RobotBeaconRegistration,
    RobotRegistration,
    ViewRegistration,
    registration_to_xml,
)
from ciberrato.protocol.text import attribute, cdata, exact, general, within
from ciberrato.world.lab import Lab
from ciberrato.world.start_grid import StartGrid

_NAME = re.compile(r"[A-Za-z_:][A-Za-z0-9_.:-]*")

_STATUS = """\
<Robot Name="%s" Id="%d" Time="%d" Score="%d" ArrivalTime="%d" ReturningTime="%d" Collisions="%d" \
Collision="%s" VisitedMask="%s" State="%s">
\t<Position X="%s" Y="%s" Dir="%s"/>
</Robot>
"""


def encode(message: ClientMessage | SimulatorMessage) -> bytes:
    r"""Encode a message.

    Parameters
    ----------
    message : ClientMessage or SimulatorMessage

    Returns
    -------
    bytes
        The whole datagram. It ends in NUL; a simulator's messages, Restart excepted, end in newline and NUL.

    Raises
    ------
    UsageError
        If a text has characters that XML cannot carry, a number is not finite where it has to be, or a
        registration or Actions is longer than a simulator reads.
    """
    if type(message) is Measures:  # by far the most frequent
        return (measures_to_xml(message) + "\0").encode()
    try:
        encoder = _ENCODERS[type(message)]
    except KeyError:
        raise TypeError(f"{type(message).__name__} is not a message") from None
    data: bytes = encoder(message).encode() + b"\0"
    return data


def fit_reply(acceptance: Acceptance) -> Acceptance:
    """Return the acceptance with its Reply short enough for the Python and Java clients.

    They read 1024 bytes. Where the names of the lab and grid files make it longer, the folders are left out,
    and if that is not enough the names too; no known client reads them.
    """
    if len(encode(acceptance)) <= REPLY_LIMIT:
        return acceptance
    parameters = acceptance.parameters
    lab_file, grid_file = _file_name(parameters.lab_file), _file_name(parameters.grid_file)
    shorter = replace(acceptance, parameters=replace(parameters, lab_file=lab_file, grid_file=grid_file))
    if len(encode(shorter)) <= REPLY_LIMIT:
        return shorter
    return replace(acceptance, parameters=replace(parameters, lab_file=None, grid_file=None))


def _file_name(path: str | None) -> str | None:
    return None if path is None else posixpath.basename(path.replace("\\", "/"))


def _actions(message: Actions) -> str:
    m = message
    pieces = ["<Actions"]
    for name, power in (("LeftMotor", m.left_motor), ("RightMotor", m.right_motor)):
        if power is not None:
            if math.isnan(power):
                raise UsageError(f"Actions {name}: NaN is not a motor command")
            pieces.append(f' {name}="{exact(power)}"')
    for name, led in (
        ("EndLed", m.end_led),
        ("ReturningLed", m.returning_led),
        ("VisitingLed", m.visiting_led),
    ):
        if led is not None:
            pieces.append(f' {name}="{"On" if led else "Off"}"')
    if m.reset:
        pieces.append(' Reset="On"')
    if not m.requests and m.say is None:
        pieces.append("/>")
    else:
        pieces.append(">")
        pieces.append(_requests(m.requests))
        if m.say is not None:
            pieces.append(f"<Say>{cdata(m.say, 'Say')}</Say>")
        pieces.append("</Actions>")
    return within("".join(pieces), ACTIONS_LIMIT, "Actions")


def _requests(names: tuple[str, ...]) -> str:
    """Write SensorRequests; a name that comes again needs an element of its own."""
    groups: list[dict[str, None]] = []
    for name in names:
        if not _NAME.fullmatch(name):
            raise UsageError(f"SensorRequests: {name!r} is not the name of a sensor")
        if not groups or name in groups[-1]:
            groups.append({})
        groups[-1][name] = None
    return "".join("<SensorRequests" + "".join(f' {name}="Yes"' for name in group) + "/>" for group in groups)


def _reply(message: Acceptance) -> str:
    parameters = encode_parameters(message.parameters, message.n_beacons)
    lockstep = ' Lockstep="On"' * message.lockstep
    return f'<Reply Status="Ok"{lockstep}>\n\t{parameters}</Reply>\n'


def _status(message: RobotStatus) -> str:
    m = message
    return _STATUS % (
        attribute(m.name, "Robot Name"),
        m.robot_id,
        m.time & 0xFFFFFFFF,
        m.score & 0xFFFFFFFF,
        m.arrival_time & 0xFFFFFFFF,
        m.returning_time & 0xFFFFFFFF,
        m.collisions & 0xFFFFFFFF,
        "True" if m.collision else "False",
        attribute(m.visited_mask, "Robot VisitedMask"),
        attribute(m.state, "Robot State"),
        general(m.x),
        general(m.y),
        general(m.direction_deg),
    )


_ENCODERS: dict[type, Callable[[Any], str]] = {
    RobotRegistration: registration_to_xml,
    RobotBeaconRegistration: registration_to_xml,
    ViewRegistration: registration_to_xml,
    PanelRegistration: registration_to_xml,
    Actions: _actions,
    LabRequest: lambda _: "<LabReq/>",
    GridRequest: lambda _: "<GridReq/>",
    Start: lambda _: "<Start/>",
    Stop: lambda _: "<Stop/>",
    Reset: lambda _: "<Reset/>",
    RemoveRobot: lambda m: f'<Robot Id="{m.robot_id:d}" Removed="Yes"/>',
    Refusal: lambda _: '<Reply Status="Refused"></Reply>\n',
    Acceptance: _reply,
    Measures: measures_to_xml,
    Lab: lab_to_xml,
    StartGrid: grid_to_xml,
    RobotStatus: _status,
    Restart: lambda _: "<Restart/>",
}
