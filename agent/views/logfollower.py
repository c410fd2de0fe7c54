"""Follows a log while an agent writes it: for views that are processes of their own and cannot hold it up."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from ciberrato.errors import LabError
from ciberrato.files.run_log import parse_cycle, parse_header
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader


class LogFollower:
    """Reads a log while it is written, each complete line once.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._rest = b""
        self._lines = 0
        self.header: RunHeader | None = None
        self.cycles: list[Cycle] = []

    @property
    def run(self) -> RecordedRun | None:
        """What is there so far; None before the first line is complete."""
        return None if self.header is None else RecordedRun(self.header, tuple(self.cycles))

    def poll(self) -> bool:
        """Read what is new.

        Returns
        -------
        bool
            Whether anything was.

        Raises
        ------
        LabError
            If a line is not one of a log.
        """
        try:
            with self._path.open("rb") as stream:
                if stream.seek(0, os.SEEK_END) < self._offset:
                    self._begin_again()
                stream.seek(self._offset)
                data = stream.read()
        except FileNotFoundError:
            return False
        except OSError as error:
            raise LabError(f"cannot be read: {error.strerror}", source=str(self._path)) from None
        self._offset += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._lines += 1
            if self.header is None:
                self.header = parse_header(line, str(self._path))
            else:
                self.cycles.append(parse_cycle(line, str(self._path), self._lines))
        return bool(lines)

    def _begin_again(self) -> None:
        """Forget everything: another run has begun to write the file."""
        self._offset, self._rest, self._lines = 0, b"", 0
        self.header, self.cycles = None, []


def follow(
    path: Path,
    *,
    interval: float,
    ended: Callable[[], bool] = lambda: False,
    idle_limit: float | None = None,
) -> Iterator[LogFollower]:
    """Follow a log for as long as it may grow.

    Parameters
    ----------
    path : Path
        It need not exist yet.
    interval : float
        Seconds between looks.
    ended : callable
        Tells whether to end; what is new by then is still looked at.
    idle_limit : float or None
        End after so many seconds without news.

    Yields
    ------
    LogFollower
        Always the same, each time there is something new.

    Raises
    ------
    LabError
        If the file is not the log of a run.
    """
    follower = LogFollower(path)
    news = time.monotonic()
    while True:
        last = ended()
        if follower.poll():
            news = time.monotonic()
            yield follower
        if last or (idle_limit is not None and time.monotonic() - news > idle_limit):
            return
        time.sleep(interval)
