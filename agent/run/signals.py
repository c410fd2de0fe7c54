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

from ciberrato.system.signals import ENDING, HANGUP

TYPE_CHECKING = False
if TYPE_CHECKING:
    import socket
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
        self._ends: tuple[socket.socket, socket.socket] | None = None

    def install(self) -> None:
        """Install the signal handlers."""
        try:
            for number in ENDING:
                self._take(number)
        except ValueError:  # not in the main thread
            return
        # Who started us with nohup does not want us to end with the terminal.
        if HANGUP is not None and signal.getsignal(HANGUP) is not signal.SIG_IGN:
            self._take(HANGUP)

    def arm(self) -> None:
        """Defer signals from now on: there may be something to save."""
        import socket

        self._ends = socket.socketpair()  # not a pipe, for which Windows cannot wait
        for end in self._ends:
            end.setblocking(False)
        if self._former:
            self._former_wakeup = signal.set_wakeup_fd(self._ends[1].fileno(), warn_on_full_buffer=False)
        self._armed = True

    def wait(self, descriptor: int | None, timeout: float) -> None:
        """Wait until something arrives, a signal has come, or time is up.

        Parameters
        ----------
        descriptor : int or None
            Descriptor of the socket to watch, if there is one.
        timeout : float
            Seconds.
        """
        import select

        assert self._ends is not None
        own = self._ends[0].fileno()
        watched = [own] if descriptor is None else [descriptor, own]
        select.select(watched, (), (), max(timeout, 0.0))

    def ignore(self) -> None:
        """Ignore the signals for the rest of the process: it is done but for going down."""
        for number in self._former:
            signal.signal(number, signal.SIG_IGN)
        self._close_ends()

    def close(self) -> None:
        """Restore the signal handlers that were there before."""
        self._close_ends()
        self._armed = False
        for number, handler in self._former.items():
            signal.signal(number, handler)
        self._former.clear()

    def _close_ends(self) -> None:
        if self._ends is not None:
            if self._former:
                signal.set_wakeup_fd(self._former_wakeup)
            for end in self._ends:
                end.close()
            self._ends = None

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
