"""Reports of the agent to its user while it runs: lines on standard error, also without a terminal."""

from __future__ import annotations

import contextlib
import sys

from ciberrato.plaintext import plain

PROGRAM = "ciberrato-agent"


class Reporter:
    """Prints lines on standard error.

    Parameters
    ----------
    quiet : bool
        Whether only what went wrong is worth a line.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        self._quiet = quiet
        self._said: set[str] = set()

    def say(self, line: str) -> None:
        """Print what is good to know."""
        if not self._quiet:
            self._print(line)

    def warn(self, line: str) -> None:
        """Print what went wrong."""
        self._print(line)

    def warn_once(self, line: str) -> None:
        """Print what went wrong, but only once."""
        if line not in self._said:
            self._said.add(line)
            self._print(line)

    def _print(self, line: str) -> None:
        # The terminal may be gone, or the reader of the pipe; the run and its file matter more.
        with contextlib.suppress(OSError, ValueError):
            print(f"{PROGRAM}: {plain(line)}", file=sys.stderr, flush=True)
