"""Measuring times, and rows of the table that compares them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One thing measured.

    Attributes
    ----------
    group : str
        Task: rows of one group are compared.
    who : str
        Program that did it.
    seconds : float or None
        Time for doing it once; None if it could not be measured (the note says why).
    reference : bool
        Ratios of the group are to this row.
    ours : bool
        Ours, and not a comparison.
    megabytes : float or None
        Memory that holds state, tables and results.
    moved : float or None
        Bytes that must at least be read and written once; compared with the machine's memory bandwidth.
    target : float or None
        Seconds that were asked for.
    note : str
    """

    group: str
    who: str
    seconds: float | None
    reference: bool = False
    ours: bool = False
    megabytes: float | None = None
    moved: float | None = None
    target: float | None = None
    note: str = ""


def best_time(work: Callable[[], Any], *, budget: float = 0.5, repeats: int = 5) -> float:
    """Return the least time for one call, out of some series, in about `budget` seconds.

    The least is what the machine can do: other programs only ever add to it.
    """
    start = time.perf_counter()
    work()
    once = max(time.perf_counter() - start, 1e-7)
    calls = max(1, int(budget / repeats / once))
    best = once
    for _ in range(repeats):
        start = time.perf_counter()
        for _ in range(calls):
            work()
        best = min(best, (time.perf_counter() - start) / calls)
        if once * calls > budget:
            break
    return best


def absent(group: str, who: str, package: str) -> Iterator[Row]:
    """Return the row of a comparison whose package is not installed."""
    yield Row(group=group, who=who, seconds=None, note=f"skipped: pip install {package}")
