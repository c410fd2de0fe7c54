"""The lab: walls, beacons, targets, and the grid of 2 x 2 cells laid over them.

Lengths are in simulator units (the robot's diameter is 1), x to the right, y up, origin at the lower
left corner. Reading lab files is `ciberrato.files.lab`; computing with walls is `ciberrato.geometry.walls`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ciberrato.reprs import html_repr, short_repr
from ciberrato.world.coordinates import Point
from ciberrato.world.fields import check_number, check_text, make_points, make_tuple

CELL_SIZE = 2.0
BORDER_HEIGHT = 4.0


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class Beacon:
    """A lamp that beacon sensors see.

    Attributes
    ----------
    x, y : float
        Place in units.
    height : float
        Walls of at least this height hide it.
    """

    __repr__ = short_repr

    x: float = 0.0
    y: float = 0.0
    height: float = 0.0

    def __post_init__(self) -> None:
        for name in ("x", "y", "height"):
            check_number(name, getattr(self, name))


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class Target:
    """A disc on the floor that the ground sensor sees when the whole robot is inside.

    Attributes
    ----------
    x, y, radius : float
        In units.
    """

    __repr__ = short_repr

    x: float = 0.0
    y: float = 0.0
    radius: float = 2.0

    def __post_init__(self) -> None:
        for name in ("x", "y", "radius"):
            check_number(name, getattr(self, name))


@dataclass(repr=False, frozen=True, slots=True, kw_only=True)
class Wall:
    """A simple polygon: an obstacle, or a line painted on the floor where its height is 0.

    Attributes
    ----------
    height : float
        0 or less: a line, which neither stops robots nor reflects IR.
    corners : tuple of (x, y)
        At least three, counter-clockwise, the first not repeated.
    """

    __repr__ = short_repr

    height: float = 4.0
    corners: tuple[Point, ...] = ()

    def __post_init__(self) -> None:
        check_number("height", self.height)
        make_points(self, "corners")


@dataclass(frozen=True, slots=True, kw_only=True)
class Lab:
    """A lab as the simulator knows it. The border is not listed in `walls`; see `border`.

    Attributes
    ----------
    name : str
    width, height : float
        Size in units.
    beacons, targets, walls : tuple
        In the order of the file.
    """

    _repr_html_ = html_repr

    name: str = "NO NAMED LAB"
    width: float = 16.0
    height: float = 16.0
    beacons: tuple[Beacon, ...] = ()
    targets: tuple[Target, ...] = ()
    walls: tuple[Wall, ...] = ()

    def __post_init__(self) -> None:
        check_text("name", self.name)
        for name in ("width", "height"):
            check_number(name, getattr(self, name))
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name}: {getattr(self, name)!r} is not a length")
        for name, kind in (("beacons", Beacon), ("targets", Target), ("walls", Wall)):
            make_tuple(self, name, kind)

    def __repr__(self) -> str:
        beside = f"{len(self.walls)} walls, {len(self.beacons)} beacons, {len(self.targets)} targets"
        return f"<Lab {self.name[:60]!r} {self.width:g} x {self.height:g}, {beside}>"

    @property
    def border(self) -> Wall:
        """The rectangle around the lab, which stops robots, rays and beacons."""
        return Wall(
            height=BORDER_HEIGHT,
            corners=((0.0, 0.0), (0.0, self.height), (self.width, self.height), (self.width, 0.0)),
        )

    @property
    def rows(self) -> int:
        """Number of whole cells from bottom to top."""
        return int(self.height // CELL_SIZE)

    @property
    def columns(self) -> int:
        """Number of whole cells from left to right."""
        return int(self.width // CELL_SIZE)
