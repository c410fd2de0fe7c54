"""Findings about the rows of characters by which labs draw their walls."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ciberrato.files.row_pattern import row_walls
from ciberrato.files.xml import Reader
from ciberrato.files.xml_document import Element
from ciberrato.world.lab import CELL_SIZE, Wall

_SLANTED = "/\\"
_LOOKS_LIKE = dict.fromkeys("=_–—−─═", "-") | dict.fromkeys("!¦│║", "|")
"""Characters that are written, or put in by editors, for walls; other letters mark places in public labs."""
_BEYOND = 0.11
"""Units that the walls of a row may stand over the border: half their thickness."""


def check_row(
    element: Element, position: int, height: float, size: tuple[float, float], reader: Reader
) -> None:
    """Report what a row draws elsewhere, or not at all, than its author meant.

    Parameters
    ----------
    element : Element
        The row.
    position : int
        As it is read.
    height : float
        Height of its walls.
    size : (float, float)
        Width and height of the lab in units.
    reader : Reader
        Gets the findings.
    """
    pattern = element.attributes.get("Pattern", "")
    walls, lost = row_walls(pattern, position, height)
    columns = _columns(pattern)
    if lost:
        reader.warn(
            element,
            "lost wall",
            f"the pattern of row {position} ends before its last wall does",
            "that wall is lost, as in the real simulator",
            attribute="Pattern",
            advice="add three blanks to the pattern",
        )
    rows = max(int(size[1] // CELL_SIZE), 1)
    last = 2 * rows - 2
    if walls and not 0 <= position <= last:
        reader.warn(
            element,
            "row outside",
            f"row {position} is outside the lab, whose rows are 0 to {last}",
            "draws walls on its border or beyond",
            attribute="Pos",
        )
    outside = [wall for wall in walls if max(x for x, _ in wall.corners) > size[0] + _BEYOND]
    if outside:
        cells = int(size[0] // CELL_SIZE)
        reader.warn(
            element,
            "pattern too long",
            f"the pattern of row {position} has {len(columns)} characters, "
            f"for a lab of {cells} cells that takes {3 * cells - 1}",
            f"draws {len(outside)} wall{'s' * (len(outside) > 1)} beyond the right border",
            attribute="Pattern",
            place=_middle(outside[0]),
        )
    _check_columns(element, columns, position, reader)
    level = [wall for wall in walls if wall.height != height and wall.height == 0.0]
    if level and position % 2 == 0 and height > 0.0:
        reader.warn(
            element,
            "dashes in an even row",
            f"there are dashes in row {position}, an even one,",
            "they draw lines on the floor, not walls",
            attribute="Pattern",
            advice='level walls are in odd rows; for lines write Height="0"',
            place=_middle(level[0]),
        )


def check_row_once(element: Element, position: int, earlier: dict[int, Element], reader: Reader) -> None:
    """Report a row that comes twice.

    Parameters
    ----------
    element : Element
    position : int
    earlier : dict of int to Element
        The rows so far; this one is added.
    reader : Reader
        Gets the finding.
    """
    first = earlier.setdefault(position, element)
    if first is not element:
        reader.warn(
            element,
            "row twice",
            f"row {position} is in line {first.line} already",
            "draws its walls over the others",
            attribute="Pos",
        )


def _check_columns(element: Element, columns: str, position: int, reader: Reader) -> None:
    """Report characters in columns where they stand for something else, or nothing."""
    if wrong := _wrong("|", columns, 2):
        x = CELL_SIZE * (wrong[0] + 1) / 3
        reader.warn(
            element,
            "wrong column",
            f"there is a | in column {_listed(wrong)} of row {position}",
            f"it stands at x = {x:g}, not between two cells",
            attribute="Pattern",
            advice="| belongs in columns 2, 5, 8, ...",
            place=(x, position + 1.0),
        )
    if wrong := _wrong(_SLANTED, columns, 0):
        x = CELL_SIZE * wrong[0] / 3
        reader.note(
            element,
            "wrong column",
            f"there is a {columns[wrong[0]]} in column {_listed(wrong)} of row {position}",
            f"it goes from x = {x:g} to {x + 2:g}, not across one cell",
            attribute="Pattern",
            advice="across a cell it is in columns 0, 3, 6, ...",
            place=(x + 1.0, position + 1.0),
        )
    if position > 0 and position % 2 and (upright := [c for c, mark in enumerate(columns) if mark in "|/\\"]):
        reader.warn(
            element,
            "upright in an odd row",
            f"there is a {columns[upright[0]]} in row {position}, an odd one,",
            f"its wall stands from y = {position} to {position + 2}, through the middle of two cells",
            attribute="Pattern",
            advice="upright walls are in even rows",
            place=(CELL_SIZE * (upright[0] + 1) / 3, position + 1.0),
        )
    dead = list(_dead_dashes(columns))
    if dead:
        reader.warn(
            element,
            "wrong column",
            f"there is a - in column {_listed(dead)} of row {position}",
            "it draws nothing",
            attribute="Pattern",
            advice="the - that begins a wall belongs in columns 0, 3, 6, ...",
            place=(CELL_SIZE * (dead[0] + 0.5) / 3, position + 1.0),
        )
    through = list(_through(columns))
    strange = [c for c, mark in enumerate(columns) if mark in _LOOKS_LIKE]
    if strange:
        mark = columns[strange[0]]
        reader.warn(
            element,
            "strange character",
            f'there is a "{mark}" in column {_listed(strange)} of row {position}',
            "it draws nothing",
            attribute="Pattern",
            advice=f"write {_LOOKS_LIKE[mark]}",
            instead=_LOOKS_LIKE[mark],
            place=(CELL_SIZE * (strange[0] + 0.5) / 3, position + 1.0),
        )
    if through:
        reader.warn(
            element,
            "wrong column",
            f'there is a "{columns[through[0]]}" in column {_listed(through)} of row {position}',
            "it does not end the wall, which goes on there",
            attribute="Pattern",
            advice="put a blank where no wall is",
            place=(CELL_SIZE * through[0] / 3 + 1.0, position + 1.0),
        )


def _columns(pattern: str) -> str:
    """Return the pattern by columns: a character outside the basic plane takes two."""
    return "".join(mark if ord(mark) < 0x10000 else "\0\0" for mark in pattern)


def _wrong(marks: str, columns: str, remainder: int) -> list[int]:
    return [column for column, mark in enumerate(columns) if mark in marks and column % 3 != remainder]


def _runs(columns: str) -> Iterator[tuple[int, int]]:
    """Yield the columns from where to where a level wall is open, both multiples of three."""
    first = None
    for column in range(0, len(columns), 3):
        mark = columns[column]
        if mark == "-" and first is None:
            first = column
        elif mark == " " and first is not None:
            yield first, column
            first = None
    if first is not None:
        yield first, len(columns)


def _dead_dashes(columns: str) -> Iterator[int]:
    """Yield the dashes that are in a cell without a level wall and not between such walls."""
    covered = [False] * (len(columns) + 6)
    for first, end in _runs(columns):
        for column in range(max(first - 1, 0), end + 1):
            covered[column] = True
    yield from (column for column, mark in enumerate(columns) if mark == "-" and not covered[column])


def _through(columns: str) -> Iterator[int]:
    """Yield the columns whose cell has no dash although a wall passes through it."""
    for first, end in _runs(columns):
        for column in range(first, min(end, len(columns)), 3):
            cell = columns[column : column + 2]
            if column > first and "-" not in cell and not set(cell) & set("|/\\"):
                yield column


def _listed(columns: list[int]) -> str:
    shown = ", ".join(map(str, columns[:4]))
    return f"{shown}, ..." if len(columns) > 4 else shown


def _middle(wall: Wall) -> tuple[float, float]:
    xs, ys = zip(*wall.corners, strict=True)
    return math.fsum(xs) / len(xs), math.fsum(ys) / len(ys)
