"""Lab files: XML to `Lab`, by the rules of the real simulator, with its built-in lab."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ciberrato.errors import LabError
from ciberrato.files.findings import Finding, warnings_of
from ciberrato.files.row_findings import check_row, check_row_once
from ciberrato.files.row_pattern import row_walls
from ciberrato.files.vocabulary import LAB, check_attributes, check_place, check_unknown_element
from ciberrato.files.xml import Reader, read_file
from ciberrato.files.xml_document import Element, parse_elements
from ciberrato.geometry.angles import bearing, wrap_once
from ciberrato.reprs import short_repr
from ciberrato.world.coordinates import Point
from ciberrato.world.lab import CELL_SIZE, Beacon, Lab, Target, Wall

MAX_SIDE = 2000.0
"""Longest side of a lab in units, so that a slip of the pen does not ask for all the memory there is."""

MOST = {
    "walls": 10_000,
    "corners of a wall": 1000,
    "beacons": 500,
    "targets": 500,
    "characters in its rows": 1_000_000,
}
"""Limits of a lab, so that all programs end in reasonable time; a maze of 60 x 60 cells has 4,000."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class LabFile:
    """A lab with what its file says beside.

    Attributes
    ----------
    lab : Lab
    source : str
        The file's name.
    findings : tuple of Finding
        Parts that are ignored or read as something else, in order of lines.
    beacon_lines, target_lines, wall_lines : tuple of int
        The line of each beacon, target and wall of the lab; that of the row where a row draws the wall.
    from_rows : tuple of bool
        Whether a row draws each wall.
    """

    __repr__ = short_repr

    lab: Lab
    source: str
    findings: tuple[Finding, ...] = ()
    beacon_lines: tuple[int, ...] = ()
    target_lines: tuple[int, ...] = ()
    wall_lines: tuple[int, ...] = ()
    from_rows: tuple[bool, ...] = ()


@dataclass(slots=True)
class _Contents:
    """Parts of a lab while it is read, each with its line."""

    beacons: list[tuple[Beacon, int]] = field(default_factory=list)
    targets: list[tuple[Target, int]] = field(default_factory=list)
    walls: list[tuple[Wall, int, bool]] = field(default_factory=list)
    rows: dict[int, Element] = field(default_factory=dict)
    characters: int = 0

    def check(self, element: Element, reader: Reader, corners: int = 0) -> None:
        """Refuse more than a lab may hold.

        Raises
        ------
        LabError
            At the first thing that is too many.
        """
        counts = (len(self.walls), corners, len(self.beacons), len(self.targets), self.characters)
        for (what, most), count in zip(MOST.items(), counts, strict=True):
            if count > most:
                raise reader.error(element, f"a lab with more than {most} {what}; give a smaller one")


