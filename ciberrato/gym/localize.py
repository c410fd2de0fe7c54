"""The task of localization: drive so that the pose filter gets to know where the robot is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.geometry.angles import short_turn
from ciberrato.gym.scenario import Episode, Scenario
from ciberrato.gym.signals import Signals
from ciberrato.gym.tasks import Column, Outcome, Task
from ciberrato.localization.belief.estimate import CLAIM_RADIUS, CLAIM_TURN, PoseEstimate
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.tables.cache import cached_tables
from ciberrato.localization.tables.pose_tables import COARSE, PoseTables
from ciberrato.protocol import DEFAULT_SENSOR_ANGLES, Measures
from ciberrato.world.lab import Lab

NOWHERE_YET = PoseEstimate(x=0.0, y=0.0, heading=0.0, probability=0.0, cell=(0, 0))


class Localize(Task):
    """Get to know the pose, from anywhere, in a lab that is known.

    A pose filter (grid localization on the coarse lattice, with the episode's lab) gets every message and
    command. The reward is the information gained: the decrease of the belief's entropy in a cycle, as a share
    of the entropy of the uniform belief; and, when the filter claims to know the pose, +1 if it is right
    (within 0.5 units and 10 degrees), -1 if not. A claim ends the episode; a right one is a success.
    """

    mode = 0
    starts = "free"

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        self._size = (
            max(lab.width for lab in scenario.labs),
            max(lab.height for lab in scenario.labs),
        )
        super().__init__(scenario, worlds)
        self._filters: list[GridFilter | None] = [None] * worlds
        self._estimates: list[PoseEstimate] = [NOWHERE_YET] * worlds
        self._entropy = np.zeros(worlds)
        self._most = np.ones(worlds)

    def columns(self) -> list[Column]:
        """Return the names of an observation's numbers."""
        return [
            *super().columns(),
            Column("x of the most probable pose", "units", -1.0, self._size[0] + 1.0),
            Column("y of the most probable pose", "units", -1.0, self._size[1] + 1.0),
            Column("cosine of its heading", "", -1.0, 1.0),
            Column("sine of its heading", "", -1.0, 1.0),
            Column("its probability", "", 0.0, 1.0),
            Column("entropy of the belief", "share of the most possible", 0.0, 1.0),
        ]

    def begin(self, which: Integers, signals: Signals, episodes: Sequence[Episode]) -> None:
        """Begin episodes in some worlds: new filters receive the first message."""
        super().begin(which, signals, episodes)
        for world, episode in zip(which.tolist(), episodes, strict=True):
            pose_filter = GridFilter(episode.lab, _tables(episode.lab), episode.parameters)
            belief = pose_filter.belief
            self._most[world] = math.log2(belief.bins * belief.lattice.size)
            self._filters[world] = pose_filter
            self._listen(world, signals, None)

    def advance(self, signals: Signals, commands: Floats, active: Booleans) -> Outcome:
        """Compute rewards and ends after a cycle."""
        reward = np.zeros(self.worlds)
        claims, right = np.zeros(self.worlds, np.bool_), np.zeros(self.worlds, np.bool_)
        for world in np.flatnonzero(active).tolist():
            before = self._entropy[world]
            left, right_motor = commands[world].tolist()
            self._listen(world, signals, (left, right_motor))
            reward[world] = before - self._entropy[world]
            estimate = self._estimates[world]
            if estimate.certain:
                claims[world] = True
                right[world] = _is_right(estimate, signals.poses[world])
                reward[world] += 1.0 if right[world] else -1.0
        return Outcome(reward, claims, right)

    def _listen(self, world: int, signals: Signals, command: tuple[float, float] | None) -> None:
        pose_filter = self._filters[world]
        assert pose_filter is not None
        ir = signals.infrared[world].tolist()
        measures = Measures(
            time=int(signals.time[world]),
            infrared=(ir[0], ir[1], ir[2], ir[3]),
            compass=float(signals.compass[world]),
            ground=int(signals.ground[world]),
            collision=bool(signals.collision[world]),
        )
        pose_filter.observe(measures, command)
        self._estimates[world] = pose_filter.estimate()
        self._entropy[world] = pose_filter.belief.entropy_bits() / self._most[world]

    def observe(self, signals: Signals) -> NDArray[np.float32]:
        """Return the observations."""
        seen = super().observe(signals)
        summary = [
            (one.x, one.y, math.cos(one.heading), math.sin(one.heading), one.probability)
            for one in self._estimates
        ]
        bounds = np.array([column[2:] for column in self.columns()[7:12]])
        seen[:, 7:12] = np.clip(np.array(summary), bounds[:, 0], bounds[:, 1])
        seen[:, 12] = np.clip(self._entropy, 0.0, 1.0)
        return seen

    def close(self) -> None:
        """Close the filters."""
        self._filters = [None] * self.worlds


def _is_right(estimate: PoseEstimate, pose: Floats) -> bool:
    x, y, heading = pose.tolist()
    near = math.hypot(estimate.x - x, estimate.y - y) <= CLAIM_RADIUS
    return near and abs(short_turn(estimate.heading - heading)) <= CLAIM_TURN


@lru_cache(maxsize=8)
def _tables(lab: Lab) -> PoseTables:
    """Read the tables of a lab from the user's cache, or compute them, once a process."""
    return cached_tables(lab, DEFAULT_SENSOR_ANGLES, COARSE)
