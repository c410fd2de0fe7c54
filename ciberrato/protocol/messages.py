"""Every message of the protocol as a frozen record. `Lab` and `StartGrid` are messages too.

Values are those on the wire: degrees, units, cycles. What is absent on the wire is None (or empty).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ciberrato.protocol.registrations import Registration
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

# --- robot to simulator --------------------------------------------------------------------------


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class Actions:
    """Commands of a robot; None leaves things as they are.

    Attributes
    ----------
    left_motor, right_motor : float or None
        Motor commands in units per cycle, before clamping.
    end_led, returning_led, visiting_led : bool or None
    requests : tuple of str
        Names of the sensors asked for, in the order of the wire (``IRSensor0``, ``Beacon1``, ``Compass``).
    say : str or None
        Text for the robots around.
    reset : bool
        Ask the simulator to start the world again.
    """

    __repr__ = short_repr

    left_motor: float | None = None
    right_motor: float | None = None
    end_led: bool | None = None
    returning_led: bool | None = None
    visiting_led: bool | None = None
    requests: tuple[str, ...] = ()
    say: str | None = None
    reset: bool = False


# --- viewer to simulator -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LabRequest:
    """Send me the lab."""


@dataclass(frozen=True, slots=True)
class GridRequest:
    """Send me the start grid."""


@dataclass(frozen=True, slots=True)
class Start:
    """Start, or go on after a Stop."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Pause."""


@dataclass(frozen=True, slots=True)
class Reset:
    """Forget all robots and views and begin again."""


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class RemoveRobot:
    """Take a robot out of the world.

    Attributes
    ----------
    robot_id : int
    """

    __repr__ = short_repr

    robot_id: int


ViewCommand = LabRequest | GridRequest | Start | Stop | Reset | RemoveRobot

# --- simulator to client -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Refusal:
    """The registration is refused."""


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class Acceptance:
    """The registration is accepted.

    Attributes
    ----------
    parameters : Parameters
    n_beacons : int
        Number of beacons in the lab.
    lockstep : bool
        Whether the simulator says that it waits for every answer. The real one, which never does, does not
        know the attribute.
    """

    __repr__ = short_repr

    parameters: Parameters
    n_beacons: int = 0
    lockstep: bool = False


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class BeaconReading:
    """Reading of a beacon sensor.

    Attributes
    ----------
    beacon : int
        The beacon's number, from 0.
    bearing : float or None
        Degrees from the robot's heading; None = not visible.
    """

    __repr__ = short_repr

    beacon: int
    bearing: float | None


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class HeardMessage:
    """Message of another robot (or this one) in this cycle.

    Attributes
    ----------
    sender : int
        The speaker's position number.
    text : str
    """

    __repr__ = short_repr

    sender: int
    text: str


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class ScoreReading:
    """The score sensor.

    Attributes
    ----------
    score : int
    arrival_time, returning_time : int
        Cycles.
    collisions : int
        Number of collisions so far.
    collision : bool
        Whether one is going on.
    visited_mask : str
        One digit a target.
    """

    __repr__ = short_repr

    score: int = 0
    arrival_time: int = 0
    returning_time: int = 0
    collisions: int = 0
    collision: bool = False
    visited_mask: str = ""


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class OtherReading:
    """An element in Sensors that this protocol does not know: a sensor that others wrote.

    Attributes
    ----------
    name : str
        Name of the element.
    values : tuple of (str, str)
        Its attributes, as on the wire.
    """

    __repr__ = short_repr

    name: str
    values: tuple[tuple[str, str], ...]


SensorElement = tuple[str, dict[str, type]]
"""Form of a sensor's reading in Measures: as an element in Sensors, after the beacons.

Its name, and names and kinds (float, int or str) of its attributes, in the order in which they are written.
With one attribute the reading is its value, with several a tuple of them.
"""


def sent_as(name: str, **attributes: type) -> Any:
    """Return the field of a sensor that is sent as an element of its own; None where it is not sent."""
    return field(default=None, metadata={"element": (name, attributes)})


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class Measures:
    """Readings of a robot's sensors after a cycle.

    Attributes
    ----------
    time : int
        Simulated cycles so far.
    start, stop : bool
        The buttons: whether the coming state of the simulator is Running, or Stopped.
    end_led, returning_led, visiting_led : bool
        As last commanded.
    collision : bool or None
    compass : float or None
        Degrees.
    ground : int or None
        Number of the target that the robot is in, -1 for none.
    infrared : tuple of four (float or None)
        Readings of the IR sensors 0 to 3, about 1/distance.
    beacons : tuple of BeaconReading
    gps : (float, float) or None
        x, y in units, with an offset unknown to the robot.
    line : str or None
        Seven characters 0 or 1, leftmost element first.
    messages : tuple of HeardMessage
    score : ScoreReading or None
    others : tuple of OtherReading
        Sensors that this protocol does not know; `other` looks one up.
    """

    __repr__ = short_repr

    time: int
    start: bool = False
    stop: bool = False
    end_led: bool = False
    returning_led: bool = False
    visiting_led: bool = False
    collision: bool | None = None
    compass: float | None = None
    ground: int | None = None
    infrared: tuple[float | None, float | None, float | None, float | None] = (None, None, None, None)
    beacons: tuple[BeaconReading, ...] = ()
    gps: tuple[float, float] | None = sent_as("GPS", X=float, Y=float)
    line: str | None = sent_as("LineSensor", Value=str)
    messages: tuple[HeardMessage, ...] = ()
    score: ScoreReading | None = None
    others: tuple[OtherReading, ...] = ()

    def other(self, name: str) -> dict[str, str] | None:
        """Return the attributes of an element of `others`, as text; None if there is none of that name."""
        return next((dict(reading.values) for reading in self.others if reading.name == name), None)


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class RobotStatus:
    """State of a robot in a cycle, as viewers receive it.

    Attributes
    ----------
    name : str
    robot_id : int
    time : int
        Simulated cycles so far.
    score : int
        Signed; the wire wraps it to 32 bits without sign, as the real simulator does.
    arrival_time, returning_time, collisions : int
    collision : bool
    visited_mask : str
    state : str
        ``Stopped``, ``Running``, ``Waiting``, ``Returning``, ``Finished`` or ``Removed``.
    x, y : float
        True position in units.
    direction_deg : float
        True heading in degrees.
    """

    __repr__ = short_repr

    name: str
    robot_id: int
    time: int = 0
    score: int = 0
    arrival_time: int = 0
    returning_time: int = 0
    collisions: int = 0
    collision: bool = False
    visited_mask: str = ""
    state: str = "Stopped"
    x: float = 0.0
    y: float = 0.0
    direction_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Restart:
    """The simulator was reset: views must register again."""


SimulatorMessage = Refusal | Acceptance | Measures | Lab | StartGrid | RobotStatus | Restart
ClientMessage = Registration | Actions | ViewCommand
