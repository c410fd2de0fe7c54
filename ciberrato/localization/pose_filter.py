"""The pose filter for any program: from every message and command it estimates the pose.

Markov localization on a grid over (x, y, heading), refined by particles (Thrun, Burgard, Fox, *Probabilistic
Robotics*, sections 8.2 and 8.3). The lab's tables of expected readings are read from the user's cache, or
computed by another process while the robot already drives: coarse ones first, then fine ones.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.errors import UsageError
from ciberrato.geometry.angles import short_turns
from ciberrato.localization.arguments import check_arguments, check_seconds
from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.evidence.start_prior import ANYWHERE, StartPrior, check_start, parse_start
from ciberrato.localization.live.live_filter import LiveFilter
from ciberrato.localization.records import FilterSettings
from ciberrato.localization.tables.worker import TableWorker
from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import Measures
from ciberrato.protocol.order import MessageOrder, News
from ciberrato.reprs import html_repr, short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

ANGLES = (0.0, 60.0, -60.0, 180.0)
"""Mounting angles of the IR sensors in degrees, the simulator's defaults."""
MOST_MISSING = 500
"""Cycles; after a longer gap nothing is left of what was known, and the filter begins anew, anywhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Estimate of the robot's pose at a message.

    Attributes
    ----------
    time : int or None
        Simulated cycles, of the newest message; None before the first.
    x, y : float
        Units from the lab's lower left corner; nan until the coarse tables are ready.
    heading : float
        Radians within ±π, 0 along x, counter-clockwise; nan likewise.
    probability : float
        Probability of all poses within 0.5 units and 10 degrees; 0 until the coarse tables are ready.
    certain : bool
        The filter's claim to know the pose: a probability above 0.95.
    modes : tuple of PoseEstimate
        All poses that the belief is gathered around, the most probable first, each with its probability:
        eight at most. Empty until the coarse tables are there.
    entropy : float
        Entropy of the belief over all states, in bits; nan until the coarse tables are ready.
    behind : int
        Messages that are not weighed yet, for lack of time or tables; dead reckoning stands in for them.
    """

    __repr__ = short_repr
    _repr_html_ = html_repr

    time: int | None
    x: float
    y: float
    heading: float
    probability: float
    certain: bool
    modes: tuple[PoseEstimate, ...]
    entropy: float
    behind: int


