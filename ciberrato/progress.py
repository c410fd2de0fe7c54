"""A line that says how far many runs are."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TextIO

_BAR = 30


class ProgressBar:
    """A line that says how far things are, and how long the rest will take.

    Parameters
    ----------
    total : int
    stream : text stream or None
    clock : callable
        Seconds.
    """

    def __init__(
        self, total: int, stream: TextIO | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._total, self._done, self._stream, self._clock = total, 0, stream, clock
        self._began = clock()
        self._shown = -1.0

    def step(self) -> None:
        """Count a run; a terminal sees it at once, a file every half second at most."""
        self._done += 1
        now = self._clock()
        if self._stream is None or (now - self._shown < 0.5 and self._done < self._total):
            return
        self._shown = now
        filled = _BAR * self._done // max(self._total, 1)
        left = (now - self._began) / self._done * (self._total - self._done)
        self._stream.write(
            f"\r[{'#' * filled}{'.' * (_BAR - filled)}] {self._done}/{self._total} runs, {left:.0f} s left "
        )
        self._stream.flush()

    def close(self) -> None:
        """End the line."""
        if self._stream is not None and self._done:
            self._stream.write("\n")
