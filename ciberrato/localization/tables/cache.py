"""Keeps the pose filter's tables on disk, so that only the first run in a lab computes them.

A file is found by what the tables depend on: the lab's contents, the sensors' mounting angles, the
resolution, and the version of this code's rules. It is written under another name and renamed, so that
processes that compute the same tables at once do no harm; a file that is not what was written, whatever has
befallen it, is computed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import shutil
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.localization.belief.lattice import Lattice
from ciberrato.localization.evidence.symmetry import Turn
from ciberrato.localization.tables.pose_tables import BINS, PoseTables, Progress, build_tables
from ciberrato.world.lab import Lab

VERSION = 2
"""To be raised whenever the same lab would give other tables."""

_LATTICE_ARRAYS = ("x", "y", "representative", "clearance", "cell", "site", "index")


def cache_folder() -> Path:
    """Return the tables' folder: ``$CIBERRATO_CACHE``, else ``ciberrato`` in the user's cache folder."""
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
        with contextlib.suppress(OSError, MemoryError):
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
        Tables to keep, with those that `PoseTables.complete` adds.
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
            name=np.array(path.name),
            codes=np.stack(half),
            sensors=np.array(tables.sensors),
            fractions=np.array(tables.fractions),
            **arrays,
        )
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)  # nothing of ours: a folder cannot be replaced by a file
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def read_tables(path: Path) -> PoseTables | None:
    """Read tables from a file; None if it is not there, or not what `write_tables` has written."""
    try:
        # Opened here, as numpy leaves a file open that turns out to be no archive; without waiting, as a pipe
        # of that name would never end.
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                return None
            with np.load(file, allow_pickle=False) as stored:
                # Under its own name only: what another lab's file says would be believed.
                named = str(stored["name"]) if "name" in stored else path.name
                return _read(stored) if named == path.name else None
    except Exception:
        # Whatever it is: a torn or changed archive has errors of zipfile, zlib, struct, numpy and ours, a
        # size that was changed asks for all memory. The tables are computed again.
        return None


def _read(stored: Mapping[str, Any]) -> PoseTables:
    """Read tables from an archive.

    Raises
    ------
    ValueError
        If its parts do not fit together.
    """
    grid = stored["grid"]
    lattice = Lattice(
        resolution=float(grid[0]),
        nx=int(grid[1]),
        ny=int(grid[2]),
        origin=(float(grid[3]), float(grid[4])),
        **{name: stored[name] for name in _LATTICE_ARRAYS},
    )
    tables = PoseTables(
        lattice=lattice,
        steps=int(stored["steps"]),
        codes=tuple(np.concatenate([codes, codes]) for codes in stored["codes"]),
        fractions=tuple(float(fraction) for fraction in stored["fractions"]),
        sensors=tuple((int(table), int(ahead)) for table, ahead in stored["sensors"]),
        _shares=list(stored["shares"]) if "shares" in stored else [],
        _turns=[[Turn(*turn) for turn in stored["turns"].tolist()]] if "turns" in stored else [],
    )
    _check(tables)
    return tables


def _check(tables: PoseTables) -> None:
    """Refuse tables whose parts do not fit together: a wrong index would fail in the midst of a run."""
    lattice, count = tables.lattice, len(tables.codes)
    size, sites, margin = lattice.size, lattice.nx * lattice.ny, 4 * (lattice.nx + 1)
    places = (lattice.x, lattice.y, lattice.clearance, lattice.representative)
    fits = (
        math.isfinite(lattice.resolution)
        and lattice.resolution > 0.0
        and min(lattice.nx, lattice.ny, tables.steps, count) > 0
        and all(array.dtype == np.float64 and np.isfinite(array).all() for array in places)
        and [array.shape for array in places] == [(size,)] * 3 + [(size, 2)]
        and _are_indices(lattice.cell, (size,), 0, sites)
        and _are_indices(lattice.site, (size,), margin, sites - margin)
        and _are_indices(lattice.index, (sites + 1,), 0, size + 1)
        and all(codes.dtype == np.uint8 for codes in tables.codes)
        and all(codes.shape == (2 * BINS * tables.steps, size) for codes in tables.codes)
        and len(tables.fractions) == count
        and all(0 <= table < count and 0 <= ahead < BINS * tables.steps for table, ahead in tables.sensors)
        and all(shares.shape == (256,) for shares in tables._shares)
        and len(tables._shares) in (0, count)
    )
    if not fits:
        raise ValueError("the parts of the tables do not fit together")


def _are_indices(array: NDArray[np.int64], shape: tuple[int, ...], low: int, high: int) -> bool:
    return (
        array.dtype == np.int64
        and array.shape == shape
        and (array.size == 0 or (int(array.min()) >= low and int(array.max()) < high))
    )
