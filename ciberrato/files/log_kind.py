"""Whose log a file is: a simulator's (XML) or an agent's (JSON lines)."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

from ciberrato.errors import LabError
from ciberrato.system.opening import open_patiently

GZIP_MAGIC = b"\x1f\x8b"


def is_simulator_log(path: Path) -> bool:
    """Return whether a file begins like a simulator's log and not like an agent's.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool

    Raises
    ------
    LabError
        If it cannot be read.
    """
    try:
        with open_patiently(path) as stream:
            start = stream.read(64)
            if start.startswith(GZIP_MAGIC):
                stream.seek(0)
                start = gzip.GzipFile(fileobj=stream).read(64)
    except (OSError, EOFError, zlib.error) as error:
        raise LabError(
            f"cannot read the log: {getattr(error, 'strerror', None) or error}", source=str(path)
        ) from None
    return start.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"<Log", b"<?xml", b"<!--"))
