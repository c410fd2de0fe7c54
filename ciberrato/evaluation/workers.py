"""Worker processes of an evaluation, which end with it however that ends."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.context import SpawnContext, SpawnProcess

from ciberrato.system.ending import held_back, left_on_termination


@contextlib.contextmanager
def worker_processes(number: int) -> Iterator[ProcessPoolExecutor]:
    """Provide worker processes in a block; if it ends by an exception, they drop what they are at.

    Parameters
    ----------
    number : int
        Processes to start, when there is work for them.
    """
    executor = ProcessPoolExecutor(number, _Context())
    try:
        yield executor
    except BaseException:
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


class _Worker(SpawnProcess):
    def start(self) -> None:
        with held_back():
            super().start()

    def run(self) -> None:
        with left_on_termination():
            super().run()


class _Context(SpawnContext):
    Process = _Worker
