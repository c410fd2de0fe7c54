"""The start grid: the poses at which robots enter a lab, by position number."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GridPosition:
    """One start pose.

    Attributes
    ----------
    x, y : float
        Place in units.
    direction : float
        Heading in degrees, counter-clockwise from +x, as written in the file (it may lie outside ±180).
    """

    x: float = 0.0
    y: float = 0.0
    direction: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StartGrid:
    """All start poses; robot n stands on position n, counted from 1.

    Attributes
    ----------
    positions : tuple of GridPosition
    """

    positions: tuple[GridPosition, ...] = ()
