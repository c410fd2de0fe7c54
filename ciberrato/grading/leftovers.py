"""The grading's temporary folder, held by a lock that ends with its process, however that ends."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ciberrato.system.locks import is_anothers, lock

PREFIX = "ciberrato-grade-"
_LOCK = "in-use"


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """Create a temporary folder, removed at the end; first remove those whose owners have ended.

    A process that is killed cannot clean up. So each folder has a file that its maker holds locked: the
    system unlocks it when the process ends, and the next grading of the same user removes the folder. A
    folder without such a file, of another user, or behind a link is left alone.

    Yields
    ------
    Path
    """
    remove_leftovers()
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name:
        held = lock(Path(name) / f".{_LOCK}")
        if held is not None:
            # Only now, locked, it has the name that others look for.
            os.replace(Path(name) / f".{_LOCK}", Path(name) / _LOCK)
        try:
            yield Path(name)
        finally:
            if held is not None:
                os.close(held)


def remove_leftovers() -> list[Path]:
    """Remove folders of gradings that were killed.

    Returns
    -------
    list of Path
        Folders that were removed.
    """
    removed = []
    for folder in sorted(Path(tempfile.gettempdir()).glob(f"{PREFIX}*")):
        with contextlib.suppress(OSError):
            if folder.is_symlink() or not (folder / _LOCK).is_file():
                continue
            if is_anothers(folder):
                continue
            held = lock(folder / _LOCK)
            if held is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(held)
                removed.append(folder)
    return removed
