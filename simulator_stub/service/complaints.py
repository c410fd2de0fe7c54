"""Lines about what clients did wrong, bounded in number."""

from __future__ import annotations

from collections.abc import Callable

LIMIT = 20
"""Broken messages that are reported, until the next Reset."""


class Complaints:
    """Lines about broken or refused messages, but not without end.

    Parameters
    ----------
    notify : callable
        Called with each line.
    """

    def __init__(self, notify: Callable[[str], None]) -> None:
        self._notify = notify
        self._count = 0

    def __call__(self, line: str) -> None:
        """Report what a client did wrong."""
        self._count += 1
        if self._count <= LIMIT:
            self._notify(line)
        if self._count == LIMIT:
            self._notify("further broken or refused messages are not reported")

    def forget(self) -> None:
        """Begin to count anew."""
        self._count = 0
