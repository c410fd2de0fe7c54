"""The start grid: the poses at which robots enter a lab, by position number."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ciberrato.reprs import short_repr
from ciberrato.world.fields import check_number, make_tuple


@dataclass(frozen=True, slots=True, kw_only=True)
class GridPosition:
    """One start pose.

    Attributes
    ----------
    x, y : float
        Place in units.
    direction_deg : float
        Heading in degrees, counter-clockwise from +x, as written in the file (it may lie outside ±180).
    """

    __repr__ = short_repr

    x: float = 0.0
    y: float = 0.0
    direction_deg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("x", "y", "direction_deg"):
            check_number(name, getattr(self, name))

    @property
    def heading(self) -> float:
        """The heading in radians, as poses have it."""
        return self.direction_deg * math.pi / 180.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StartGrid:
    """All start poses; robot n stands on position n, counted from 1.

    Attributes
    ----------
    positions : tuple of GridPosition
    """

    positions: tuple[GridPosition, ...] = ()

    def __post_init__(self) -> None:
        make_tuple(self, "positions", GridPosition)

    def __repr__(self) -> str:
        shown = ", ".join(f"({p.x:g}, {p.y:g}, {p.direction_deg:g}°)" for p in self.positions[:4])
        return f"<StartGrid of {len(self.positions)}: {shown}{', ...' * (len(self.positions) > 4)}>"
