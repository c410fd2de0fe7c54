"""Locks that end with their process, and whose a file is."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO


def lock(path: Path) -> int | None:
    """Lock a file for this process, making it if it is not there.

    Returns
    -------
    int or None
        Descriptor, to be closed; None if another process has it, or the system knows no such locks (Windows).

    Raises
    ------
    OSError
        If it cannot be opened.
    """
    if _flock() is None:
        return None
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    if _locked(descriptor):
        return descriptor
    os.close(descriptor)
    return None


def is_anothers(path: Path) -> bool:
    """Return whether a file belongs to another user, as far as the system has owners by number."""
    return hasattr(os, "getuid") and path.lstat().st_uid != os.getuid()


def user_and_group() -> str | None:
    """Return this user's number and group as ``1000:1000``; None where there are none (Windows)."""
    return f"{os.getuid()}:{os.getgid()}" if hasattr(os, "getuid") else None


def hold(file: BinaryIO) -> bool:
    """Lock an open file until it is closed, or its process ends, however that comes about.

    Parameters
    ----------
    file : binary file

    Returns
    -------
    bool
        False if another holds it; True also where the system or the disk knows no such locks.
    """
    return _locked(file.fileno()) is not False


def _locked(descriptor: int) -> bool | None:
    """Lock an open file; return False if another holds it, None where there are no such locks."""
    flock = _flock()
    if flock is None:
        return None
    try:
        flock(descriptor)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _flock() -> Callable[[int], None] | None:
    """Return the function that locks a descriptor for this process alone, if the system has it."""
    try:
        import fcntl
    except ImportError:
        return None
    return lambda descriptor: fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
