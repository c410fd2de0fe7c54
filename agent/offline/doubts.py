"""Doubts about the steps of a recorded run, where messages are missing in its log."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from agent.offline.localizer import Doubt
from ciberrato.localization.filtering.interruption import doubtful_cycles
from ciberrato.world.lab import CELL_SIZE

if TYPE_CHECKING:
    from ciberrato.files.run_records import RecordedRun

_STOPPED = 0.5
"""Probability that the robot was stopped somewhere in a gap: the dead reckoning takes it to have gone on."""
_NEAR = 0.8
"""Units that the reading of a cell's centre may be off before it may as well be that of any place."""


def doubts_of(run: RecordedRun) -> list[Doubt]:
    """Return what is not sure of each step of a run to the right.

    Parameters
    ----------
    run : RecordedRun

    Returns
    -------
    list of Doubt
        Nothing is doubtful in a log without longer gaps. After one, steps are doubtful for as far as the
        robot may have gone without being heard, and readings to the end: nothing tells how far it is along.
    """
    doubts = []
    way = unheard = 0.0  # units that were perhaps not driven: in all, and not made up for by steps
    for number, cycle in enumerate(run.cycles):
        before = run.cycles[number - 1] if number else cycle
        command = before.command or (0.0, 0.0)
        driven = doubtful_cycles(cycle.time - before.time, (command,)) * abs(command[0] + command[1]) / 2.0
        way, unheard = way + driven, unheard + driven
        if cycle.step is not None:
            step = _STOPPED * min(unheard / CELL_SIZE, 1.0)
            unheard = max(unheard - CELL_SIZE, 0.0)
            doubts.append(Doubt(step, _STOPPED * min(way / _NEAR, 1.0)))
    return doubts


def missing_in(run: RecordedRun) -> str | None:
    """Return how many cycles a log lacks; None if it lacks none.

    Parameters
    ----------
    run : RecordedRun
    """
    times = [cycle.time for cycle in run.cycles]
    gaps = [after - before - 1 for before, after in itertools.pairwise(times) if after > before + 1]
    if not gaps:
        return None
    return f"{sum(gaps)} cycles are missing, {max(gaps)} of them in a row: beliefs are wider for it"
