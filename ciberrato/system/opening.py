"""Files opened for reading in bounded time: a pipe that is never written to must hold up no program."""

from __future__ import annotations

import errno
import io
import os
import stat
from pathlib import Path
from typing import BinaryIO

PIPE_PATIENCE = 5.0
"""Seconds that a pipe may be silent."""


def open_patiently(path: str | Path) -> BinaryIO:
    """Open a file for reading as ``open(path, "rb")`` does, but wait for a pipe for so long and no longer.

    Parameters
    ----------
    path : str or Path
        A pipe is as good as a file, as long as something is written to it every `PIPE_PATIENCE` seconds.

    Returns
    -------
    file
        Buffered.

    Raises
    ------
    OSError
        As `open`; while reading, ``ETIMEDOUT`` where a pipe stays silent.
    """
    try:
        pipe = hasattr(os, "O_NONBLOCK") and stat.S_ISFIFO(os.stat(path).st_mode)
    except OSError:  # `open` says why
        pipe = False
    if not pipe:
        return open(path, "rb")
    return io.BufferedReader(_Pipe(os.open(path, os.O_RDONLY | os.O_NONBLOCK)))


class _Pipe(io.RawIOBase):
    """A pipe that is waited for."""

    def __init__(self, descriptor: int) -> None:
        self._file = os.fdopen(descriptor, "rb", buffering=0)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        import select

        poll = select.poll()
        poll.register(self._file, select.POLLIN)
        # Before a writer comes a read would find an end; the system tells of nothing until there is one.
        if not poll.poll(PIPE_PATIENCE * 1000.0):
            problem = f"a pipe to which nothing is written for {PIPE_PATIENCE:g} seconds"
            raise OSError(errno.ETIMEDOUT, problem)
        return self._file.readinto(buffer) or 0

    def close(self) -> None:
        self._file.close()
        super().close()
