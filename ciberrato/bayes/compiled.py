"""Whether steps over large grids run in machine code (the extra `fast`), on all cores.

`load` loads the loops of `ciberrato.bayes.loops`. A `ScanTable` or `TurnDriveTurn` over `LARGE` states or
more does so by itself, for beliefs of that size, if numba is there and `CIBERRATO_COMPILED` is not ``off``.
Compiling takes half a minute once, reading the loops from numba's cache half a second. Results differ
from numpy's by rounding: each function that uses the loops says by how much, and tests hold it to that.
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
from ciberrato.system.process import processors

LARGE = 1_000_000
"""Number of states from which the loops are loaded without being asked for."""
LEAST_SHARE = 250_000
"""Least number of states of a run of parts: for fewer, another thread is not worth its while."""

_T = TypeVar("_T")
_active: ModuleType | None = None
_for_large: ModuleType | None = None


def kernels(states: int) -> ModuleType | None:
    """Return the compiled loops if so many states are to use them.

    Parameters
    ----------
    states : int
        Of the belief. What a small one gets does not depend on whether there was a large one before.
    """
    return _active or (_for_large if states >= LARGE else None)


def loaded() -> ModuleType | None:
    """Return the compiled loops if they are loaded, for what they do to the last bit as numpy."""
    return _active or _for_large


def use(module: ModuleType | None) -> None:
    """Use these loops from now on, or, with None, those of numpy, for all sizes."""
    global _active, _for_large
    _active, _for_large = module, None


def load() -> bool:
    """Load the compiled loops for beliefs of all sizes, unless they are not wanted or not there.

    Returns
    -------
    bool
        Whether they are in use now.

    Raises
    ------
    UsageError
        If `CIBERRATO_COMPILED` is none of its values, or ``on`` and numba cannot be loaded.
    """
    if _active is None:
        use(_loaded())
    return _active is not None


def load_for(states: int) -> None:
    """Load the compiled loops, for beliefs of `LARGE` states or more, if this is one."""
    global _for_large
    if states >= LARGE and _active is None:
        _for_large = _loaded()


def _loaded() -> ModuleType | None:
    if choice() == "off" or not available():
        return None
    try:
        from ciberrato.bayes import loops
    except Exception as error:  # a numba that does not fit this Python or numpy, no memory
        if choice() == "on":
            raise UsageError(f"{VARIABLE}=on: {error}") from None
        return None
    return loops


def share(work: Callable[[int, int], _T], parts: int, states: int) -> list[_T]:
    """Call a function for runs of parts, in threads, as many at a time as there are cores.

    Parameters
    ----------
    work : callable
        (begin, end) -> result of parts begin to end - 1; must not hold the interpreter lock.
    parts : int
        Number of parts.
    states : int
        Number of states in all of them; each run has `LEAST_SHARE` or more, if there are as many.

    Returns
    -------
    list
        Results in the order of the parts.
    """
    # Their number does not depend on the cores, and so no sum over the parts does.
    count = max(1, min(states // LEAST_SHARE, parts))
    ends = [parts * k // count for k in range(count + 1)]
    if count == 1 or _cores() == 1:
        return [work(begin, end) for begin, end in pairwise(ends)]
    return list(_pool().map(work, ends[:-1], ends[1:]))


@cache
def _cores() -> int:
    return processors()


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_cores(), "ciberrato-bayes")


if hasattr(os, "register_at_fork"):
    # A forked process has none of the threads, and would wait for them without end.
    os.register_at_fork(after_in_child=_pool.cache_clear)
