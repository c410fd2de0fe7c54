"""The records of the overlay protocol, and its limits."""

from __future__ import annotations

from dataclasses import dataclass

from ciberrato.arrays import Floats
from ciberrato.reprs import short_repr

VERSION = 1
"""Version of the format; a viewer refuses others."""

OVERLAY_PORT = 6001
"""UDP port on which a viewer listens by default."""

MOST_BYTES = 65507
"""The longest UDP datagram."""

MOST_CELLS = 12_000
"""Cells of a belief: what fits into a datagram as base64."""

MOST_SHAPES = 200
"""Shapes in one message."""

MOST_POINTS = 500
"""Points of one line or polygon."""

MOST_TEXT = 200
"""Characters of a text, a label, an id or a source's name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Fields of all shapes; use one of the kinds below.

    Attributes
    ----------
    id : str
        A shape replaces the earlier one of the same source and id.
    color : str or None
        ``#rrggbb``; None = the colour of the robot.
    label : str
        Text beside it.
    ttl : float or None
        Seconds after which it disappears unless sent again; None = never.
    """

    __repr__ = short_repr

    id: str
    color: str | None = None
    label: str = ""
    ttl: float | None = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(Shape):
    """A circle; lengths in lab units.

    Attributes
    ----------
    x, y, radius : float
    """

    __repr__ = short_repr

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Line(Shape):
    """An open line through points.

    Attributes
    ----------
    points : tuple of (x, y)
        At least two.
    """

    __repr__ = short_repr

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Polygon(Shape):
    """A closed, filled outline.

    Attributes
    ----------
    points : tuple of (x, y)
        At least two.
    """

    __repr__ = short_repr

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrow(Shape):
    """An arrow that begins at a point.

    Attributes
    ----------
    x, y, length : float
    direction : float
        Degrees, counter-clockwise from +x.
    """

    __repr__ = short_repr

    x: float
    y: float
    direction: float
    length: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipse(Shape):
    """An ellipse, such as the outline of a covariance.

    Attributes
    ----------
    x, y : float
    radii : (float, float)
        Half axes: along `direction`, and across it.
    direction : float
        Degrees, counter-clockwise from +x.
    """

    __repr__ = short_repr

    x: float
    y: float
    radii: tuple[float, float]
    direction: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Text(Shape):
    """Words on the floor.

    Attributes
    ----------
    x, y : float
        Middle of the text.
    text : str
    """

    __repr__ = short_repr

    x: float
    y: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseMark(Shape):
    """Pose that the agent believes the robot to have: drawn as the ghost of a robot.

    Attributes
    ----------
    x, y : float
    direction : float
        Degrees, counter-clockwise from +x.
    """

    __repr__ = short_repr

    x: float
    y: float
    direction: float


KINDS: dict[str, type[Shape]] = {
    "circle": Circle,
    "line": Line,
    "polygon": Polygon,
    "arrow": Arrow,
    "ellipse": Ellipse,
    "text": Text,
    "pose": PoseMark,
}
"""Kinds of shapes by their names in the datagram."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridBelief:
    """Probabilities of the cells of a grid laid over the lab.

    Attributes
    ----------
    cells : array, shape (rows, columns)
        Not negative, with a positive sum (a viewer divides by it); row 0 is the bottom row.
    extent : tuple of four float, or None
        Left, bottom, right and top of the grid in units; None = the whole lab.
    """

    __repr__ = short_repr

    cells: Floats
    extent: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OverlayMessage:
    """One datagram.

    Attributes
    ----------
    source : str
        Sender of the overlay, such as the robot's name.
    robot : int or None
        Position number of the robot that it is about.
    time : int or None
        Simulated cycles, from the Measures that it follows from; None = whenever it arrives.
    angles : tuple of four float, or None
        Mounting angles of the robot's IR sensors in degrees: the simulator does not send them to viewers.
    belief : GridBelief or None
    shapes : tuple of Shape
    remove : tuple of str
        Ids of shapes to take away.
    clear : bool
        Take away everything that this source has shown before looking at the rest.
    """

    __repr__ = short_repr

    source: str
    robot: int | None = None
    time: int | None = None
    angles: tuple[float, float, float, float] | None = None
    belief: GridBelief | None = None
    shapes: tuple[Shape, ...] = ()
    remove: tuple[str, ...] = ()
    clear: bool = False
