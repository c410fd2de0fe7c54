"""Statistics of the live filter's deadlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ciberrato.localization.belief import compiled
from ciberrato.localization.tables.worker import TableWorker
from ciberrato.reprs import short_repr
from ciberrato.system.memory import memory_megabytes


@dataclass(slots=True)
class LiveStatistics:
    """Statistics of the live filter's deadlines.

    Attributes
    ----------
    milliseconds : list of float
        Time used in every cycle.
    lags : list of int
        Messages left waiting after every cycle, since there are tables.
    answers : list of float
        Milliseconds from the arrival of a message to its answer, of all that the network has stamped.
    waited : int
        Messages with Start on before the filter had tables and had caught up.
    ready, fine : int or None
        Times (simulated cycles) at which the filter began, and changed to fine tables.
    """

    __repr__ = short_repr

    milliseconds: list[float] = field(default_factory=list)
    lags: list[int] = field(default_factory=list)
    answers: list[float] = field(default_factory=list)
    waited: int = 0
    ready: int | None = None
    fine: int | None = None

    def lines(
        self, worker: TableWorker, *, cycle_time: float, lost: int = 0, unanswered: int = 0
    ) -> list[str]:
        """Sum up in a few lines, as the agent prints them and the benchmarks read them.

        Parameters
        ----------
        worker : TableWorker
            Worker from which the tables came.
        cycle_time : float
            Milliseconds; an answer that takes longer misses its cycle.
        lost : int
            Cycles whose Measures never came.
        unanswered : int
            Measures that were overtaken by newer ones before they were answered.

        Returns
        -------
        list of str
        """
        slow = sum(milliseconds > cycle_time for milliseconds in self.answers)
        half = sum(milliseconds > cycle_time / 2.0 for milliseconds in self.answers)
        answers = (
            f"answers: {_spread(self.answers)}; {slow} of {len(self.answers)} later than a cycle of "
            f"{cycle_time:g} ms, {half} than half a cycle; {unanswered} Measures unanswered, {lost} lost; "
            f"no belief yet in {self.waited} cycles"
        )
        if not self.milliseconds:
            return ["filter: no tables, or never caught up with what came before them", answers]
        late = sum(lag > 0 for lag in self.lags)
        loops = "numpy" if compiled.kernels() is None else "numba"
        tables = ", ".join(f"{which} after {seconds:.2f} s" for which, seconds in worker.seconds.items())
        return [
            f"filter ({loops}): {_spread(self.milliseconds)}; "
            f"behind in {late} of {len(self.lags)} cycles, by {max(self.lags, default=0)} at most",
            answers,
            f"tables: {tables}; memory at most {memory_megabytes():.0f} MB, "
            f"{worker.megabytes:.0f} MB of another process for computing tables",
        ]


def _spread(milliseconds: Sequence[float]) -> str:
    ordered = sorted(milliseconds)
    if not ordered:
        return "none"
    return (
        f"{ordered[len(ordered) // 2]:.1f} ms a cycle (median), "
        f"{ordered[int(0.99 * (len(ordered) - 1))]:.1f} ms (99 %), {ordered[-1]:.1f} ms (most)"
    )