class PoseFilter:
    """Follows the pose of a robot in a known lab, from any start.

    A context manager: entered, it fetches the tables in the background; left, it ends the processes and
    threads that do so. Without a ``with`` block the first message (or `wait`) begins that; `close` ends it.

    Parameters
    ----------
    lab : Lab
    parameters : Parameters
        As the simulator announced them: noise, latencies, which sensors there are.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees, counter-clockwise from the front.
    start : str or StartPrior
        Prior of the start: "anywhere", "centres" (of cells, four headings), "centres:DEGREES",
        "X,Y" or "X,Y,DEGREES".
    settings : FilterSettings, optional
        On the fine lattice.
    wait : bool
        Whether to wait for all tables now, for a recorded run or a simulation in lockstep: then every
        message is weighed at once, and the same messages give the same estimates to the last bit.
    budget : float, optional
        Seconds that `observe` may take for weighing messages; those left wait for the next call. Default:
        half of CycleTime, with `wait` no limit.
    tables : TableWorker, optional
        Started, and stopped by the caller; default: one of its own.
    clock : callable
        Seconds, for the budget.

    Raises
    ------
    ValueError
        If an argument is something else than it says; the message begins with its name.
    UsageError
        If `start` cannot be read or is no free place in the lab.

    Examples
    --------
    >>> from ciberrato import PoseFilter, find_lab, read_lab
    >>> with PoseFilter(read_lab(find_lab("maze")), parameters) as localizer:  # doctest: +SKIP
    ...     estimate = localizer.observe(measures, command)
    """

    _repr_html_ = html_repr

    def __init__(
        self,
        lab: Lab,
        parameters: Parameters,
        angles: tuple[float, float, float, float] = ANGLES,
        *,
        start: str | StartPrior = "anywhere",
        settings: FilterSettings | None = None,
        wait: bool = False,
        budget: float | None = None,
        tables: TableWorker | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        mounted = check_arguments(lab, parameters, angles, start, settings, wait, budget, tables, clock)
        try:
            prior = parse_start(start) if isinstance(start, str) else start
        except UsageError as error:
            raise UsageError(f"start: {error}") from None
        check_start(prior, lab)
        self.lab = lab
        self.parameters = parameters
        self._prior = prior
        self._settings = settings
        self._budget = math.inf if wait and budget is None else budget
        self._clock = clock
        self._tables = tables or TableWorker(lab, mounted)
        self._is_own = tables is None
        self._started = not self._is_own
        self._closed = False
        self._order = MessageOrder()
        self.live = self._begin(prior)
        """The queue of messages and the filter behind it, for programs that look deeper."""
        if wait:
            self.wait()

    def _begin(self, prior: StartPrior) -> LiveFilter:
        return LiveFilter(
            self.lab,
            self.parameters,
            self._tables,
            start=prior,
            settings=self._settings,
            budget=self._budget,
            clock=self._clock,
        )

    # --- tables -----------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start to fetch the tables, unless that has begun."""
        if self._closed:
            raise ValueError("the pose filter is closed")
        if not self._started:
            self._started = True
            self._tables.start()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all tables and the compiled loops (if numba is installed) are there.

        Parameters
        ----------
        timeout : float, optional
            Seconds; default: as long as it takes.

        Returns
        -------
        bool
            Whether they are.

        Raises
        ------
        Exception
            Whatever stopped the computation.
        """
        self.start()
        if timeout is not None:
            check_seconds("timeout", timeout)
        until = None if timeout is None else time.monotonic() + timeout
        for ready in (self._tables.wait, self._tables.wait_for_loops):
            if not ready(None if until is None else max(until - time.monotonic(), 0.0)):
                return False
        if self._tables.error is not None:
            raise self._tables.error
        return True

    def close(self) -> None:
        """Stop the processes and threads that fetch tables; more calls do no harm.

        The knowledge so far stays: with the coarse tables there, messages can still be observed.
        """
        self._closed = True
        if self._is_own and self._started:
            self._tables.stop()
            self._tables.join()

    def __enter__(self) -> PoseFilter:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    # --- messages ---------------------------------------------------------------------------------------

    def observe(self, measures: Measures, command: Command | None = None) -> Estimate:
        """Process a message and return the estimate of the pose.

        Call it with every message, in order, from the first one on or from any later one. Cycles whose
        message never came are made up for by the command; sensors that a message lacks (None) say nothing. A
        message older than the newest changes nothing (UDP may deliver late) and is counted in `stale`; only
        several in a row, of times that follow one another, show that a new simulation has begun.

        Parameters
        ----------
        measures : Measures
        command : (float, float) or None
            Left and right motor command in force in the cycles before this message, in units per cycle: the
            last one sent before it came. None: none was sent yet.

        Returns
        -------
        Estimate

        Raises
        ------
        ValueError
            If the command is not two finite numbers, a reading is not finite, the times are those of a new
            simulation (see `reset`), or the filter was closed before its coarse tables were there.
        """
        self.feed(measures, command)
        return self.estimate()

    def feed(self, measures: Measures, command: Command | None = None) -> None:
        """Process a message as `observe` does, without computing the estimate."""
        if not isinstance(measures, Measures):
            raise TypeError(f"measures: {measures!r:.60} is not a Measures")
        if command is not None and not _is_command(command):
            raise ValueError(f"command: {command!r:.60} is not the command of two motors")
        _check_readings(measures)
        newest = self._order.time
        if newest is not None and measures.time < newest:
            if self._order.judge(measures) is News.BEGUN_AGAIN:
                raise ValueError(
                    f"time {measures.time} after {newest}: the simulation has begun again; "
                    "reset() forgets the old one"
                )
            return
        if newest is not None and measures.time - newest > MOST_MISSING:
            # Reckoned cycle by cycle the pose would be spread over the lab by now, after a long time.
            self.live = self._begin(ANYWHERE)
        if not self._closed:
            self.start()
        elif self.live.filter is None:
            raise ValueError("the pose filter was closed before its tables were there")
        self._order.accept(measures)
        self.live.observe(measures, command)

    @property
    def stale(self) -> int:
        """Messages that were older than the newest, and ignored, since the start or `reset`."""
        return self._order.stale

    def estimate(self) -> Estimate:
        """Return the estimate of the pose, given the messages so far."""
        found, grid = self.live.estimate(), self.live.filter
        if found is None or grid is None:
            return Estimate(
                time=self._order.time,
                x=math.nan,
                y=math.nan,
                heading=math.nan,
                probability=0.0,
                certain=False,
                modes=(),
                entropy=math.nan,
                behind=self.live.lag,
            )
        return Estimate(
            time=self._order.time,
            x=found.x,
            y=found.y,
            heading=found.heading,
            probability=found.probability,
            certain=found.certain,
            modes=tuple(self.live.modes()),
            entropy=grid.belief.entropy_bits(),
            behind=self.live.lag,
        )

    def states(self) -> tuple[Floats, Floats]:
        """Return the belief as weighted poses: the lattice's states that are possible yet.

        Messages that wait to be weighed are not in it, nor is the refinement of a known pose by particles.

        Returns
        -------
        poses : ndarray, shape (n, 3)
            x, y in units, heading in radians; none until the coarse tables are there.
        weights : ndarray, shape (n,)
            Their probabilities; they sum to 1.
        """
        if self.live.filter is None:
            return np.empty((0, 3)), np.empty(0)
        belief = self.live.filter.belief
        bins, squares, weights = belief.listed()
        x, y = belief.places(bins, squares)
        masses = np.asarray(weights, np.float64)
        return np.column_stack((x, y, short_turns(belief.headings()[bins]))), masses / masses.sum()

    def reset(self) -> None:
        """Reset the filter: forget all messages; lab, parameters and start stay the same."""
        self._order = MessageOrder()
        self.live = self._begin(self._prior)


def _is_command(command: Any) -> bool:
    try:
        return len(command) == 2 and all(math.isfinite(power) for power in command)
    except (TypeError, ValueError):
        return False


def _check_readings(measures: Measures) -> None:
    """Refuse readings that are no numbers, which no simulator sends: one would spoil the belief for good."""
    gps = measures.gps or ()
    readings = {
        "infrared": measures.infrared,
        "compass": (measures.compass,),
        "gps": gps,
        "beacons": tuple(beacon.bearing for beacon in measures.beacons),
    }
    for name, values in readings.items():
        if not all(value is None or math.isfinite(value) for value in values):
            raise ValueError(
                f"{name} at time {measures.time}: {values!r}; readings are finite, or None if missing"
            )
