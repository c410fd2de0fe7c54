"""Write files so that they are there whole or not at all."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from ciberrato.errors import UsageError

TEMPORARY_SUFFIX = ".partial"


def replace_file(path: Path, contents: bytes) -> None:
    """Write a file under a temporary name in the same folder, then rename it into place.

    A reader sees the old file or the new one, also after a crash or a kill. What a kill leaves behind is
    a file named ``.NAME.PID.partial``, safe to delete.

    Parameters
    ----------
    path : Path
        The file to make or replace; a device or a pipe is written to instead.
    contents : bytes

    Raises
    ------
    UsageError
        If it cannot be written; the old file is then untouched.
    """
    if path.exists() and not path.is_file():  # a device or a pipe is written to, never replaced
        try:
            with open(path, "wb", buffering=0) as stream:
                stream.write(contents)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
        return
    temporary = path.with_name(f".{path.name}.{os.getpid()}{TEMPORARY_SUFFIX}")
    try:
        with open(temporary, "wb") as stream:
            stream.write(contents)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        if not isinstance(error, OSError):
            raise
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None


def cut_torn_line(path: Path) -> None:
    """Cut off a torn last line of a file of lines; one that is not there stays so."""
    if path.exists():
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if whole != data:
            path.write_bytes(whole)
