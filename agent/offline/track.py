"""Track of the robot over a run, in the lab's frame, as far as the log and the beliefs show."""

from __future__ import annotations

import numpy as np

from agent.offline.summary import peak
from ciberrato.arrays import Floats
from ciberrato.files.run_records import RecordedRun
from ciberrato.world.lab import CELL_SIZE


def estimated_track(run: RecordedRun, beliefs: Floats) -> Floats | None:
    """Place the path that was driven so that it ends where the last belief is.

    The log holds the path relative to the start cell; the most likely cell of the last step, so many cells to
    the right of the start, tells where that is.

    Parameters
    ----------
    run : RecordedRun
    beliefs : ndarray, shape (steps + 1, rows, columns)

    Returns
    -------
    ndarray, shape (cycles, 3), or None
        x, y in units and heading in degrees; None if nothing was recorded, the last belief is undefined or
        another drive than the one to the right drove.
    """
    steps = run.steps
    if not steps or np.isnan(beliefs[-1]).any():
        return None
    row, column = peak(beliefs[-1]).cells[0]
    start_x = (column - steps[-1].index + 0.5) * CELL_SIZE
    start_y = (row + 0.5) * CELL_SIZE
    if any(cycle.displacement is None for cycle in run.cycles):
        return None
    return np.array(
        [
            (start_x + (cycle.displacement or 0.0), start_y + (cycle.lateral or 0.0), cycle.heading or 0.0)
            for cycle in run.cycles
        ]
    )
