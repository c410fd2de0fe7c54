"""From Measures to commands with the pose filter in the loop."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from agent.drives.right.controller import Controller
from agent.drives.right.tracker import STANDSTILL, Command
from agent.run.live_belief import BeliefLog
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.protocol.messages import Actions, Measures

if TYPE_CHECKING:
    from agent.drives.base import Decision, Drive
    from ciberrato.localization.live_filter import LiveFilter

_ENTROPY_EVERY = 5  # cycles between two looks at the entropy of a belief over very many states
_MANY = 50_000


class LiveController(Controller):
    """Lets the pose filter take every message in, and a drive decide on the answer.

    Parameters
    ----------
    header : RunHeader
        What is known of the run.
    live : LiveFilter
    drive : Drive or None
        None: to the right, as `Controller` does it.
    exit_at_wall : bool
        See `Controller`.
    exit_when_finished : bool
        Whether the run is over when the drive has nothing more to do.
    lockstep : bool
        Whether the simulator waits for every answer: then no clock has a say in what was in effect when.
    """

    def __init__(
        self,
        header: RunHeader,
        live: LiveFilter,
        drive: Drive | None,
        *,
        exit_at_wall: bool = False,
        exit_when_finished: bool = False,
        lockstep: bool = False,
    ) -> None:
        super().__init__(header, exit_at_wall=exit_at_wall)
        self.live = live
        self.finished: str | None = None
        """Why the drive has nothing more to do, as soon as that is so."""
        self.cell_entered: tuple[int, int] | None = None
        """The cell that the last message found the robot to have entered, if it did."""
        self._lockstep = lockstep
        self._arrived: float | None = None
        self._drive = drive
        self._exit_when_finished = exit_when_finished
        self._decision: Decision | None = None
        self._cell: tuple[int, int] | None = None
        self._crossings = 0
        self._entropy: float | None = None
        self._belief_log = BeliefLog(live, live.lab.rows, live.lab.columns)

    def observe(
        self, measures: Measures, *, newest: bool = True, arrived: float | None = None
    ) -> tuple[Cycle, Actions | None]:
        """See `Controller.observe`."""
        self._arrived = arrived if newest else None
        if self._lockstep:
            arrived = None
        if self._time is None or measures.time >= self._time:
            self.live.observe(measures, self.command_in_effect(arrived))
        self._decision = None
        cycle, actions = super().observe(measures, newest=newest, arrived=arrived)
        if actions is not None and self._decision is not None:
            actions = dataclasses.replace(
                actions,
                end_led=self._decision.end_led,
                returning_led=self._decision.returning_led,
                visiting_led=self._decision.visiting_led,
            )
        return self._add_pose(cycle, measures), actions

    def sent(self, time: float) -> None:
        """See `Controller.sent`."""
        super().sent(time)
        if self._arrived is not None and self.live.statistics.ready is not None:
            self.live.statistics.answers.append(1000.0 * (time - self._arrived))

    def _decide(self, measures: Measures) -> Command:
        if self._drive is None:
            return super()._decide(measures)
        if not measures.start or self.live.filter is None:
            return STANDSTILL
        self._decision = decision = self._drive.decide(measures, self.live.filter)
        if decision.finished is not None:
            self.finished = decision.finished
            # Not before the answer that switches the LEDs on has come back.
            if self._exit_when_finished and decision.end_led is None:
                self.ended = decision.finished
        return decision.command

    def _add_pose(self, cycle: Cycle, measures: Measures) -> Cycle:
        """Write the live estimate into the record; with a drive, a step is a cell known to be entered."""
        found = self.live.estimate()
        self.cell_entered = None
        if found is None:
            return self._with_step(cycle, measures, entered=False)
        assert self.live.filter is not None
        belief = self.live.filter.belief
        if belief.states <= _MANY or self._entropy is None or measures.time % _ENTROPY_EVERY == 0:
            self._entropy = round(belief.entropy_bits(), 3)
        entered = found.certain and found.cell != self._cell
        if entered:
            self.cell_entered = self._cell = found.cell
        cycle = self._with_step(cycle, measures, entered=entered)
        heading = round(math.degrees(found.heading), 3)
        pose = (round(found.x, 4), round(found.y, 4), heading, round(found.probability, 4))
        cells, modes = self._belief_log.entries(measures.time)
        return dataclasses.replace(cycle, estimate=pose, entropy=self._entropy, cells=cells, modes=modes)

    def _with_step(self, cycle: Cycle, measures: Measures, *, entered: bool) -> Cycle:
        if self._drive is None:
            return cycle
        first = self._crossings == 0 and measures.start
        step = self._crossings if first or (entered and self._crossings > 0) else None
        self._crossings += step is not None
        return dataclasses.replace(
            cycle,
            phase=type(self._drive).__name__.removesuffix("Drive").lower(),
            step=step,
            readings=measures.infrared if step is not None else None,
        )

    def _check_end(self, measures: Measures) -> None:
        if measures.end_led and self._drive is not None:
            # Set by the drive itself: it has arrived.
            self.ended = self.finished or "EndLed is on"
            return
        super()._check_end(measures)
