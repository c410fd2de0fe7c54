"""``explore``: legs into the open until the pose is known, then from cell to cell."""

from __future__ import annotations

import math

import numpy as np

from agent.drives.base import Decision, DriveSetup
from agent.drives.cell_to_cell import CellDrive
from agent.drives.clearance import PoseSample, free_distances
from agent.drives.outlook import ERROR, expected_gain
from agent.drives.roam import SPRINT, Closed, Roamer
from ciberrato.arrays import Floats
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import Measures

LONGEST_LEG = 4.0
_FEW = 20_000
"""States of the belief up to which it is worth while to ask what a leg would tell."""
_LOOK_AHEAD = 0.5, 3.0
"""Units of a leg that are looked at: least, most."""
_TELLING = 1.0  # of the leg that tells most, in units of open way
_ONE_LEFT = 0.8
"""Probability from which on an estimate has no rival worth a detour."""
_LEAST_GAIN = 0.05  # nats that count in full
_TURNS = np.deg2rad(np.arange(-165, 181, 15))


def make(setup: DriveSetup) -> ExploreDrive:
    """Create the drive."""
    return ExploreDrive(setup.angles, setup.parameters.obstacle_noise, cruise=setup.cruise)


class ExploreDrive:
    """Drives leg by leg to where the robot has been least.

    Parameters
    ----------
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    obstacle_noise : float
    cruise : float
    """

    def __init__(self, angles: tuple[float, ...], obstacle_noise: float, *, cruise: float = 0.1) -> None:
        self._roamer = Roamer(angles, obstacle_noise, self.choose, cruise=cruise)
        self._cells = CellDrive(angles, obstacle_noise, speed=SPRINT * cruise)
        self._noise = max(obstacle_noise, 0.1)
        self._last: Command | None = None
        self._visits: Floats | None = None
        self._time: int | None = None

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        """Decide on a command, see `agent.drives.base.Drive`."""
        self.note_visit(pose_filter)
        # After messages that others answered or that never came, and late answers, the filter knows best.
        unbroken = (
            self._time is not None
            and measures.time == self._time + 1
            and pose_filter.command_before(measures.time) in (None, self._last)
        )
        self._time = measures.time
        self._cells.observe(measures, pose_filter, self._last if unbroken else None)
        self._last = self._cells.decide(measures)
        if self._last is not None:
            self._roamer.follow(measures, pose_filter, self._last)
            return Decision(command=self._last)
        decision = self._roamer.decide(measures, pose_filter)
        self._last = decision.command
        return decision

    def note_visit(self, pose_filter: GridFilter) -> None:
        """Count the cell that the robot is in, if that is known."""
        if self._visits is None:
            self._visits = np.zeros((pose_filter.lab.rows + 2, pose_filter.lab.columns + 2))
        found = pose_filter.estimate()
        if found.likely:
            row = min(max(found.cell[0], 0), pose_filter.lab.rows)
            column = min(max(found.cell[1], 0), pose_filter.lab.columns)
            self._visits *= 0.998
            self._visits[row, column] += 1.0

    def choose(self, pose_filter: GridFilter, sample: PoseSample, closed: Closed) -> tuple[float, float]:
        """Choose the leg into the open; see `agent.drives.roam.ChooseLeg`."""
        distances = free_distances(pose_filter.tables.everywhere.lattice, sample, _TURNS, LONGEST_LEG)
        mean = distances.mean(axis=1)
        reachable = np.quantile(distances, 0.1, axis=1)
        score = 0.5 * mean + np.minimum(reachable, 2.0) - 0.6 * np.abs(_TURNS)
        score -= 1.0 * (np.abs(_TURNS) > math.radians(150.0))
        # Towards what is so near ahead that it stopped the robot there is no way.
        score -= 3.0 * closed(_TURNS)
        score -= self._crowdedness(pose_filter, sample, mean)
        score += self._telling(pose_filter, sample, reachable)
        best = int(score.argmax())
        return float(_TURNS[best]), max(min(float(reachable[best]) - 0.1, LONGEST_LEG), 1.0)

    def _telling(self, pose_filter: GridFilter, sample: PoseSample, reachable: Floats) -> Floats:
        """Return what each leg would tell, up to 1; 0 while the pose is known, or very much is possible."""
        belief, found = pose_filter.belief, pose_filter.estimate()
        if found.certain or belief.dense is not None or belief.states > _FEW:
            return np.zeros(len(_TURNS))
        some = PoseSample(x=sample.x[::3], y=sample.y[::3], heading=sample.heading[::3])
        lengths = np.clip(reachable, *_LOOK_AHEAD)
        # With one hypothesis left, what is to be learnt is where around it the robot is.
        error = ERROR if found.probability < _ONE_LEFT else 0.0
        gain = expected_gain(pose_filter.tables.everywhere, some, _TURNS, lengths, self._noise, error)
        return np.asarray(_TELLING * gain / max(float(gain.max()), _LEAST_GAIN))

    def _crowdedness(self, pose_filter: GridFilter, sample: PoseSample, distances: Floats) -> Floats:
        """Return how often the robot has been where a leg would end; 0 while it is lost."""
        assert self._visits is not None
        if not pose_filter.estimate().likely:
            return np.zeros(len(_TURNS))
        reach = np.clip(distances, 0.5, 2.5)[:, np.newaxis]
        heading = sample.heading + _TURNS[:, np.newaxis]
        x = sample.x + reach * np.cos(heading)
        y = sample.y + reach * np.sin(heading)
        rows = np.clip((y / 2.0).astype(int), 0, self._visits.shape[0] - 1)
        columns = np.clip((x / 2.0).astype(int), 0, self._visits.shape[1] - 1)
        return np.asarray(0.04 * np.minimum(self._visits[rows, columns], 60.0).mean(axis=1))
