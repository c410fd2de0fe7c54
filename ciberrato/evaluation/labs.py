"""Labs of the evaluation, by a rule that was written down before the first result was seen.

Of every folder of public labs, in order of their names, the first lab file counts that has walls to see
(higher than 0) and whose walls no earlier folder had; files beside the folders form a folder of their
own, the last. *Row labs* (walls given as rows of cells, the newer format) are all judged; of the *polygon
labs* every other one, beginning with the second. Settings were tuned on labs that are not judged: the
first and the fifth of the polygon labs, PathFinder/pathFinderEval1 and rmi-2122/C4-lab (and looked at,
before judging, in `standard`).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ciberrato.errors import LabError
from ciberrato.files.lab import read_lab
from ciberrato.files.start_grid import read_grid
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.start_grid import StartGrid

MAPS = ("corridors", "diagonals", "maze", "open", "rooms", "standard", "twins", "wide")
"""The project's own labs with something to see; `lines` has the same walls as `open`, none."""


@dataclass(frozen=True, slots=True)
class PublicLab:
    """A lab file and its start grid.

    Attributes
    ----------
    name : str
        Folder and file, short.
    path : Path
    grid : Path or None
    rows : bool
        Whether it is a row lab.
    """

    __repr__ = short_repr

    name: str
    path: Path
    grid: Path | None
    rows: bool


def public_labs(folder: Path) -> list[PublicLab]:
    """List the first lab with walls of every folder, each set of walls once.

    Parameters
    ----------
    folder : Path
        With a folder for every event.

    Returns
    -------
    list of PublicLab
        In order of the folders.
    """
    seen: set[object] = set()
    found = []
    groups = [path for path in sorted(folder.iterdir()) if path.is_dir()]
    for group in [*groups, folder]:
        files = sorted(path for path in group.glob("*.xml"))
        for path in files:
            lab = _walled(path)
            if lab is None or _walls(lab) in seen:
                continue
            seen.add(_walls(lab))
            grids = [grid for grid in files if _holds(grid, b"<Grid")]
            name = path.stem if group == folder else f"{group.name}/{path.stem}"
            found.append(PublicLab(name, path, grids[0] if grids else None, _holds(path, b"<Row")))
            break
    return found


def judged_labs(folder: Path) -> list[PublicLab]:
    """Return the labs on which results are judged."""
    labs = public_labs(folder)
    polygons = [lab for lab in labs if not lab.rows]
    return [lab for lab in labs if lab.rows] + polygons[1::2]


def tuning_labs(folder: Path) -> list[PublicLab]:
    """Return the polygon labs on which settings may be tuned; see the module's text for the others."""
    polygons = [lab for lab in public_labs(folder) if not lab.rows]
    return polygons[0::4][:2]


def all_labs(folder: Path) -> list[PublicLab]:
    """List all labs with walls in a folder and below it, each set of walls once; upper folders first."""
    seen: set[object] = set()
    found = []
    for path in sorted(folder.rglob("*.xml"), key=lambda path: (len(path.parts), path)):
        lab = _walled(path)
        if lab is not None and _walls(lab) not in seen:
            seen.add(_walls(lab))
            found.append(_public_lab(path, folder))
    return found


def lab_in(folder: Path, name: str) -> PublicLab | None:
    """Find a lab by its name or path in a folder, with or without ``.xml``; None if there is none."""
    for ending in ("", ".xml"):
        path = folder / f"{name}{ending}"
        if path.is_file():
            return _public_lab(path, folder)
    return None


def _public_lab(path: Path, folder: Path) -> PublicLab:
    grids = [beside for beside in sorted(path.parent.glob("*.xml")) if _holds(beside, b"<Grid")]
    name = path.relative_to(folder).with_suffix("").as_posix()
    return PublicLab(name, path, grids[0] if grids else None, _holds(path, b"<Row"))


def start_grid(lab: PublicLab) -> StartGrid:
    """Read the start grid of a public lab.

    Raises
    ------
    LabError
        If there is none.
    """
    if lab.grid is None:
        raise LabError("no start grid beside it; add one, or choose another --start", source=str(lab.path))
    return read_grid(lab.grid)


def _walled(path: Path) -> Lab | None:
    if not _holds(path, b"<Lab", 4000):
        return None
    try:
        lab = read_lab(path)
    except LabError:
        return None
    return lab if any(wall.height > 0.0 for wall in lab.walls) else None


def _walls(lab: Lab) -> object:
    return lab.width, lab.height, frozenset(wall.corners for wall in lab.walls if wall.height > 0.0)


def _holds(path: Path, mark: bytes, within: int | None = None) -> bool:
    """Return whether a file, and not a pipe or a device, has some bytes in it."""
    return path.is_file() and mark in path.read_bytes()[:within]
