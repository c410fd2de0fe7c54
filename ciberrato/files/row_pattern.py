"""Row patterns: the rows of characters by which most lab files draw their walls.

A row at position ``p`` lies at height ``y = p``; even positions hold the upright walls of a row of cells,
odd ones the level walls above it. Three characters make one cell of 2 units: column ``c`` is at ``x = 2 c /
3``.
"""

from __future__ import annotations

import math

from ciberrato.world.coordinates import Point
from ciberrato.world.lab import CELL_SIZE, Wall

HALF_THICKNESS = 0.1
CLOSING_COLUMN = 39
"""A dash in this column ends a level wall: the last cell of a lab 14 cells wide, and of no other."""

# Sine and cosine of 45 degrees differ in the last bit, and so do the real simulator's corners.
_DX = HALF_THICKNESS * math.cos(math.pi / 4)
_DY = HALF_THICKNESS * math.sin(math.pi / 4)


def row_walls(pattern: str, position: int, height: float) -> tuple[list[Wall], bool]:
    r"""Return the walls that one row pattern draws, as the real simulator makes them.

    Parameters
    ----------
    pattern : str
        ``|``, ``/`` and ``\`` count in any column, ``-`` and blanks only in columns that are multiples of 3;
        everything else is decoration. Columns are UTF-16 units: a character outside the basic plane is two.
    position : int
        Number of the row, from the bottom.
    height : float
        Height of the walls. Level walls in rows that are not odd and positive are lines of height 0.

    Returns
    -------
    walls : list of Wall
        From left to right, each where it closes.
    lost : bool
        Whether a level wall was still open at the end of the pattern; such a wall does not count.
    """
    walls: list[Wall] = []
    level_height = height if position >= 0 and position % 2 == 1 else 0.0
    first: int | None = None
    columns = (unit for character in pattern for unit in (character if ord(character) < 0x10000 else "\0\0"))
    for column, character in enumerate(columns):
        if character == "|":
            walls.append(Wall(height=height, corners=_upright(column, position)))
        elif character == "/":
            walls.append(Wall(height=height, corners=_rising(column, position)))
        elif character == "\\":
            walls.append(Wall(height=height, corners=_falling(column, position)))
        elif column % 3 == 0:
            if character == "-":
                if first is None:
                    first = column
                if column == CLOSING_COLUMN:
                    walls.append(Wall(height=level_height, corners=_level(first, column, position)))
                    first = None
            elif character == " " and first is not None:
                walls.append(Wall(height=level_height, corners=_level(first, column - 3, position)))
                first = None
    return walls, first is not None


def _upright(column: int, position: int) -> tuple[Point, ...]:
    x = CELL_SIZE * (column + 1) / 3
    y = float(position)
    left, right, top = x - HALF_THICKNESS, x + HALF_THICKNESS, y + CELL_SIZE
    return ((left, y), (right, y), (right, top), (left, top))


def _level(first: int, last: int, position: int) -> tuple[Point, ...]:
    left, right = CELL_SIZE * first / 3, CELL_SIZE * last / 3 + CELL_SIZE
    y = position + 1.0
    bottom, top = y - HALF_THICKNESS, y + HALF_THICKNESS
    return ((left, bottom), (right, bottom), (right, top), (left, top))


def _rising(column: int, position: int) -> tuple[Point, ...]:
    x0, x1 = CELL_SIZE * column / 3, CELL_SIZE * (column + 3) / 3
    y0, y1 = float(position), position + CELL_SIZE
    return ((x0 - _DX, y0 + _DY), (x0 + _DX, y0 - _DY), (x1 + _DX, y1 - _DY), (x1 - _DX, y1 + _DY))


def _falling(column: int, position: int) -> tuple[Point, ...]:
    x0, x1 = CELL_SIZE * column / 3, CELL_SIZE * (column + 3) / 3
    y0, y1 = float(position), position + CELL_SIZE
    return ((x0 - _DX, y1 - _DY), (x0 + _DX, y1 + _DY), (x1 + _DX, y0 + _DY), (x1 - _DX, y0 - _DY))
