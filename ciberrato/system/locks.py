"""Files that one process at a time may work on."""

from __future__ import annotations

from typing import BinaryIO


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
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
