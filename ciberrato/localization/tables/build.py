"""Compute tables in a process of its own, for `ciberrato.localization.tables.worker`.

A thread would hold the interpreter's lock against the agent's loop, whose cycle is 50 ms. The request comes
pickled on standard input from the parent process; the tables go to a file, the progress to standard
output, a number a line, and behind that most memory held, in megabytes. Then the next request may come:
starting a process and loading numpy takes as long as the tables of a small lab.
"""

from __future__ import annotations

import pickle
import sys
from dataclasses import dataclass
from pathlib import Path

from ciberrato.reprs import short_repr
from ciberrato.system.process import lower_priority
from ciberrato.world.lab import Lab

_LARGE = 1500.0
"""Square units of a lab from which loading machine code (a second of processor time, as much as both tables
of a lab of 400) delays not even the coarse tables."""


@dataclass(frozen=True, slots=True)
class TableRequest:
    """Tables to compute, and the file for them."""

    __repr__ = short_repr

    lab: Lab
    angles: tuple[float, ...]
    resolution: float
    steps: int
    path: Path


def main() -> int:
    """Compute the tables requested on standard input, until it ends.

    Returns
    -------
    int
        Exit status: 0.
    """
    lower_priority()  # the loop that waits for this comes first
    while True:
        try:
            request = pickle.load(sys.stdin.buffer)
        except EOFError:
            return 0
        assert isinstance(request, TableRequest)
        _compute(request)


def _is_worth_loading(lab: Lab) -> bool:
    """Return whether tables are there sooner with machine code, loading it included."""
    from ciberrato.localization.belief import compiled

    wanted = compiled.choice()
    large = lab.width * lab.height >= _LARGE or wanted == "on"
    return large and wanted != "off" and compiled.at_hand()


def _compute(request: TableRequest) -> None:
    from ciberrato.localization.belief import compiled
    from ciberrato.localization.tables.cache import write_tables
    from ciberrato.localization.tables.pose_tables import build_tables
    from ciberrato.system.memory import memory_megabytes

    if _is_worth_loading(request.lab):
        compiled.load()
    shown = -1

    def progress(done: float) -> None:
        nonlocal shown
        if int(100 * done) > shown:
            shown = int(100 * done)
            print(f"{done:.2f}", flush=True)  # fails, and ends this process, when the parent is gone

    tables = build_tables(
        request.lab, request.angles, request.resolution, steps=request.steps, progress=progress
    )
    tables.complete(request.lab)
    write_tables(request.path, tables)
    print(f"memory {memory_megabytes():.1f}", flush=True)


if __name__ == "__main__":
    # Under its full name, so that the class of the request is the one that was pickled.
    from ciberrato.localization.tables.build import main as run

    # The parent is gone, or there is no room or no memory: that there are no tables is all it needs to know.
    try:
        sys.exit(run())
    except (BrokenPipeError, OSError, MemoryError, ImportError):
        sys.exit(1)
