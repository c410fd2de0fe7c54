"""Agents' files: copied for every run, so that runs find what they were meant to find, and nothing else."""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
from pathlib import Path

from ciberrato.errors import UsageError

LEFT_OUT = frozenset({".git", "__pycache__", ".hg", ".svn"})
FAILURES = "ciberrato-failures"
"""Folder in which the pytest plugin keeps the files of failed tests."""

_KEPT_BY_TOOLS = frozenset({".pytest_cache", ".mypy_cache", ".ruff_cache", ".tox", ".nox", FAILURES})
MOST_BYTES = 512 * 1024 * 1024
MOST_FILES = 20_000


def copy_folder(source: Path, target: Path) -> None:
    """Copy an agent's folder; links that lead out of it are copied as links.

    Parameters
    ----------
    source, target : Path
        The target must not be there.

    Raises
    ------
    UsageError
        If a file cannot be copied.
    """
    try:
        shutil.copytree(source, target, symlinks=True, ignore=_left_out)
    except (shutil.Error, OSError) as error:
        raise UsageError(f"{source}: cannot be copied: {_first(error)}") from None


def _left_out(folder: str, names: list[str]) -> set[str]:
    """Return the names in a folder that are not copied: those above, and special files."""
    odd = set()
    for name in names:
        mode = os.lstat(os.path.join(folder, name)).st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or stat.S_ISLNK(mode)):
            odd.add(name)
    return odd | (LEFT_OUT & set(names))


def _first(error: Exception) -> str:
    if isinstance(error, shutil.Error) and error.args and isinstance(error.args[0], list):
        return str(error.args[0][0][-1])
    return str(getattr(error, "strerror", None) or error)


def digest_folder(folder: Path) -> str:
    """Compute a digest of an agent's files: names, contents, and whether they can be run.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    str
        Hexadecimal SHA-256.

    Raises
    ------
    UsageError
        If there is too much of it, or a file cannot be read.
    """
    digest = hashlib.sha256()
    count = size = 0
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name not in LEFT_OUT)
        for name in sorted(names):
            path = Path(place, name)
            try:
                state = path.lstat()
                if stat.S_ISLNK(state.st_mode):
                    content = os.readlink(path).encode()
                elif stat.S_ISREG(state.st_mode):
                    content = path.read_bytes()
                else:
                    continue
            except OSError as error:
                raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
            count += 1
            size += len(content)
            if count > MOST_FILES or size > MOST_BYTES:
                raise UsageError(
                    f"{folder}: more than {MOST_FILES} files or {MOST_BYTES >> 20} MB; "
                    "name a folder that holds the agent only"
                )
            relative = path.relative_to(folder).as_posix()
            head = f"{relative}\0{state.st_mode & 0o111:o}\0{len(content)}\0"
            digest.update(head.encode("utf-8", "surrogateescape") + content)
    return digest.hexdigest()


def stage_folder(source: Path, target: Path) -> None:
    """Copy the folder that a user works in, so that an agent may run in the copy.

    Left out are what `copy_folder` leaves out and what other tools keep there; virtual environments and
    ``node_modules`` are there as links to the real ones.

    Parameters
    ----------
    source, target : Path
        The target must not be there; it may lie in the source.

    Raises
    ------
    UsageError
        If there is too much of it, or a file cannot be copied.
    """
    source, target = source.resolve(), target.resolve()
    linked: list[Path] = []
    count = size = 0

    def ignore(folder: str, names: list[str]) -> set[str]:
        nonlocal count, size
        left = _left_out(folder, names) | (_KEPT_BY_TOOLS & set(names))
        for name in set(names) - left:
            path = Path(folder, name)
            if path == target or path in target.parents:
                left.add(name)
            elif not path.is_symlink() and (name == "node_modules" or (path / "pyvenv.cfg").is_file()):
                left.add(name)
                linked.append(path)
            else:
                count += 1
                size += path.lstat().st_size
        if count > MOST_FILES or size > MOST_BYTES:
            raise UsageError(
                f"{source}: more than {MOST_FILES} files or {MOST_BYTES >> 20} MB; name the folder "
                "that holds the agent only"
            )
        return left

    try:
        shutil.copytree(source, target, symlinks=True, ignore=ignore)
        for path in linked:
            (target / path.relative_to(source)).symlink_to(path)
    except (shutil.Error, OSError) as error:
        raise UsageError(f"{source}: cannot be copied: {_first(error)}") from None


def size_of(folder: Path) -> int:
    """Count the bytes that files of a folder take on the disk.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    int
        Each file, folder or link counts 512 at least, so that very many empty ones are much, too.
    """
    size = 0
    for place, folders, names in os.walk(folder):
        for name in (*folders, *names):
            try:
                state = os.lstat(os.path.join(place, name))
            except OSError:
                continue
            size += max(512, 512 * getattr(state, "st_blocks", -(-state.st_size // 512)))
    return size
