"""Registrations: what clients send to the main port, as frozen records, and their bytes.

Apart from the other messages: a robot registers before it needs those, and making them takes longer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ciberrato.errors import UsageError
from ciberrato.protocol.limits import REGISTRATION_LIMIT
from ciberrato.protocol.text import attribute, exact, within
from ciberrato.reprs import short_repr

DEFAULT_SENSOR_ANGLES = (0.0, 60.0, -60.0, 180.0)
"""Mounting angles in degrees of the IR sensors 0 to 3 unless a registration says otherwise."""


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class RobotRegistration:
    """A robot asks for a place.

    Attributes
    ----------
    name : str or None
    robot_id : int
        Position in the start grid, counted from 1; 0 and below = the first free one.
    sensor_angles : tuple of (int, float)
        (IR sensor id, mounting angle in degrees, counter-clockwise from the front), as sent.
    """

    __repr__ = short_repr

    name: str | None = None
    robot_id: int = 0
    sensor_angles: tuple[tuple[int, float], ...] = ()

    @property
    def angles(self) -> tuple[float, float, float, float]:
        """Angles of all four sensors, the defaults filled in; ids other than 0 to 3 are ignored."""
        angles = list(DEFAULT_SENSOR_ANGLES)
        for sensor, angle in self.sensor_angles:
            if 0 <= sensor < 4:
                angles[sensor] = angle
        return (angles[0], angles[1], angles[2], angles[3])


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class RobotBeaconRegistration:
    """A robot that carries a beacon asks for a place.

    Attributes
    ----------
    name : str or None
    robot_id : int
        As in `RobotRegistration`.
    height : float
        Height of the beacon.
    """

    __repr__ = short_repr

    name: str | None = None
    robot_id: int = 0
    height: float = 0.0


@dataclass(repr=False, frozen=True, slots=True)
class ViewRegistration:
    """A viewer requests all messages.

    Attributes
    ----------
    token : str or None
        Password of views, where the simulator wants one; the real one ignores it.
    """

    __repr__ = short_repr

    token: str | None = None


@dataclass(repr=False, frozen=True, slots=True)
class PanelRegistration:
    """A control panel registers; it gets a Reply and nothing else.

    Attributes
    ----------
    token : str or None
        As in `ViewRegistration`.
    """

    __repr__ = short_repr

    token: str | None = None


Registration = RobotRegistration | RobotBeaconRegistration | ViewRegistration | PanelRegistration


def encode_registration(message: Registration) -> bytes:
    """Encode a registration.

    Parameters
    ----------
    message : Registration

    Returns
    -------
    bytes
        The whole datagram; it ends in NUL.

    Raises
    ------
    UsageError
        If a text has characters that XML cannot carry, a number is not finite, or it is longer than a
        simulator reads.
    """
    return registration_to_xml(message).encode() + b"\0"


def registration_to_xml(message: Registration) -> str:
    """Write a registration without its terminator, see `encode_registration`."""
    if isinstance(message, RobotRegistration):
        return _robot(message)
    if isinstance(message, RobotBeaconRegistration):
        return _robot_beacon(message)
    return _onlooker("View" if isinstance(message, ViewRegistration) else "Panel", message.token)


def _robot(message: RobotRegistration) -> str:
    sensors = "".join(
        f'<IRSensor Id="{sensor:d}" Angle="{_finite(angle, "IRSensor Angle")}"/>'
        for sensor, angle in message.sensor_angles
    )
    start = f'<Robot Id="{message.robot_id:d}"{_named(message.name, "Robot Name")}'
    return within(f"{start}>{sensors}</Robot>" if sensors else f"{start}/>", REGISTRATION_LIMIT, "Robot")


def _robot_beacon(message: RobotBeaconRegistration) -> str:
    name = _named(message.name, "RobotBeacon Name")
    height = _finite(message.height, "RobotBeacon Height")
    text = f'<RobotBeacon Id="{message.robot_id:d}"{name} Height="{height}"/>'
    return within(text, REGISTRATION_LIMIT, "RobotBeacon")


def _onlooker(element: str, token: str | None) -> str:
    written = "" if token is None else f' Token="{attribute(token, f"{element} Token")}"'
    return within(f"<{element}{written}/>", REGISTRATION_LIMIT, element)


def _named(name: str | None, place: str) -> str:
    return "" if name is None else f' Name="{attribute(name, place)}"'


def _finite(value: float, place: str) -> str:
    if not math.isfinite(value):
        raise UsageError(f"{place}: {value} is not a finite number")
    return exact(value)