def default_lab() -> Lab:
    """Return the lab that the real simulator has built in and uses when no file is given."""
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
        Parts that the real simulator omits or takes for something else: walls that it drops, level walls
        lost at the end of a short row pattern, numbers that are none. One line each, with file and line.

    Raises
    ------
    LabError
        If the data are not XML, the root is not ``Lab``, a number is not finite, or the size cannot be used.
    """
    file = parse_lab_file(data, source, any_size=any_size)
    return file.lab, warnings_of(file.findings)


def parse_lab_file(data: bytes, source: str = "lab", *, any_size: bool = False) -> LabFile:
    """Read a lab, and where in its file everything is; see `parse_lab_with_warnings`."""
    elements = parse_elements(data, source, "a lab")
    reader = Reader(source)
    root = elements[0]
    if root.name != "Lab":
        raise reader.error(root, f"the root element is {root.name}, not Lab; give a lab file")
    check_attributes(root, LAB, reader)
    size = (reader.real(root, "Width", 16.0), reader.real(root, "Height", 16.0))
    contents = _Contents()
    polygons: dict[int, list[Point]] = {}
    for element in elements:
        if element.name == "Corner" and element.parent is not None and element.parent.name == "Wall":
            check_attributes(element, LAB, reader)
            corner = (reader.real(element, "X", 0.0), reader.real(element, "Y", 0.0))
            polygons.setdefault(id(element.parent), []).append(corner)
    for element in elements[1:]:
        if element.name == "Wall":
            corners = polygons.get(id(element), [])
            contents.check(element, reader, len(corners))  # before the polygon is looked at
            _wall(element, corners, reader, contents)
        elif element.name in ("Beacon", "Target", "Row"):
            _thing(element, size, reader, contents)
        elif not (element.name == "Corner" and element.parent is not None and element.parent.name == "Wall"):
            check_unknown_element(element, LAB, reader, "a lab")
            continue
        if element.name != "Corner":
            check_attributes(element, LAB, reader)
            check_place(element, root, reader)
        contents.check(element, reader)
    lab = Lab(
        name=root.attributes.get("Name", "NO NAMED LAB"),
        width=size[0],
        height=size[1],
        beacons=tuple(beacon for beacon, _ in contents.beacons),
        targets=tuple(target for target, _ in contents.targets),
        walls=tuple(wall for wall, _, _ in contents.walls),
    )
    reader.finish()
    if not any_size:
        _check_size(lab, root, reader)
    for attribute, side in (("Width", lab.width), ("Height", lab.height)):
        if side % CELL_SIZE and attribute in root.attributes:
            rest = side % CELL_SIZE
            cells = f"{side // CELL_SIZE:g} cells and {rest:g} unit{'s' * (rest != 1)}"
            reader.note(root, "odd size", f"Lab {attribute} {side:g} is {cells}", attribute=attribute)
    return LabFile(
        lab=lab,
        source=source,
        findings=tuple(sorted(reader.findings, key=lambda finding: finding.line or 0)),
        beacon_lines=tuple(line for _, line in contents.beacons),
        target_lines=tuple(line for _, line in contents.targets),
        wall_lines=tuple(line for _, line, _ in contents.walls),
        from_rows=tuple(row for _, _, row in contents.walls),
    )


def _thing(element: Element, size: tuple[float, float], reader: Reader, contents: _Contents) -> None:
    """Read a beacon, a target or a row."""
    if element.name == "Row":
        position = reader.integer(element, "Pos", 0)
        height = reader.real(element, "Height", 4.0)
        contents.characters += len(element.attributes.get("Pattern", ""))
        contents.check(element, reader)  # before they are looked at
        walls, _ = row_walls(element.attributes.get("Pattern", ""), position, height)
        contents.walls += [(wall, element.line, True) for wall in walls]
        check_row(element, position, height, size, reader)
        check_row_once(element, position, contents.rows, reader)
        return
    x, y = reader.real(element, "X", 0.0), reader.real(element, "Y", 0.0)
    if element.name == "Beacon":
        beacon = Beacon(x=x, y=y, height=reader.real(element, "Height", 0.0))
        contents.beacons.append((beacon, element.line))
    else:
        target = Target(x=x, y=y, radius=reader.real(element, "Radius", 2.0))
        contents.targets.append((target, element.line))


def _check_size(lab: Lab, root: Element, reader: Reader) -> None:
    for attribute, side in (("Width", lab.width), ("Height", lab.height)):
        if not CELL_SIZE <= side <= MAX_SIDE:
            given = root.attributes.get(attribute)
            shown, advice = f'Lab {attribute}="{given}"', ""
            for finding in reader.findings:  # why the side is 0, where it is no number
                if finding.kind == "not a number" and finding.found.startswith(f'Lab {attribute}="'):
                    shown, advice = f"{finding.found} and", finding.advice and f"; {finding.advice}"
            raise LabError(
                f"{shown} gives a side of {side:g} units; "
                f"it must be from {CELL_SIZE:g} (one cell) to {MAX_SIDE:g}{advice}",
                source=reader.source,
                line=root.line,
            )


def _wall(element: Element, corners: list[Point], reader: Reader, contents: _Contents) -> None:
    height = reader.real(element, "Height", 4.0)
    place = corners[0] if corners else None
    if len(corners) < 3:
        found = f"a wall has {len(corners)} corner{'s' * (len(corners) != 1)}"
        reader.warn(
            element, "dropped wall", found, "is dropped", advice="it takes three or more", place=place
        )
        return
    turn = total_turn(corners)
    if abs(abs(turn) - 2 * math.pi) > _FULL_TURN_TOLERANCE:
        reader.warn(
            element,
            "dropped wall",
            "the sides of a wall cross, or a corner is repeated,",
            "the wall is dropped",
            advice="list each corner once, in order",
            place=place,
        )
        return
    wall = Wall(height=height, corners=tuple(corners if turn > 0 else reversed(corners)))
    contents.walls.append((wall, element.line, False))


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
