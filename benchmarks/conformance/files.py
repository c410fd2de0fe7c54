"""Golden files, and the labs that they name."""

from __future__ import annotations

import csv
import gzip
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.files.lab import default_lab, parse_lab_with_warnings
from ciberrato.labs import find_grid, find_lab, names
from ciberrato.world.lab import Lab

DEFAULT_LAB = "(default)"
"""Name of the built-in lab in golden files."""


def find_lab_file(name: str, labs: Path | None) -> Path | None:
    """Find the file of a lab (or grid) that golden files name.

    Parameters
    ----------
    name : str
        Path below the folder of labs, or ``maps/...``.
    labs : Path or None
        The folder of labs.

    Returns
    -------
    Path or None
        None if there is no such file here.
    """
    own = name.removeprefix("maps/")
    if own != name:
        kind, find = ("grid", find_grid) if own.endswith("_grid.xml") else ("lab", find_lab)
        return find(own) if own.removesuffix(f"_{kind}.xml") in names(kind) else None
    path = labs / name if labs else None
    return path if path is not None and path.is_file() else None


def read_named_lab(name: str, labs: Path | None) -> Lab | None:
    """Read the lab that golden files name; None if its file is not here.

    Parameters
    ----------
    name : str
        As in `find_lab_file`, or `DEFAULT_LAB`.
    labs : Path or None
        The folder of labs.
    """
    if name == DEFAULT_LAB:
        return default_lab()
    path = find_lab_file(name, labs)
    return parse_lab_with_warnings(path.read_bytes(), name, any_size=True)[0] if path else None


def records(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the objects of a gzipped JSON Lines file; none if there is no such file."""
    if path.is_file():
        with gzip.open(path, "rt", encoding="utf-8") as lines:
            for line in lines:
                yield json.loads(line)


def table(path: Path) -> list[dict[str, str]]:
    """Read the rows of a gzipped CSV file."""
    with gzip.open(path, "rt", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def numbers(path: Path, columns: tuple[str, ...], group: str) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the rows of a gzipped CSV file as numbers, group by group; empty fields are nan.

    Parameters
    ----------
    path : Path
    columns : tuple of str
        Columns, in this order.
    group : str
        Column whose equal neighbouring values make a group.

    Yields
    ------
    name : str
    array, shape (rows, columns)
    """
    with gzip.open(path, "rt", encoding="utf-8", newline="") as file:
        lines = csv.reader(file)
        header = next(lines)
        chosen = [header.index(column) for column in columns]
        by = header.index(group)
        rows: list[list[float]] = []
        name: str | None = None
        for line in lines:
            if name is not None and line[by] != name:
                yield name, np.array(rows)
                rows = []
            name = line[by]
            rows.append([float(line[index] or "nan") for index in chosen])
        if name is not None:
            yield name, np.array(rows)
