"""From Measures to commands with the pose filter in the loop."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from agent.drives.right.controller import Controller
from agent.run.drive_controller import BEHIND, DriveController
from agent.run.live_belief import BeliefLog
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.protocol.order import News

if TYPE_CHECKING:
    from agent.drives.base import Drive
    from agent.drives.exchange import Exchange
    from ciberrato.localization.pose_filter import PoseFilter

_ENTROPY_EVERY = 5  # cycles between two looks at the entropy of a belief over very many states
_MANY = 50_000
_RELAYED_BUDGET = 4.0
"""Cycles that the filter may take to catch up where another process answers meanwhile."""


class LiveController:
    """Lets the pose filter take every message in, and a controller decide on the answer.

    Parameters
    ----------
    header : RunHeader
        Facts that are known when the run begins.
    localizer : PoseFilter
    drive : Drive or None
        None: to the right, as `Controller` does it.
    exit_at_wall : bool
        See `Controller`; of no matter to other drives.
    exit_when_finished : bool
        See `DriveController`.
    lockstep : bool
        Whether the simulator waits for every answer: then no clock has a say in what was in effect when.
    """

    def __init__(
        self,
        header: RunHeader,
        localizer: PoseFilter,
        drive: Drive | None,
        *,
        exit_at_wall: bool = False,
        exit_when_finished: bool = False,
        lockstep: bool = False,
    ) -> None:
        self.localizer = localizer
        self.controller: Controller | DriveController = (
            Controller(header, exit_at_wall=exit_at_wall)
            if drive is None
            else DriveController(
                header.parameters,
                drive,
                localizer,
                angles=header.sensor_angles,
                cruise=header.cruise,
                exit_when_finished=exit_when_finished,
            )
        )
        self.cell_entered: tuple[int, int] | None = None
        """The cell that the last message found the robot to have entered, if it did."""
        self.exchange.lockstep = lockstep
        self._arrived: float | None = None
        self._cell: tuple[int, int] | None = None
        self._crossings = 0
        self._entropy: float | None = None
        self._belief_log = BeliefLog(localizer.live, localizer.lab.rows, localizer.lab.columns)

    @property
    def ended(self) -> str | None:
        """Reason why the run is over, as soon as it is."""
        return self.controller.ended

    @property
    def exchange(self) -> Exchange:
        """The account of messages and answers."""
        return self.controller.exchange

    def observe(
        self, measures: Measures, *, newest: bool = True, arrived: float | None = None
    ) -> tuple[Cycle, Actions | None]:
        """Process one message, see `Controller.observe`."""
        self._arrived = arrived if newest else None
        if self.exchange.lockstep:
            arrived = None
        live, later = self.localizer.live, False
        if self.exchange.is_relayed:
            live.budget = _RELAYED_BUDGET * self.exchange.pace.seconds
            later = not newest and measures.start
        if self.exchange.is_unsure(arrived):
            self.localizer.live.unsure = True  # answers act cycles later, which one is not known exactly
        if self.exchange.judge(measures) is News.FRESH:
            acted = self.exchange.command_in_effect(arrived, measures.time)
            self.localizer.feed(measures, acted, later=later)
        cycle, actions = self.controller.observe(measures, newest=newest, arrived=arrived)
        if later:
            self.cell_entered = None
            return self._with_step(cycle, measures, entered=False), actions
        return self._add_pose(cycle, measures), actions

    def sent(self, time: float) -> None:
        """Record the answer, see `Controller.sent`."""
        self.controller.sent(time)
        if self._arrived is not None:
            self.localizer.live.statistics.answers.append(1000.0 * (time - self._arrived))

    def _add_pose(self, cycle: Cycle, measures: Measures) -> Cycle:
        """Write the live estimate into the record; with a drive, a step is a cell known to be entered."""
        live = self.localizer.live
        found, grid = live.estimate(), live.filter
        self.cell_entered = None
        behind = self.exchange.is_relayed and live.lag > BEHIND
        if found is None or grid is None or not live.is_ready or behind:
            # What is not of now is no belief that anybody should be shown.
            return self._with_step(cycle, measures, entered=False)
        belief = grid.belief
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
        if isinstance(self.controller, Controller):  # which takes its steps itself
            return cycle
        first = self._crossings == 0 and measures.start
        if not (first or (entered and self._crossings > 0)):
            return cycle
        step, self._crossings = self._crossings, self._crossings + 1
        self.localizer.live.mark(measures.time)
        return dataclasses.replace(cycle, step=step, readings=measures.infrared)
