"""Keeps the pose filter's tables on disk, so that only the first run in a lab computes them.

A file is found by what the tables depend on: the lab's contents, the sensors' mounting angles, the
resolution, and the version of this code's rules. It is written under another name and renamed, so that
processes that compute the same tables at once do no harm; a file that cannot be read is computed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ciberrato.localization.belief.lattice import Lattice
from ciberrato.localization.evidence.symmetry import Turn
from ciberrato.localization.tables.pose_tables import PoseTables, Progress, build_tables
from ciberrato.world.lab import Lab

VERSION = 2
"""To be raised whenever the same lab would give other tables."""

_LATTICE_ARRAYS = ("x", "y", "representative", "clearance", "cell", "site", "index")


def cache_folder() -> Path:
    """Where the tables are kept: ``$CIBERRATO_CACHE``, else ``ciberrato`` in the user's cache folder."""
    named = os.environ.get("CIBERRATO_CACHE")
    if named:
        return Path(named)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "ciberrato"


def table_key(lab: Lab, angles: Sequence[float], resolution: float, steps: int) -> str:
    """Name the tables by everything that they depend on."""
    walls = [(wall.corners, wall.height > 0.0) for wall in lab.walls]
    description = repr((VERSION, lab.width, lab.height, walls, tuple(angles), round(resolution, 9), steps))
    return hashlib.sha256(description.encode()).hexdigest()[:32]


def cached_tables(
    lab: Lab,
    angles: Sequence[float],
    resolution: float,
    *,
    steps: int = 2,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> PoseTables:
    """Read the tables of a lab from disk, or compute them and leave them there.

    Parameters
    ----------
    lab : Lab
    angles : sequence of float
        Mounting angles of the sensors in degrees.
    resolution : float
        Units between nodes.
    steps : int
        Directions a bin.
    folder : Path, optional
        Default: `cache_folder`. A folder that cannot be written costs time, nothing else.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    PoseTables
    """
    path = table_path(lab, angles, resolution, steps, folder)
    tables = read_tables(path)
    if tables is None:
        tables = build_tables(lab, angles, resolution, steps=steps, progress=progress)
    if tables.complete(lab):
        with contextlib.suppress(OSError):
            write_tables(path, tables)
    if progress is not None:
        progress(1.0)
    return tables


def table_path(lab: Lab, angles: Sequence[float], resolution: float, steps: int, folder: Path | None) -> Path:
    """Return in which file the tables of a lab are kept."""
    return (folder or cache_folder()) / f"pose-tables-{table_key(lab, angles, resolution, steps)}.npz"


def write_tables(path: Path, tables: PoseTables) -> None:
    """Write tables to a file, whole or not at all.

    Parameters
    ----------
    path : Path
        Its folder is made if need be.
    tables : PoseTables
        What `PoseTables.complete` adds is kept, too.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lattice = tables.lattice
    arrays = {name: getattr(lattice, name) for name in _LATTICE_ARRAYS}
    if tables.known_turns is not None:
        arrays["shares"] = np.array(tables.code_shares)
        turns = [(turn.x, turn.y, turn.angle) for turn in tables.known_turns]
        arrays["turns"] = np.array(turns).reshape(-1, 3)
    half = [codes[: len(codes) // 2] for codes in tables.codes]
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp.npz")
    try:
        np.savez(
            temporary,
            grid=np.array([lattice.resolution, lattice.nx, lattice.ny, *lattice.origin]),
            steps=tables.steps,
            codes=np.stack(half),
            sensors=np.array(tables.sensors),
            fractions=np.array(tables.fractions),
            **arrays,
        )
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def read_tables(path: Path) -> PoseTables | None:
    """Read tables from a file; None if it is not there or not whole."""
    try:
        # Opened here, as numpy leaves a file open that turns out to be no archive.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            grid = stored["grid"]
            lattice = Lattice(
                resolution=float(grid[0]),
                nx=int(grid[1]),
                ny=int(grid[2]),
                origin=(float(grid[3]), float(grid[4])),
                **{name: stored[name] for name in _LATTICE_ARRAYS},
            )
            return PoseTables(
                lattice=lattice,
                steps=int(stored["steps"]),
                codes=tuple(np.concatenate([codes, codes]) for codes in stored["codes"]),
                fractions=tuple(float(fraction) for fraction in stored["fractions"]),
                sensors=tuple((int(table), int(ahead)) for table, ahead in stored["sensors"]),
                _shares=list(stored["shares"]) if "shares" in stored else [],
                _turns=[[Turn(*turn) for turn in stored["turns"].tolist()]] if "turns" in stored else [],
            )
    except (OSError, ValueError, KeyError, EOFError):
        return None
    except Exception as error:  # a torn archive: zipfile's own exceptions
        if type(error).__name__ == "BadZipFile":
            return None
        raise
