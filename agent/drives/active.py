"""``active``: drives to where the remaining poses can be distinguished soonest; stops when the pose is known.

While nearly everything is possible, any open path is informative, and the next leg is that of `explore`.
As soon as a handful of hypotheses carries the belief, the path that distinguishes them best for its time is
planned over relative poses (`agent.drives.disambiguation`), and again whenever the belief has changed much.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from agent.drives.base import Decision, DriveSetup
from agent.drives.clearance import PoseSample
from agent.drives.disambiguation import FIRST_TURNS, plan
from agent.drives.explore import ExploreDrive
from agent.drives.roam import Closed, LegPhase, Roamer
from ciberrato.localization.belief.estimate import PoseEstimate, spread
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.physics.kinematics import STANDSTILL
from ciberrato.protocol.messages import Measures

_MOST_STATES = 8000
"""States of the belief up to which it is worth while to look for hypotheses."""
_HYPOTHESES = 8
_COVERED = 0.6
"""Probability that the hypotheses must have in all."""
_LEAST_GAIN = 0.02  # nats
_RECONSIDER_AFTER = 4  # cycles
_RECONSIDER_DROP = 0.5  # bits


class _Mode(StrEnum):
    LOCALIZING = "localizing"
    LOCALIZED = "localized"


def make(setup: DriveSetup) -> ActiveDrive:
    """Create the drive."""
    return ActiveDrive(
        setup.angles, setup.parameters.obstacle_noise, cruise=setup.cruise, stop=setup.stop_when_localized
    )


class ActiveDrive:
    """Drives to where the pose shows, and stands still once it is known.

    Parameters
    ----------
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    obstacle_noise : float
    cruise : float
    hold : int
        Cycles for which the pose must stay known before the robot stops.
    stop : bool
        Whether to stand still then; otherwise it goes on exploring.
    """

    def __init__(
        self,
        angles: tuple[float, ...],
        obstacle_noise: float,
        *,
        cruise: float = 0.1,
        hold: int = 5,
        stop: bool = True,
    ) -> None:
        self._roamer = Roamer(angles, obstacle_noise, self._choose, cruise=cruise)
        self._explorer = ExploreDrive(angles, obstacle_noise, cruise=cruise)
        self._noise = max(obstacle_noise, 0.1)
        self._hold = hold
        self._stop = stop
        self._known = 0
        self._mode = _Mode.LOCALIZING
        self._since_choice = 0
        self._doubt = math.inf
        """Entropy over the hypotheses at the last choice, in bits; infinite if there were none."""

    @property
    def localized(self) -> bool:
        """Return whether the pose is known and has been for a while."""
        return self._mode is _Mode.LOCALIZED

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        """Decide on a command, see `agent.drives.base.Drive`."""
        pose = pose_filter.estimate()
        known = pose.certain or (pose.likely and self._mode is _Mode.LOCALIZED)
        self._known = self._known + 1 if known else 0
        if self._known >= self._hold:
            self._mode = _Mode.LOCALIZED
        elif self._known == 0:
            self._mode = _Mode.LOCALIZING
        if self._mode is _Mode.LOCALIZED:
            if self._stop:
                self._roamer.stand()
                return Decision(command=STANDSTILL, finished="localized")
            return self._explorer.decide(measures, pose_filter)
        self._explorer.note_visit(pose_filter)
        self._since_choice += 1
        if self._since_choice >= _RECONSIDER_AFTER and self._roamer.phase is LegPhase.DRIVING:
            found = _hypotheses(pose_filter)
            if found and _entropy(found) < self._doubt - _RECONSIDER_DROP:
                self._roamer.reconsider()
        return self._roamer.decide(measures, pose_filter)

    def _choose(self, pose_filter: GridFilter, sample: PoseSample, closed: Closed) -> tuple[float, float]:
        """Choose the first leg of the most informative path; see `agent.drives.roam.ChooseLeg`."""
        self._since_choice, self._doubt = 0, math.inf
        found = _hypotheses(pose_filter)
        if len(found) > 1:
            self._doubt = _entropy(found)
            targets = pose_filter.lab.targets
            tables = pose_filter.tables.everywhere
            wide = spread(pose_filter.belief, found[0])
            chosen = plan(tables, found, self._noise, closed(FIRST_TURNS), targets, wide)
            if chosen is not None and chosen.gain > _LEAST_GAIN:
                return chosen.turn, chosen.length
        return self._explorer.choose(pose_filter, sample, closed)


def _hypotheses(pose_filter: GridFilter) -> list[PoseEstimate]:
    """List the poses that the belief is gathered around; none if they are too many."""
    belief = pose_filter.belief
    if belief.dense is not None or belief.states > _MOST_STATES:
        return []
    found = pose_filter.separable(_HYPOTHESES)
    return found if sum(mode.probability for mode in found) >= _COVERED else []


def _entropy(found: list[PoseEstimate]) -> float:
    """Compute the entropy over hypotheses in bits; the rest of the belief counts as many more."""
    known = np.array([mode.probability for mode in found if mode.probability > 0.0])
    rest = max(1.0 - float(known.sum()), 0.0)
    return float(-(known * np.log2(known)).sum()) + rest * math.log2(4.0 * _HYPOTHESES)
