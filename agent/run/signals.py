"""Ctrl-C and its kin: from the first moment a sane end, never a traceback, never a lost file.

SIGINT, SIGTERM and SIGHUP are taken alike. Until `Interrupts.arm` there is nothing to save: a signal ends
the process at once, with one line. From then on a signal is only noted and makes `Interrupts.fileno`
readable, so that a `select` on it wakes up; every further one is noted, too, and otherwise
ignored.

This module is imported before all others and imports next to nothing.
"""

from __future__ import annotations

import os
import signal

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType
    from typing import Any


class Interrupts:
    """Takes the signals that ask the process to end.

    Works in the main thread only; elsewhere `install` does nothing.
    """

    def __init__(self) -> None:
        self.received: list[int] = []
        """Numbers of the signals that came since `arm`, in order."""
        self._armed = False
        self._former: dict[int, Any] = {}
        self._former_wakeup = -1
        self._read_end = self._write_end = -1

    def install(self) -> None:
        """Take the signals from now on."""
        try:
            self._take(signal.SIGINT)
        except ValueError:  # not in the main thread
            return
        self._take(signal.SIGTERM)
        # Who started us with nohup does not want us to end with the terminal.
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            self._take(signal.SIGHUP)

    def arm(self) -> None:
        """Only note signals from now on: there may be something to save."""
        self._read_end, self._write_end = os.pipe()
        os.set_blocking(self._read_end, False)
        os.set_blocking(self._write_end, False)
        if self._former:
            self._former_wakeup = signal.set_wakeup_fd(self._write_end, warn_on_full_buffer=False)
        self._armed = True

    def wait(self, descriptor: int | None, timeout: float) -> None:
        """Wait until something arrives, a signal has come, or time is up.

        Parameters
        ----------
        descriptor : int or None
            Of the socket to watch, if there is one.
        timeout : float
            Seconds.
        """
        import select

        watched = [self._read_end] if descriptor is None else [descriptor, self._read_end]
        select.select(watched, (), (), max(timeout, 0.0))

    def ignore(self) -> None:
        """Ignore the signals for the rest of the process: it is done but for going down."""
        for number in self._former:
            signal.signal(number, signal.SIG_IGN)

    def close(self) -> None:
        """Restore the signal handlers that were there before."""
        if self._armed:
            if self._former:
                signal.set_wakeup_fd(self._former_wakeup)
            os.close(self._read_end)
            os.close(self._write_end)
            self._armed = False
        for number, handler in self._former.items():
            signal.signal(number, handler)
        self._former.clear()

    @property
    def status(self) -> int:
        """Exit status by which a shell knows that the first signal ended the process."""
        return 128 + self.received[0]

    def _take(self, number: int) -> None:
        former = signal.signal(number, self._handle)
        self._former[number] = signal.SIG_DFL if former is None else former

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._armed:
            self.received.append(number)
            return
        os.write(2, b"ciberrato-agent: interrupted; nothing is written\n")
        # Without the interpreter's shutdown, in which a second signal could still print a traceback.
        os._exit(128 + number)
