"""Event loops: what the one of Windows cannot do."""

from __future__ import annotations

import asyncio
import contextlib
import select
import signal
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from ciberrato.system.signals import ENDING

_T = TypeVar("_T")


def run_with_sockets(program: Coroutine[Any, Any, _T]) -> _T:
    """Run a coroutine in an event loop that can watch sockets; the usual one of Windows cannot."""
    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        return runner.run(program)


def stop_on_signals(loop: asyncio.AbstractEventLoop, stop: Callable[[], None]) -> None:
    """Call a function in a loop on the signals that ask a program to end; only in the main thread."""
    for number in ENDING:
        try:
            loop.add_signal_handler(number, stop)
        except NotImplementedError:
            # Windows: the handler runs when the main thread is back from waiting, at most a tick later.
            with contextlib.suppress(ValueError):  # not in the main thread
                signal.signal(number, lambda *_: call_in(loop, stop))
        except (ValueError, RuntimeError):  # not in the main thread
            return


def call_in(loop: asyncio.AbstractEventLoop, call: Callable[[], None]) -> None:
    """Call a function in a loop, from a thread or a signal handler; not if the loop has ended."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(call)


async def readable(descriptor: int, seconds: float) -> None:
    """Wait until there is something to read from a socket, or for some seconds.

    Parameters
    ----------
    descriptor : int
    seconds : float
        Not less than 0.
    """
    loop = asyncio.get_running_loop()
    ready = asyncio.Event()
    try:
        loop.add_reader(descriptor, ready.set)
    except NotImplementedError:  # in a loop of the user's, on Windows: a thread waits instead
        await asyncio.to_thread(select.select, (descriptor,), (), (), seconds)
        return
    try:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(ready.wait(), seconds)
    finally:
        loop.remove_reader(descriptor)
