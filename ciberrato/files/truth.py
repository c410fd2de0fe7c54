"""The simulator's truth file: true poses, one line a cycle and robot, as CSV."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from ciberrato.errors import LabError
from ciberrato.system.opening import open_patiently
from ciberrato.world.coordinates import Cell, PoseInDegrees
from ciberrato.world.lab import CELL_SIZE

_COLUMNS = ("time", "x", "y", "dir_deg")


def read_truth(path: str | os.PathLike[str], *, robot: int | None = None) -> dict[int, PoseInDegrees]:
    """Read the true poses of one robot.

    Parameters
    ----------
    path : path-like
        CSV with a header line that names at least ``time``, ``x``, ``y`` and ``dir_deg``; ``robot`` if there
        are several.
    robot : int or None
        Robot's id; None = the first in the file.

    Returns
    -------
    dict of int to (x, y, heading)
        By cycle; of several lines for a cycle the last.

    Raises
    ------
    LabError
        With the line, if the file is not like that.
    """
    source = os.fspath(path)
    poses: dict[int, PoseInDegrees] = {}
    try:
        with io.TextIOWrapper(open_patiently(Path(path)), encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream)
            missing = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise LabError(f"the header line names no column {missing[0]!r}", source=source, line=1)
            for row in reader:
                try:
                    number = int(row.get("robot") or 1)
                    time, x, y, heading = (float(row[name]) for name in _COLUMNS)
                except (TypeError, ValueError):
                    raise LabError("not a true pose", source=source, line=reader.line_num) from None
                if robot is None:
                    robot = number
                if number == robot:
                    poses[int(time)] = (x, y, heading)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "it is not a CSV file"
        raise LabError(f"cannot be read: {reason}", source=source) from None
    if not poses:
        raise LabError("holds no pose of that robot", source=source)
    return poses


def true_cells(poses: Mapping[int, PoseInDegrees], times: Sequence[int]) -> list[Cell | None]:
    """Return in which cell the robot really was.

    Parameters
    ----------
    poses : mapping of int to (x, y, heading)
    times : sequence of int
        Cycles.

    Returns
    -------
    list of (row, column) or None
        None where the file has no line for the cycle.
    """
    cells: list[Cell | None] = []
    for time in times:
        pose = poses.get(time)
        cells.append(None if pose is None else (int(pose[1] // CELL_SIZE), int(pose[0] // CELL_SIZE)))
    return cells
