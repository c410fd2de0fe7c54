"""The signals that ask a program to end.

Imported by the command lines before all else: it imports next to nothing itself.
"""

from __future__ import annotations

import signal

HANGUP: int | None = getattr(signal, "SIGHUP", None)
"""The terminal has gone; Windows has no such signal."""

ENDING: tuple[int, ...] = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name)
)
"""Ctrl-C, a request of another program, and on Windows Ctrl-Break, which is what another program can send."""
