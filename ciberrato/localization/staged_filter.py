"""Coarse first, fine later: the pose filter that keeps within a cycle's time from the first message on.

While much is possible the belief is kept on the coarse lattice, whose states are a fifth as many. As soon
as few states are left, their weight is spread over the squares of the fine lattice that they cover, and
the fine filter goes on from there. If the robot turns out to be elsewhere, everything is possible again,
and it is the coarse filter's turn. Drives and reports see one filter.
"""

from __future__ import annotations

import numpy as np

from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.challenge import PERIOD, Duel
from ciberrato.localization.evidence.start_prior import StartPrior
from ciberrato.localization.evidence.symmetry import PoseScore
from ciberrato.localization.grid_filter import Command, PoseFilter
from ciberrato.localization.records import FilterSettings, FilterStep
from ciberrato.localization.refinement.refiner import Refinement
from ciberrato.localization.tables.pose_tables import PoseTables
from ciberrato.protocol.messages import Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

COARSE_SETTINGS = FilterSettings()
FEW = 4000
"""States of the coarse belief that the fine filter takes over."""


class StagedFilter(PoseFilter):
    """A pose filter on two lattices.

    Parameters
    ----------
    lab : Lab
    coarse : PoseTables
    fine : PoseTables or None
        May come later, see `fine_tables`.
    parameters : Parameters
        As announced.
    settings : FilterSettings, optional
        Of the fine filter.
    start : str or StartPrior
        See `PoseFilter`.
    generator : numpy.random.Generator, optional
        For the particles that refine the estimate; the default is always the same one.
    """

    def __init__(
        self,
        lab: Lab,
        coarse: PoseTables,
        fine: PoseTables | None,
        parameters: Parameters,
        settings: FilterSettings | None = None,
        *,
        start: str | StartPrior = "anywhere",
        generator: np.random.Generator | None = None,
    ) -> None:
        super().__init__(lab, coarse, parameters, COARSE_SETTINGS, start=start)
        self._fine_settings = settings or FilterSettings()
        self.fine_tables = fine
        """Tables of the fine lattice, as soon as they are there."""
        self._coarse = coarse
        self._duel: Duel | None = None
        self._waited = 0
        self.refinement = Refinement(lab, coarse.angles, parameters, generator or np.random.default_rng(0))
        """Particles around the pose, while it is known."""
        self._score = PoseScore(
            lab, coarse.angles, parameters.obstacle_noise, parameters.compass_noise, self._beacons
        )

    @property
    def is_fine(self) -> bool:
        """Whether the belief is on the fine lattice."""
        return self.tables is not self._coarse

    @property
    def planning_tables(self) -> PoseTables:
        """Tables whose lattice stays the same for the whole run: the coarse ones."""
        return self._coarse

    def observe(self, measures: Measures, command_in_effect: Command | None) -> None:
        """See `PoseFilter.observe`."""
        wheels, time = self._wheels, self._time
        super().observe(measures, command_in_effect)
        self._challenge(measures, command_in_effect, wheels, time)
        if self.is_fine or self.fine_tables is None or self.belief.dense is not None:
            return
        if self.belief.states <= FEW:
            self._change(self.fine_tables, self._fine_settings)

    def _follow(self, step: FilterStep) -> None:
        self.refinement.follow(step, min(step.exponent / self.settings.exponent, 1.0))

    def _refined(self, found: PoseEstimate) -> PoseEstimate:
        return self.refinement.refine(found, self.belief)

    def _challenge(
        self, measures: Measures, command: Command | None, wheels: Command, time: int | None
    ) -> None:
        """Let a challenger take part, if it is time for one."""
        if self.last_step is None or not self.last_step.motions:
            return
        if self._duel is None:
            if self.belief.dense is None:
                self._waited += 1
            if self._waited < PERIOD or self._lag > 0:
                return
            self._waited = 0
            challenger = PoseFilter(self.lab, self._coarse, self.parameters, COARSE_SETTINGS)
            challenger.take_over_odometry(wheels, time)
            self._duel = Duel(challenger, self._score)
        self._duel.challenger.observe(measures, command)
        won = self._duel.judge(super().estimate(), self.last_step, self.belief)
        if won is None:
            return
        challenger, self._duel = self._duel.challenger, None
        if won:
            self.restarts.append(measures.time)
            self.alarm_level = 0.0
            self.tables, self.settings = self._coarse, COARSE_SETTINGS
            self.belief = challenger.belief
            self._prepare_sensors()
            self.refinement.end()
            if self.gps is not None:
                self.gps.offset.forget()  # learnt at the wrong pose
            self._estimate = None

    def restart(self, time: int) -> None:
        """Forget everything, on the coarse lattice."""
        self._duel = None
        self.refinement.end()
        if self.is_fine:
            self.tables, self.settings = self._coarse, COARSE_SETTINGS
            self._prepare(uniform=False)
        super().restart(time)

    def _change(self, tables: PoseTables, settings: FilterSettings) -> None:
        """Go on with other tables; the belief goes over to the squares that its states cover."""
        belief = self.belief
        self.tables, self.settings = tables, settings
        self._prepare(uniform=False)
        transfer(belief, self.belief)


def transfer(source: PoseBelief, target: PoseBelief) -> None:
    """Spread a list of states over the squares of another lattice that they cover.

    Parameters
    ----------
    source, target : PoseBelief
        With equal bins; the source is a list. The target forgets what it held.
    """
    lattice = target.lattice
    bins, squares, weights = source.listed()
    x, y = source.places(bins, squares)
    parts = 3 if source.lattice.resolution > lattice.resolution else 1
    shifts = (np.arange(parts) - (parts - 1) / 2.0) / parts * source.lattice.resolution
    all_x = (x[:, np.newaxis, np.newaxis] + shifts).repeat(parts, axis=1)
    all_y = (y[:, np.newaxis, np.newaxis] + shifts[:, np.newaxis]).repeat(parts, axis=2)
    column = np.round((all_x - lattice.origin[0]) / lattice.resolution).astype(np.int64)
    row = np.round((all_y - lattice.origin[1]) / lattice.resolution).astype(np.int64)
    column, row = np.clip(column, 0, lattice.nx - 1), np.clip(row, 0, lattice.ny - 1)
    chosen = lattice.index[row * lattice.nx + column].reshape(len(bins), -1)
    share = np.repeat(weights[:, np.newaxis] / parts**2, parts**2, axis=1)
    target.set_weighted(
        np.repeat(bins, parts**2), chosen.ravel(), share.ravel(), heading_offset=source.heading_offset
    )
