"""Start grid files: XML to `StartGrid`."""

from __future__ import annotations

from pathlib import Path

from ciberrato.files.xml import Reader, parse_elements, read_file
from ciberrato.world.start_grid import GridPosition, StartGrid


def default_grid() -> StartGrid:
    """Give the start grid that the real simulator has built in."""
    return StartGrid(positions=(GridPosition(x=9.0, y=3.0, direction=0.0),))


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
    return parse_grid(read_file(path), str(path))


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
        The XML document. Text between the elements is passed over: many course files have some.
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
    elements = parse_elements(data, source, "a start grid")
    reader = Reader(source)
    root = elements[0]
    if root.name != "Grid":
        raise reader.error(root, f"the root element is {root.name}, not Grid; give a start grid file")
    positions = []
    for element in elements[1:]:
        if element.name == "Position":
            positions.append(
                GridPosition(
                    x=reader.real(element, "X", 0.0),
                    y=reader.real(element, "Y", 0.0),
                    direction=reader.real(element, "Dir", 0.0),
                )
            )
        else:
            reader.warn(element, f"{element.name} means nothing in a start grid and is passed over")
    if not positions and not allow_empty:
        raise reader.error(root, "the start grid has no Position; add one for each robot")
    return StartGrid(positions=tuple(positions)), tuple(reader.warnings)
