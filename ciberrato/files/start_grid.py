"""Start grid files: XML to `StartGrid`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ciberrato.files.findings import Finding, warnings_of
from ciberrato.files.vocabulary import GRID, check_attributes, check_place, check_unknown_element
from ciberrato.files.xml import Reader, read_file
from ciberrato.files.xml_document import parse_elements
from ciberrato.reprs import short_repr
from ciberrato.world.start_grid import GridPosition, StartGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class GridFile:
    """A start grid with what its file says beside.

    Attributes
    ----------
    grid : StartGrid
    source : str
        The file's name.
    findings : tuple of Finding
        Parts that are ignored or read as something else, in order of lines.
    lines : tuple of int
        The line of each position.
    """

    __repr__ = short_repr

    grid: StartGrid
    source: str
    findings: tuple[Finding, ...] = ()
    lines: tuple[int | None, ...] = ()


def default_grid() -> StartGrid:
    """Return the start grid that the real simulator has built in."""
    return StartGrid(positions=(GridPosition(x=9.0, y=3.0, direction_deg=0.0),))


def read_grid(path: str | Path) -> StartGrid:
    """Read a start grid file.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    UsageError
        If the file cannot be read.
    LabError
        If it does not hold a start grid.
    """
    return read_grid_with_warnings(path)[0]


def read_grid_with_warnings(path: str | Path) -> tuple[StartGrid, tuple[str, ...]]:
    """Read a start grid file, and say what was passed over or guessed.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    grid : StartGrid
    warnings : tuple of str
        As in `parse_grid_with_warnings`.

    Raises
    ------
    UsageError
        If the file cannot be read.
    LabError
        If it does not hold a start grid.
    """
    return parse_grid_with_warnings(read_file(path), str(path))


def parse_grid(data: bytes, source: str = "grid", *, allow_empty: bool = False) -> StartGrid:
    """Read a start grid from the bytes of its file; see `parse_grid_with_warnings`."""
    return parse_grid_with_warnings(data, source, allow_empty=allow_empty)[0]


def parse_grid_with_warnings(
    data: bytes, source: str = "grid", *, allow_empty: bool = False
) -> tuple[StartGrid, tuple[str, ...]]:
    """Read a start grid from the bytes of its file.

    Parameters
    ----------
    data : bytes
        The XML document. Text between the elements is ignored: many course files have some.
    source : str
        The file's name, for messages.
    allow_empty : bool
        Take a grid without positions, which no robot can enter.

    Returns
    -------
    grid : StartGrid
    warnings : tuple of str
        Numbers that are none, and elements that mean nothing here. One line each, with file and line.

    Raises
    ------
    LabError
        If the data are not XML, the root is not ``Grid``, or there is no position.
    """
    file = parse_grid_file(data, source, allow_empty=allow_empty)
    return file.grid, warnings_of(file.findings)


def parse_grid_file(data: bytes, source: str = "grid", *, allow_empty: bool = False) -> GridFile:
    """Read a start grid, and where in its file everything is; see `parse_grid_with_warnings`."""
    elements = parse_elements(data, source, "a start grid")
    reader = Reader(source)
    root = elements[0]
    if root.name != "Grid":
        raise reader.error(root, f"the root element is {root.name}, not Grid; give a start grid file")
    check_attributes(root, GRID, reader)
    positions, lines = [], []
    for element in elements[1:]:
        if element.name != "Position":
            check_unknown_element(element, GRID, reader, "a start grid")
            continue
        check_attributes(element, GRID, reader)
        check_place(element, root, reader)
        lines.append(element.line)
        positions.append(
            GridPosition(
                x=reader.real(element, "X", 0.0),
                y=reader.real(element, "Y", 0.0),
                direction_deg=reader.real(element, "Dir", 0.0),
            )
        )
    if not positions and not allow_empty:
        raise reader.error(root, "the start grid has no Position; add one for each robot")
    reader.finish()
    findings = tuple(sorted(reader.findings, key=lambda finding: finding.line or 0))
    return GridFile(
        grid=StartGrid(positions=tuple(positions)), source=source, findings=findings, lines=tuple(lines)
    )
