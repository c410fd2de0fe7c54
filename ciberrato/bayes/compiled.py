"""Whether steps over large grids run in machine code (the extra `fast`), on all cores.

`load` loads the loops of `ciberrato.bayes.loops`; a `ScanTable` or `TurnDriveTurn` over `LARGE` states or
more does so by itself, if numba is there and `CIBERRATO_COMPILED` is not ``off``. Compiling takes some
twenty seconds once, reading the loops from numba's cache half a second. Results differ from numpy's by
rounding: each function that uses the loops says by how much, and tests hold it to that.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from types import ModuleType
from typing import TypeVar

from ciberrato.errors import UsageError
from ciberrato.machine_code import VARIABLE, available, choice

LARGE = 1_000_000
"""Number of states from which the loops are loaded without being asked for."""
LEAST_SHARE = 250_000
"""Number of states for which another thread is worth its while."""

_T = TypeVar("_T")
_active: ModuleType | None = None


def kernels() -> ModuleType | None:
    """Return the compiled loops if they are loaded and in use."""
    return _active


def use(module: ModuleType | None) -> None:
    """Use these loops from now on, or, with None, those of numpy."""
    global _active
    _active = module


def load() -> bool:
    """Load the compiled loops, unless they are not wanted or not there.

    Returns
    -------
    bool
        Whether they are in use now.

    Raises
    ------
    UsageError
        If `CIBERRATO_COMPILED` is none of its values, or ``on`` and numba cannot be loaded.
    """
    if choice() == "off" or not available():
        return False
    if _active is None:
        try:
            from ciberrato.bayes import loops
        except Exception as error:  # a numba that does not fit this Python or numpy, no memory
            if choice() == "on":
                raise UsageError(f"{VARIABLE}=on: {error}") from None
            return False
        use(loops)
    return True


def load_for(states: int) -> None:
    """Load the compiled loops if there are `LARGE` states or more."""
    if states >= LARGE:
        load()


def share(work: Callable[[int, int], _T], parts: int, states: int) -> list[_T]:
    """Call a function for runs of parts, in as many threads as there are cores.

    Parameters
    ----------
    work : callable
        (begin, end) -> result of parts begin to end - 1; must not hold the interpreter lock.
    parts : int
        Number of parts.
    states : int
        Number of states in all of them; each thread gets `LEAST_SHARE` or more.

    Returns
    -------
    list
        Results in the order of the parts.
    """
    threads = max(1, min(_cores(), states // LEAST_SHARE, parts))
    ends = [parts * k // threads for k in range(threads + 1)]
    if threads == 1:
        return [work(0, parts)]
    waiting = [_pool().submit(work, begin, end) for begin, end in pairwise(ends[1:])]
    return [work(0, ends[1]), *(part.result() for part in waiting)]


@cache
def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, _cores() - 1), "ciberrato-bayes")
