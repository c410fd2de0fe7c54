"""Compute tables in a process of its own, for `ciberrato.localization.tables.worker`.

A thread would hold the interpreter's lock against the agent's loop, whose cycle is 50 ms. The request comes
pickled on standard input from the parent process; the tables go to a file, the progress to standard
output, a number a line, and behind that the most memory held, in megabytes.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import sys
from dataclasses import dataclass
from pathlib import Path

from ciberrato.world.lab import Lab


@dataclass(frozen=True, slots=True)
class TableRequest:
    """What to compute, and where to put it."""

    lab: Lab
    angles: tuple[float, ...]
    resolution: float
    steps: int
    path: Path


def main() -> int:
    """Compute the tables requested on standard input.

    Returns
    -------
    int
        Exit status: 0.
    """
    request = pickle.load(sys.stdin.buffer)
    assert isinstance(request, TableRequest)
    with contextlib.suppress(OSError):
        os.nice(5)  # the loop that waits for this comes first
    from ciberrato.localization.tables.cache import write_tables
    from ciberrato.localization.tables.memory import memory_megabytes
    from ciberrato.localization.tables.pose_tables import build_tables

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
    return 0


if __name__ == "__main__":
    # Under its full name, so that the class of the request is the one that was pickled.
    from ciberrato.localization.tables.build import main as run

    with contextlib.suppress(BrokenPipeError):
        sys.exit(run())
