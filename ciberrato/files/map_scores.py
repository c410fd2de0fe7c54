"""Scores of a robot's map and of its tour: the figures of the courses' score scripts, as functions.

The reference is what the simulator writes at the start of a run, mapping.out or planning.out. The robot's
map is a text of the same layout; its tour is a text with an offset ``x y`` from its start in each line, in
units.
"""

from __future__ import annotations

import math
from itertools import pairwise

MAP_COLUMNS = 55
MAP_LINES = 27

RIGHT = 10
WRONG = -5
MOST_SHIFT = 2
SHIFT_FACTOR = 0.85
"""For each line and each column that the map has to be shifted by."""

_FREE = "X"


def mapping_score(reference: str, drawn: str) -> float:
    """Score a robot's map.

    Each character that is not blank gives 10 points if it is the reference's in the same place, and costs
    5 if not. The map is also tried shifted by up to two lines and columns; the shift with most points
    counts (of equal ones the smallest), times 0.85 for each line and column of it.

    Parameters
    ----------
    reference : str
        mapping.out, or planning.out, of which lines that are not 55 characters long are left out.
    drawn : str
        The robot's map; `map_faults` returns what is wrong with its layout.

    Returns
    -------
    float
        Points; negative for a map that is mostly wrong.
    """
    wanted = _map_lines(reference)
    lines = drawn.splitlines()
    shifts = sorted(
        ((down, right) for down in _SHIFTS for right in _SHIFTS),
        key=lambda shift: abs(shift[0]) + abs(shift[1]),
    )
    points, (down, right) = max(
        ((_points(wanted, lines, *shift), shift) for shift in shifts), key=lambda tried: tried[0]
    )
    return points * SHIFT_FACTOR ** (abs(down) + abs(right))


_SHIFTS = range(-MOST_SHIFT, MOST_SHIFT + 1)


def map_faults(drawn: str) -> list[str]:
    """Return what is wrong with the layout of a robot's map; it is scored all the same.

    Parameters
    ----------
    drawn : str

    Returns
    -------
    list of str
        One sentence a fault.
    """
    lines = drawn.splitlines()
    faults = [
        f"line {number} has {len(line)} characters, not {MAP_COLUMNS}"
        for number, line in enumerate(lines, 1)
        if len(line) != MAP_COLUMNS
    ]
    if len(lines) != MAP_LINES:
        faults.append(f"there are {len(lines)} lines, not {MAP_LINES}")
    return faults


def planning_score(reference: str, tour: str) -> float:
    """Score a robot's tour.

    Parameters
    ----------
    reference : str
        planning.out with a tour: a map with the targets' numbers, and in its last line the best length.
    tour : str
        The robot's: lines ``x y``, in units from its start, in steps of one cell.

    Returns
    -------
    float
        Best length over the tour's, less the share of targets that it leaves out, and at most the share that
        it visits; 0 for a tour that does not begin and end at ``0 0``, that goes where the map is not free,
        or that cannot be read.

    Raises
    ------
    ValueError
        The reference ends with no length.
    """
    best = float(reference.split("\n")[:-1][-1])
    lines = _map_lines(reference)
    targets = {
        (column, row) for row, line in enumerate(lines) for column, mark in enumerate(line) if mark.isdigit()
    }
    try:
        places = [_offset(line) for line in tour.splitlines() if line.strip()]
    except ValueError:
        return 0.0
    if not places or places[0] != (0.0, 0.0) or places[-1] != (0.0, 0.0):
        return 0.0
    length = 0.0
    for (x0, y0), (x1, y1) in pairwise(places):
        if _mark(lines, (x0 + x1) / 2.0, (y0 + y1) / 2.0) != _FREE:
            return 0.0
        length += math.hypot(x1 - x0, y1 - y0)
    if length == 0.0:
        return 0.0
    visited = len(targets & {_place(x, y) for x, y in places}) / len(targets)
    return min(best / length - (1.0 - visited), visited)


def _points(wanted: list[str], drawn: list[str], down: int, right: int) -> int:
    points = 0
    for number, line in enumerate(drawn, down):
        reference = wanted[number] if 0 <= number < len(wanted) else ""
        for column, character in enumerate(line, right):
            if character != " ":
                same = 0 <= column < len(reference) and reference[column] == character
                points += RIGHT if same else WRONG
    return points


def _map_lines(reference: str) -> list[str]:
    return [line for line in reference.splitlines() if len(line) == MAP_COLUMNS]


def _offset(line: str) -> tuple[float, float]:
    x, y = line.split()
    if not (math.isfinite(float(x)) and math.isfinite(float(y))):
        raise ValueError(line)
    return float(x), float(y)


def _place(x: float, y: float) -> tuple[int, int]:
    """Return column and row of the character at an offset from the start, which is in the middle."""
    return MAP_COLUMNS // 2 + round(x), MAP_LINES // 2 - round(y)


def _mark(lines: list[str], x: float, y: float) -> str:
    column, row = _place(x, y)
    return lines[row][column] if 0 <= row < len(lines) and 0 <= column < len(lines[row]) else ""
