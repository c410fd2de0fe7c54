"""The cells of 2 x 2 units as scoring sees them, and which of them are open to one another."""

from __future__ import annotations

from ciberrato.geometry.walls import WallMap
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE

STEPS: tuple[tuple[int, int], ...] = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""To the four neighbours."""


def cell_of(x: float, y: float) -> Cell:
    """Find the cell that a point is in."""
    return int(x / CELL_SIZE), int(y / CELL_SIZE)


def is_open(walls: WallMap, cell: Cell, step: tuple[int, int]) -> bool:
    """Return whether no wall stands between the centre of a cell and that of its neighbour."""
    x, y = (cell[0] + 0.5) * CELL_SIZE, (cell[1] + 0.5) * CELL_SIZE
    return not bool(walls.blocked(x, y, x + step[0] * CELL_SIZE, y + step[1] * CELL_SIZE))
