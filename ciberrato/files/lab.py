"""Lab files: XML to `Lab`, by the rules of the real simulator, with its built-in lab."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from ciberrato.errors import LabError
from ciberrato.files.row_pattern import row_walls
from ciberrato.files.xml import Element, Reader, parse_elements, read_file
from ciberrato.geometry.angles import bearing, wrap_once
from ciberrato.world.coordinates import Point
from ciberrato.world.lab import CELL_SIZE, Beacon, Lab, Target, Wall

MAX_SIDE = 2000.0
"""Longest side of a lab in units, so that a slip of the pen does not ask for all the memory there is."""

_FULL_TURN_TOLERANCE = 0.01

_DEFAULT_ROWS = (
    "  |        |     |                 |     ",
    "  +--+  +--+--+  +  +--+--+--+--+  +--+--",
    "  |        |              |        |     ",
    "--+--+  +--+  +--+--+--+  +--+--+  +--+  ",
    "        |        |     |     |     |  |  ",
    "--+--+--+  +--+  +--+--+--+  +  +  +--+  ",
    "  |                                      ",
    "  +--+--+--+--+--+--+  +  +--+  +--+--+--",
    "     |  |              |     |     |     ",
    "  +--+  +--+--+--+--+  +--+  +  +--+  +  ",
    "  |                 |           |     |  ",
    "  +--+  +--+--+--+  +--+--+  +--+  +--+  ",
    "  |  |           |           |     |     ",
)
"""The built-in lab, top row first."""


def default_lab() -> Lab:
    """Give the lab that the real simulator has built in and uses when no file is given."""
    last = len(_DEFAULT_ROWS) - 1
    walls = [
        wall for row, pattern in enumerate(_DEFAULT_ROWS) for wall in row_walls(pattern, last - row, 4.0)[0]
    ]
    return Lab(
        name="Default LAB",
        width=28.0,
        height=14.0,
        beacons=(Beacon(x=25.0, y=7.0, height=4.0),),
        targets=(Target(x=25.0, y=7.0, radius=1.0),),
        walls=tuple(walls),
    )


def read_lab(path: str | Path) -> Lab:
    """Read a lab file; see `read_lab_with_warnings`."""
    return read_lab_with_warnings(path)[0]


def parse_lab(data: bytes, source: str = "lab") -> Lab:
    """Read a lab from the bytes of its file; see `parse_lab_with_warnings`."""
    return parse_lab_with_warnings(data, source)[0]


def read_lab_with_warnings(path: str | Path) -> tuple[Lab, tuple[str, ...]]:
    """Read a lab file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    lab : Lab
    warnings : tuple of str
        As in `parse_lab_with_warnings`.

    Raises
    ------
    UsageError
        If the file cannot be read.
    LabError
        If it does not hold a usable lab.
    """
    return parse_lab_with_warnings(read_file(path), str(path))


def parse_lab_with_warnings(
    data: bytes, source: str = "lab", *, any_size: bool = False
) -> tuple[Lab, tuple[str, ...]]:
    """Read a lab from the bytes of its file.

    Parameters
    ----------
    data : bytes
        The XML document.
    source : str
        The file's name, for messages.
    any_size : bool
        Take a lab of any size, as the real parser does. Otherwise a lab must hold at least one cell, and no
        side may be longer than `MAX_SIDE`.

    Returns
    -------
    lab : Lab
        Walls in the order of the document.
    warnings : tuple of str
        What the real simulator passes over or takes for something else: walls that it drops, level walls
        lost at the end of a short row pattern, numbers that are none. One line each, with file and line.

    Raises
    ------
    LabError
        If the data are not XML, the root is not ``Lab``, a number is not finite, or the size cannot be used.
    """
    elements = parse_elements(data, source, "a lab")
    reader = Reader(source)
    root = elements[0]
    if root.name != "Lab":
        raise reader.error(root, f"the root element is {root.name}, not Lab; give a lab file")
    beacons: list[Beacon] = []
    targets: list[Target] = []
    walls: list[Wall] = []
    polygons: dict[int, list[Point]] = {}
    for element in elements:
        if element.name == "Corner" and element.parent is not None and element.parent.name == "Wall":
            corner = (reader.real(element, "X", 0.0), reader.real(element, "Y", 0.0))
            polygons.setdefault(id(element.parent), []).append(corner)
    for element in elements[1:]:
        match element.name:
            case "Beacon":
                beacons.append(
                    Beacon(
                        x=reader.real(element, "X", 0.0),
                        y=reader.real(element, "Y", 0.0),
                        height=reader.real(element, "Height", 0.0),
                    )
                )
            case "Target":
                targets.append(
                    Target(
                        x=reader.real(element, "X", 0.0),
                        y=reader.real(element, "Y", 0.0),
                        radius=reader.real(element, "Radius", 2.0),
                    )
                )
            case "Row":
                walls += _row(element, reader)
            case "Wall":
                walls += _wall(element, polygons.get(id(element), []), reader)
            case "Corner" if element.parent is not None and element.parent.name == "Wall":
                pass
            case name:
                reader.warn(element, f"{name} means nothing in a lab and is passed over")
    lab = Lab(
        name=root.attributes.get("Name", "NO NAMED LAB"),
        width=reader.real(root, "Width", 16.0),
        height=reader.real(root, "Height", 16.0),
        beacons=tuple(beacons),
        targets=tuple(targets),
        walls=tuple(walls),
    )
    if not any_size:
        _check_size(lab, root, reader)
    return lab, tuple(reader.warnings)


def _check_size(lab: Lab, root: Element, reader: Reader) -> None:
    for attribute, side in (("Width", lab.width), ("Height", lab.height)):
        if not CELL_SIZE <= side <= MAX_SIDE:
            given = root.attributes.get(attribute)
            raise LabError(
                f'Lab {attribute}="{given}" gives a side of {side:g} units; '
                f"it must be from {CELL_SIZE:g} (one cell) to {MAX_SIDE:g}",
                source=reader.source,
                line=root.line,
            )


def _row(element: Element, reader: Reader) -> list[Wall]:
    position = reader.integer(element, "Pos", 0)
    height = reader.real(element, "Height", 4.0)
    walls, lost = row_walls(element.attributes.get("Pattern", ""), position, height)
    if lost:
        reader.warn(
            element,
            f"the last wall of row {position} is lost, as in the real simulator: its pattern ends "
            "before the wall does; add three blanks to the pattern",
        )
    return walls


def _wall(element: Element, corners: list[Point], reader: Reader) -> list[Wall]:
    height = reader.real(element, "Height", 4.0)
    if len(corners) < 3:
        reader.warn(element, f"a wall of {len(corners)} corners is dropped: it takes three or more")
        return []
    turn = total_turn(corners)
    if abs(abs(turn) - 2 * math.pi) > _FULL_TURN_TOLERANCE:
        reader.warn(
            element,
            "a wall is dropped: its sides cross or a corner is repeated; list each corner once, in order",
        )
        return []
    return [Wall(height=height, corners=tuple(corners if turn > 0 else reversed(corners)))]


def total_turn(corners: Sequence[Point]) -> float:
    """Sum of the turning angles at all corners of a closed polygon, each within ±π.

    Parameters
    ----------
    corners : sequence of (x, y)

    Returns
    -------
    float
        Radians: 2 π for a simple polygon listed counter-clockwise, -2 π clockwise, something else if its
        sides cross.
    """
    # From each corner back to the one before: it matters where a corner is repeated, which is at -π/2 from
    # itself. The real simulator drops some polygons with such corners and keeps others, and so do we.
    directions = [
        bearing(*corner, *previous)
        for previous, corner in zip(corners, (*corners[1:], corners[0]), strict=True)
    ]
    return sum(
        wrap_once(following - direction)
        for direction, following in zip(directions, (*directions[1:], directions[0]), strict=True)
    )
