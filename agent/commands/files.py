"""The files that command lines name: read, or refused before the work begins."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from agent.run.reporter import Reporter
from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from ciberrato.world.lab import Lab


def read_lab_file(name_or_path: str, *, strict: bool = False) -> tuple[Lab, Path, bytes]:
    """Read the lab that a command line names.

    Parameters
    ----------
    name_or_path : str
        A file, or the name of a lab that ships.
    strict : bool
        Refuse a lab with warnings.

    Returns
    -------
    lab : Lab
    path : Path
        The file.
    data : bytes
        Its contents.

    Raises
    ------
    UsageError
        If there is no such lab, it cannot be read, or there are warnings and `strict`.
    LabError
        If its contents are wrong.
    """
    from ciberrato.checks.telling import tell
    from ciberrato.checks.things import thing_findings
    from ciberrato.files.lab import parse_lab_file
    from ciberrato.files.xml import read_file
    from ciberrato.labs import find_lab

    path = find_lab(name_or_path)
    data = read_file(path)
    file = parse_lab_file(data, str(path))
    tell([*file.findings, *thing_findings(file)], Reporter().warn, strict=strict)
    return file.lab, path, data


def check_output(path: Path) -> None:
    """Refuse a file that cannot be written, before the run and not after it.

    Parameters
    ----------
    path : Path

    Raises
    ------
    UsageError
        If it is a directory, or is in none that can be written.
    """
    folder = path.parent
    if path.is_dir():
        raise UsageError(f"{path}: is a directory; give a file")
    if not folder.is_dir():
        raise UsageError(f"{path}: no directory {folder}; create it")
    if not os.access(folder, os.W_OK | os.X_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise UsageError(f"{path}: cannot be written: permission denied")


def check_size(shape: tuple[int, ...], lab: Lab) -> None:
    """Refuse beliefs that are not of this lab: rows or columns differ."""
    if shape[1:] != (lab.rows, lab.columns):
        raise UsageError(
            f"the beliefs have {shape[1]} x {shape[2]} cells, but the lab {lab.name!r} has {lab.rows} x "
            f"{lab.columns}: give the lab of that run (-m)"
        )


def named_lab(name: str | None, log: Path) -> Lab:
    """Read the lab of a log that does not hold its lab.

    Parameters
    ----------
    name : str or None
        As the user gave it.
    log : Path

    Returns
    -------
    Lab

    Raises
    ------
    UsageError
        If none was given, or there is no such lab.
    """
    if name is None:
        raise UsageError(f"-m LAB is needed: {log} does not hold its lab, as a simulator's log does")
    return read_lab_file(name)[0]
