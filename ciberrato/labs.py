"""The labs, start grids and parameter files that ship with the project, and how they are found by name.

``corridors`` stands for ``corridors_lab.xml`` where a lab is wanted and for ``corridors_grid.xml`` where a
start grid is; ``harsh`` for ``harsh_params.xml`` where parameters are. The file name itself will do too,
and a path to any other file.
"""

from __future__ import annotations

import os
from pathlib import Path

from ciberrato.errors import UsageError, did_you_mean

_INSTALLED = Path(__file__).parent / "maps"
_FOLDER = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[1] / "maps"
"""In a checkout the maps lie beside the package, where they are seen."""


def find_lab(name_or_path: str | Path) -> Path:
    """Find a lab by file path, or by the name of one that ships.

    Parameters
    ----------
    name_or_path : str or Path
        A file of that path wins over a name.

    Returns
    -------
    Path

    Raises
    ------
    UsageError
        If there is neither; it lists the names of what ships.
    """
    return _find(name_or_path, "lab", "lab")


def find_grid(name_or_path: str | Path) -> Path:
    """Find a start grid by file path, or by the name of one that ships; see `find_lab`."""
    return _find(name_or_path, "grid", "start grid")


def find_parameters(name_or_path: str | Path) -> Path:
    """Find a parameter file by file path, or by the name of one that ships; see `find_lab`."""
    return _find(name_or_path, "params", "parameter file")


def lab_with_hash(sha256: str) -> Path | None:
    """Find the lab that ships with these contents.

    Parameters
    ----------
    sha256 : str
        SHA-256 of the file's bytes, in hexadecimal digits.

    Returns
    -------
    Path or None
        None if no lab that ships has them.
    """
    import hashlib

    for path in sorted(_FOLDER.glob("*_lab.xml")):
        if hashlib.sha256(path.read_bytes()).hexdigest() == sha256.lower():
            return path
    return None


def names(kind: str) -> list[str]:
    """Return the names of the shipped files of one kind.

    Parameters
    ----------
    kind : str
        ``lab``, ``grid`` or ``params``.

    Returns
    -------
    list of str
        Sorted, without the end ``_<kind>.xml``.
    """
    ending = f"_{kind}.xml"
    return sorted(path.name.removesuffix(ending) for path in _FOLDER.glob(f"*{ending}"))


def _find(name_or_path: str | Path, kind: str, what: str) -> Path:
    if not isinstance(name_or_path, str | os.PathLike):
        raise TypeError(f"name_or_path: {name_or_path!r:.60} is neither a path nor the name of a {what}")
    text = str(name_or_path)
    # os.path takes any text, too long ones and those with a NUL included; a pipe is as good as a file.
    if os.path.exists(text) and not os.path.isdir(text):
        return Path(text)
    shipped = names(kind)
    name = text.removesuffix(".xml").removesuffix(f"_{kind}")
    if name in shipped:
        return _FOLDER / f"{name}_{kind}.xml"
    listed = ", ".join(shipped)
    if os.path.isdir(text):
        raise UsageError(f"{text}: is a directory; give a file, or one of these names: {listed}")
    meant = did_you_mean(name, shipped)
    raise UsageError(f"{text!r} is neither a file nor a {what} that ships; these ship: {listed}{meant}")
