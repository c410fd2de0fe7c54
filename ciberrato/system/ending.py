"""Signals that end a program by an exception: one that gets lost on its way is raised anew.

An exception that a signal handler raises in a destructor, in the callback of a weak reference or in a
function that C calls goes no further: Python prints it, and the program would go on.
"""

from __future__ import annotations

import _thread
import contextlib
import signal
import sys
import time
from collections.abc import Iterator
from types import FrameType
from typing import Any

from ciberrato.system.signals import ENDING, ended_at_once

AGAIN = 0.05
"""Seconds after which an exception that was lost is raised anew: what lost it may be over by then."""


class TerminatedError(KeyboardInterrupt):
    """Another program asks this one to end: like a Ctrl-C, it ends everything on its way out."""


def word_and_status(interrupt: KeyboardInterrupt) -> tuple[str, int]:
    """Return the word for what has ended a program, and the exit status by which a shell knows it."""
    if isinstance(interrupt, TerminatedError):
        return "terminated", 128 + signal.SIGTERM
    return "interrupted", 128 + signal.SIGINT


@contextlib.contextmanager
def raised_for_signals() -> Iterator[None]:
    """Raise what a signal asks for while the block runs: KeyboardInterrupt, or `TerminatedError`.

    Only in the main thread. A signal that is ignored, as by nohup, or that has a handler of its own stays so.
    The second SIGTERM of several changes nothing: what the first one began takes its time.
    """
    handlers = {number: _interrupt if number == signal.SIGINT else _terminate for number in ENDING}
    defaults = (signal.SIG_DFL, signal.default_int_handler, ended_at_once)
    with _Raising({number: raised for number, raised in handlers.items() if _handler(number) in defaults}):
        yield


@contextlib.contextmanager
def left_on_termination() -> Iterator[None]:
    """End a worker process by `SystemExit` on SIGTERM while the block runs, and ignore Ctrl-C.

    A Ctrl-C goes to all processes of a terminal: the parent process handles it, and ends this one by
    SIGTERM, on which it removes what is half written.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with _Raising({signal.SIGTERM: _leave}):
        yield


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Keep Ctrl-C back while the block starts a worker process, which inherits that; not on Windows.

    Without it a worker that is still loading would print a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its start lets the signals through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interrupt() -> BaseException:
    return KeyboardInterrupt()


def _terminate() -> BaseException:
    return TerminatedError()


def _leave() -> BaseException:
    return SystemExit(128 + signal.SIGTERM)


def _handler(number: int) -> Any:
    return signal.getsignal(number)


class _Raising:
    """Handlers that raise an exception, and raise it anew if it is lost.

    Parameters
    ----------
    exceptions : dict
        Makes the exception, by the number of the signal.
    """

    def __init__(self, exceptions: dict[int, Any]) -> None:
        self._exceptions = exceptions
        self._raised: dict[int, BaseException] = {}
        self._former: dict[int, Any] = {}
        self._former_hook = sys.unraisablehook
        self._thread = _thread.get_ident()

    def __enter__(self) -> None:
        with contextlib.suppress(ValueError):  # not in the main thread: what runs us there ends us otherwise
            for number in self._exceptions:
                self._former[number] = signal.signal(number, self._raise)
            self._former_hook, sys.unraisablehook = sys.unraisablehook, self._unraisable

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        if not self._former:
            return
        sys.unraisablehook = self._former_hook
        for number, handler in self._former.items():
            signal.signal(number, handler)
        self._former.clear()
        if isinstance(error, ImportError | SystemError) and self._raised:
            # C code has put its own in place of ours: numpy says that it is not installed properly.
            raise next(iter(self._raised.values())) from None

    def _raise(self, number: int, frame: FrameType | None) -> None:
        if number != signal.SIGINT and number in self._raised:
            return  # one is enough
        self._raised[number] = self._exceptions[number]()
        raise self._raised[number]

    def _unraisable(self, unraisable: Any) -> None:
        for number, exception in self._raised.items():
            if unraisable.exc_value is exception:
                del self._raised[number]
                # Not by a threading.Timer: its locks may be held by what was interrupted.
                _thread.start_new_thread(self._send_again, (number,))
                return
        self._former_hook(unraisable)

    def _send_again(self, number: int) -> None:
        time.sleep(AGAIN)
        if number not in self._former:
            return  # the block is over
        if hasattr(signal, "pthread_kill"):  # which wakes the main thread where it waits, too
            signal.pthread_kill(self._thread, number)
        else:
            _thread.interrupt_main(signal.Signals(number))
