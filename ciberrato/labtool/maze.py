"""Random labs of cells: which neighbours are joined."""

from __future__ import annotations

import numpy as np

Cell = tuple[int, int]
Door = tuple[Cell, Cell]


def random_doors(
    rows: int, columns: int, generator: np.random.Generator, *, loops: float, dead_ends: float
) -> set[Door]:
    """Join cells so that every one can be reached.

    Parameters
    ----------
    rows, columns : int
    generator : numpy Generator
    loops : float
        Share of the walls that a maze without loops has, which are taken away: 0 leaves one path between any
        two cells, 1 leaves no wall.
    dead_ends : float
        Share of the dead ends that stay; the others are opened towards a neighbour.

    Returns
    -------
    set of (cell, cell)
        Neighbours without a wall between them; cells are (row, column), the lesser first.
    """
    doors = _tree(rows, columns, generator)
    walls = sorted(all_doors(rows, columns) - doors)
    for index in generator.permutation(len(walls))[: round(loops * len(walls))]:
        doors.add(walls[index])
    for row in range(rows):
        for column in range(columns):
            closed = _dead_end(doors, (row, column), rows, columns)
            if closed and generator.random() >= dead_ends:
                doors.add(closed[generator.integers(len(closed))])
    return doors


def symmetric_doors(doors: set[Door], rows: int, columns: int) -> set[Door]:
    """Add the doors that make a lab look the same turned by half a turn."""
    turned = {
        _door((rows - 1 - a, columns - 1 - b), (rows - 1 - c, columns - 1 - d)) for (a, b), (c, d) in doors
    }
    return doors | turned


def row_patterns(doors: set[Door], rows: int, columns: int) -> list[tuple[int, str]]:
    """Draw the walls between cells as rows of characters, the top row first.

    Parameters
    ----------
    doors : set of (cell, cell)
    rows, columns : int

    Returns
    -------
    list of (position, pattern)
        Labs of 14 columns have patterns of 41 characters, as the real ones; others end with blanks, by which
        the real simulator knows that a level wall ends.
    """
    patterns = []
    end = "" if columns == 14 else " "
    for position in range(2 * rows - 2, -1, -1):
        row = position // 2
        if position % 2:
            cells = ["  " if _door((row, c), (row + 1, c)) in doors else "--" for c in range(columns)]
            pattern = "+".join(cells) + end * 3
        else:
            marks = [" " if _door((row, c), (row, c + 1)) in doors else "|" for c in range(columns - 1)]
            pattern = "  " + "".join(f"{mark}  " for mark in marks)
        patterns.append((position, pattern))
    return patterns


def _tree(rows: int, columns: int, generator: np.random.Generator) -> set[Door]:
    """Join all cells by a random depth-first search: long winding corridors."""
    first = (int(generator.integers(rows)), int(generator.integers(columns)))
    stack, seen, doors = [first], {first}, set()
    while stack:
        fresh = [cell for cell in _neighbours(stack[-1], rows, columns) if cell not in seen]
        if not fresh:
            stack.pop()
            continue
        cell = fresh[generator.integers(len(fresh))]
        doors.add(_door(stack[-1], cell))
        seen.add(cell)
        stack.append(cell)
    return doors


def _dead_end(doors: set[Door], cell: Cell, rows: int, columns: int) -> list[Door]:
    """Return the closed sides of a cell with one open side; of others nothing."""
    sides = [_door(cell, other) for other in _neighbours(cell, rows, columns)]
    closed = [side for side in sides if side not in doors]
    return closed if len(sides) - len(closed) == 1 else []


def _neighbours(cell: Cell, rows: int, columns: int) -> list[Cell]:
    row, column = cell
    around = ((row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column))
    return [(r, c) for r, c in around if 0 <= r < rows and 0 <= c < columns]


def all_doors(rows: int, columns: int) -> set[Door]:
    """Return all pairs of neighbours: the doors of a lab without walls."""
    cells = [(row, column) for row in range(rows) for column in range(columns)]
    return {_door(cell, other) for cell in cells for other in _neighbours(cell, rows, columns)}


def _door(one: Cell, other: Cell) -> Door:
    return (one, other) if one < other else (other, one)
