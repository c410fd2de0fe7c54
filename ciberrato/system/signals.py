"""The signals that ask a program to end.

Imported by the command lines before all else: it imports next to nothing itself.
"""

from __future__ import annotations

import os
import signal

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType
    from typing import NoReturn

HANGUP: int | None = getattr(signal, "SIGHUP", None)
"""The terminal has gone; Windows has no such signal."""

ENDING: tuple[int, ...] = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name)
)
"""Ctrl-C, a request of another program, and on Windows Ctrl-Break, which is what another program can send."""


def end_at_once() -> None:
    """End the process at once on these signals, until a program has handlers of its own; in the main thread.

    For the time in which modules are imported: nothing has happened yet, and an exception would be a
    traceback from somewhere in an import, or lost there.
    """
    for number in ENDING:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, ended_at_once)


def ended_at_once(number: int, frame: FrameType | None) -> NoReturn:
    """End the process with the exit status by which a shell knows the signal."""
    os._exit(128 + number)
