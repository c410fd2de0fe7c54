"""The pose filter inside the agent's loop: never late with an answer, whatever tables and belief cost.

Messages go through a queue. In each cycle as many are worked off as fit into a budget of time; what is
left waits for the next cycle, and the estimate is carried on by dead reckoning meanwhile. Nothing is
dropped: the filter is late by at most a few cycles while many states are possible, and catches up as soon as
little is. How late it was is counted.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence

from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.evidence.start_prior import StartPrior
from ciberrato.localization.filtering.alignment import dead_reckoned
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.live.moments import CellMoments
from ciberrato.localization.live.statistics import LiveStatistics
from ciberrato.localization.records import FilterSettings, Input
from ciberrato.localization.tables.pose_tables import COARSE, fine_resolution
from ciberrato.localization.tables.tiled import TiledTables
from ciberrato.localization.tables.worker import TableWorker
from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

_BUDGET = 0.5
_POLL = 0.05  # seconds
_CAUGHT_UP = 10  # messages that may wait when the filter has its say for the first time
_AT_REST = 30  # messages without a command in a row; by then the wheels have long come to rest


class LiveFilter:
    """Feeds a pose filter within a budget of time.

    Parameters
    ----------
    lab : Lab
    parameters : Parameters
        As announced.
    worker : TableWorker
        Started.
    start : str or StartPrior
        See `GridFilter`.
    settings : FilterSettings, optional
        On the fine lattice.
    budget : float or None
        Seconds a cycle; None = half of CycleTime, infinite: every message is taken in at once.
    clock : callable
        Seconds.
    """

    def __init__(
        self,
        lab: Lab,
        parameters: Parameters,
        worker: TableWorker,
        *,
        start: str | StartPrior = "anywhere",
        settings: FilterSettings | None = None,
        budget: float | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.lab = lab
        self._parameters = parameters
        self._worker = worker
        self._start = start
        self._settings = settings
        self.budget = _BUDGET * parameters.cycle_time / 1000.0 if budget is None else budget
        """Seconds that `observe` may take; at least one message is processed."""
        self._clock = clock
        self.history: list[Input] = []
        """The messages, each with the command that was in effect before it; of a long rest only some."""
        self.filter: GridFilter | None = None
        """None until there are tables."""
        self.unsure = False
        """Whether it is not known well when commands act: then no reading counts in full."""
        self._taken = 0
        self._rested = 0
        self.statistics = LiveStatistics()
        self.moments = CellMoments(lab)
        """The beliefs over cells at the moments that `mark` has asked for."""

    @property
    def lag(self) -> int:
        """Messages that the filter has not taken in yet."""
        return len(self.history) - self._taken

    @property
    def is_ready(self) -> bool:
        """Return whether the estimate is of now: tables are there, and the filter has caught up."""
        return self.statistics.ready is not None

    @property
    def doubtful_since(self) -> int | None:
        """Time (simulated cycles) since which the readings do not fit the lab; None: they do."""
        fit = None if self.filter is None else self.filter.map_fit
        return None if fit is None else fit.since

    def mark(self, time: int) -> None:
        """Request the belief over cells at a message; `moments` has it once the message is processed.

        Parameters
        ----------
        time : int
            Time of the message observed last, in simulated cycles.
        """
        self.moments.mark(time)
        if self.filter is not None and self.lag == 0:
            self.moments.take(self.filter.belief, time)

    def observe(self, measures: Measures, command_in_effect: Command | None, *, later: bool = False) -> None:
        """Queue a message, and process as much of the queue as the budget allows.

        Parameters
        ----------
        measures : Measures
        command_in_effect : (float, float) or None
            See `GridFilter.observe`.
        later : bool
            Whether to queue it only.
        """
        begin = self._clock()
        self._remember(measures, command_in_effect)
        if later:
            self.statistics.waited += measures.start and not self.is_ready
            return
        self._look_for_tables()
        end = begin + self.budget
        if self.filter is not None:
            was_fine = self.filter.is_fine
            self._taken = self._feed(self.filter, self._taken, end)
            if self.statistics.ready is None:
                if self.lag > _CAUGHT_UP:  # still at what came before the tables
                    self.statistics.waited += measures.start
                    return
                self.statistics.ready = measures.time
            if self.filter.is_fine and not was_fine and self.statistics.fine is None:
                self.statistics.fine = measures.time
            self.statistics.milliseconds.append(1000.0 * (self._clock() - begin))
            self.statistics.lags.append(self.lag)
        else:
            self.statistics.waited += measures.start

    def _remember(self, measures: Measures, command: Command | None) -> None:
        """Add a message to the history; of many at rest only the first few and the newest are kept."""
        resting = command is None or command == (0.0, 0.0)
        self._rested = self._rested + 1 if resting else 0
        if self._rested > _AT_REST:
            self.history[-1] = (measures, command)
            self._taken = min(self._taken, len(self.history) - 1)
        else:
            self.history.append((measures, command))

    def finish(self) -> GridFilter:
        """Process everything that is still waiting; without any tables yet, wait for the first.

        Returns
        -------
        GridFilter

        Raises
        ------
        Exception
            Whatever stopped the worker.
        """
        while self.filter is None and not self._worker.wait(_POLL):
            self._look_for_tables()
        self._look_for_tables()
        assert self.filter is not None
        self._taken = self._feed(self.filter, self._taken, math.inf)
        return self.filter

    def estimate(self) -> PoseEstimate | None:
        """Return the pose now, what is still waiting taken into account by dead reckoning."""
        if self.filter is None:
            return None
        return self._carry_on(self.filter.estimate())

    def modes(self) -> list[PoseEstimate]:
        """Return all poses that the belief is gathered around, the likeliest first."""
        if self.filter is None:
            return []
        return sorted((self._carry_on(mode) for mode in self.filter.modes()), key=_less_probable)

    def _look_for_tables(self) -> None:
        if self._worker.error is not None:
            raise self._worker.error
        coarse, fine = self._worker.coarse, self._worker.fine
        if self.filter is None and coarse is not None:
            self.filter = staged_filter(
                self.lab, coarse, fine or self._tiled(), self._parameters, self._settings, start=self._start
            )
            self.moments.begin(self.filter.belief)
        elif self.filter is not None and self.filter.fine is not None and self.filter.fine.tables is None:
            self.filter.fine.tables = fine or self._tiled()

    def _tiled(self) -> TiledTables | None:
        """Return fine tables of a lab too large for them; of this filter alone, which computes them."""
        coarse = self._worker.coarse
        is_large = fine_resolution(self.lab) >= COARSE
        return TiledTables(self.lab, coarse) if is_large and coarse is not None else None

    def _feed(self, pose_filter: GridFilter, taken: int, end: float) -> int:
        while taken < len(self.history) and self._clock() < end:
            measures, command = self.history[taken]
            if self.unsure:
                pose_filter.doubt_motion()
            pose_filter.observe(measures, command)
            self.moments.take(pose_filter.belief, measures.time)
            taken += 1
        return taken

    def _carry_on(self, found: PoseEstimate) -> PoseEstimate:
        assert self.filter is not None
        if self.lag == 0:
            return found
        waiting = self.history[max(self._taken - 1, 0) :]
        return dead_reckoned(found, self.filter.wheels, _commands(waiting))


def _commands(inputs: Sequence[Input]) -> list[Command]:
    """Command in effect in every simulated cycle between the messages."""
    commands: list[Command] = []
    for (before, _), (after, command) in itertools.pairwise(inputs):
        commands.extend([command or (0.0, 0.0)] * max(after.time - before.time, 0))
    return commands


def _less_probable(mode: PoseEstimate) -> float:
    return -mode.probability
