"""Messages of simulators and log players, bytes to records.

Lenient where the real clients are: sensors may be missing, unknown attributes and elements do not matter, the
Parameters may be short. Strict where they are: what is there is complete, numbers are numbers, an accepted
registration announces its Parameters.
"""

from __future__ import annotations

from ciberrato.errors import ProtocolError
from ciberrato.protocol.lab_text import grid_from_element, lab_from_element
from ciberrato.protocol.measures_text import measures_from_element, measures_from_layout
from ciberrato.protocol.messages import (
    Acceptance,
    Refusal,
    Restart,
    RobotStatus,
    SimulatorMessage,
)
from ciberrato.protocol.parameters_text import decode_parameters
from ciberrato.protocol.text import required, shown, strict_integer, strict_real
from ciberrato.protocol.xmltree import Element, message_bytes, parse_document


def decode_simulator_message(data: bytes) -> SimulatorMessage:
    """Decode a datagram that came from a simulator.

    Parameters
    ----------
    data : bytes
        The whole datagram, with or without its terminator; what follows the first NUL does not count. Bytes
        that are not UTF-8 are taken as Latin-1, which is what the real simulator sends.

    Returns
    -------
    SimulatorMessage

    Raises
    ------
    ProtocolError
        If it is none of the messages of a simulator.
    """
    measures = measures_from_layout(data)
    if measures is not None:
        return measures
    root = parse_document(message_bytes(data), invalid_bytes="latin-1")
    if root.name == "Measures":
        return measures_from_element(root)
    if root.name == "Robot":
        return _status(root)
    if root.name == "Reply":
        return _reply(root)
    if root.name == "Lab":
        return lab_from_element(root)
    if root.name == "Grid":
        return grid_from_element(root)
    if root.name == "Restart":
        return Restart()
    raise ProtocolError(
        f"{shown(root.name)}: not a simulator's; Reply, Measures, Robot, Lab, Grid and Restart are"
    )


def _reply(root: Element) -> Acceptance | Refusal:
    if required(root.attributes, "Reply", "Status") != "Ok":
        return Refusal()
    for child in root.children:
        if child.name == "Parameters":
            parameters, n_beacons = decode_parameters(child.attributes)
            lockstep = root.attributes.get("Lockstep") == "On"
            return Acceptance(parameters=parameters, n_beacons=n_beacons, lockstep=lockstep)
    raise ProtocolError("Reply: child element Parameters is missing")


def _status(root: Element) -> RobotStatus:
    attributes = root.attributes

    def integer(name: str, default: str = "0") -> int:
        return strict_integer(attributes.get(name, default), f"Robot {name}")

    position: dict[str, str] = {}
    for child in root.children:
        if child.name == "Position":
            position = child.attributes
    score = integer("Score")
    return RobotStatus(
        name=attributes.get("Name", ""),
        robot_id=strict_integer(required(attributes, "Robot", "Id"), "Robot Id"),
        time=integer("Time"),
        # The wire has 32 bits without sign.
        score=score - 2**32 if 2**31 <= score < 2**32 else score,
        arrival_time=integer("ArrivalTime"),
        returning_time=integer("ReturningTime"),
        collisions=integer("Collisions"),
        collision=attributes.get("Collision") == "True",
        visited_mask=attributes.get("VisitedMask", ""),
        state=required(attributes, "Robot", "State"),
        x=strict_real(position.get("X", "0"), "Position X"),
        y=strict_real(position.get("Y", "0"), "Position Y"),
        direction_deg=strict_real(position.get("Dir", "0"), "Position Dir"),
    )
