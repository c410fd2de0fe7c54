"""Records of a run: the filter against the true pose, cycle by cycle."""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ciberrato.evaluation.judged import Judged
from ciberrato.evaluation.task import LEAST_MS, MS_RATIO, MS_STEPS, SAID, TRUTH_PERIOD, Outcome, Task
from ciberrato.geometry.angles import short_turn
from ciberrato.localization.belief.estimate import CERTAIN, CLAIM_RADIUS, CLAIM_TURN
from ciberrato.world.coordinates import Pose


class Record:
    """Gathers what an `Outcome` says.

    Parameters
    ----------
    task : Task
    start : (float, float, float)
        True pose: units and radians.
    room : float
        Units squared that can be reached from it.
    equal : callable or None
        Lists the poses that are equal to one for the robot; None where the lab was not looked at.
    """

    def __init__(
        self, task: Task, start: Pose, room: float, equal: Callable[[Pose], list[Pose]] | None = None
    ) -> None:
        self.task = task
        self._equal = equal
        self._equals: int | None = None
        self._alike: int | None = None
        self._said: list[list[float] | None] = [None] * len(SAID)
        self.start = [start[0], start[1], math.degrees(start[2])]
        self.room = room
        self.times: list[tuple[float, float]] = []
        """Seconds of processor time that the filter and the drive took, by cycle."""
        self.cycles = 0
        self.first_right: int | None = None
        self.kidnapped: int | None = None
        self.found: int | None = None
        self.arrived: int | None = None
        self._rested: int | None = None
        self._first_claim: int | None = None
        self._first_claim_wrong = False
        self._claimed = self._wrongly = self._colliding = 0
        self._noticed: int | None = None
        self._truth: list[float] = []
        self._calibration = [[0, 0] for _ in range(10)]
        self._place_error = self._turn_error = math.nan
        self._probability = 0.0
        self._claim = self._right = False

    @property
    def last_cycle(self) -> int:
        """Last cycle of the run, as far as it is known now."""
        if self.task.settle and self.first_right is not None:
            return min(self.first_right + self.task.settle, self.task.cycles)
        return self.task.cycles

    def take(self, cycle: int, pose: NDArray[np.float64], pose_filter: Judged, *, collision: bool) -> None:
        """Compare the filter with the true pose after a cycle.

        Parameters
        ----------
        cycle : int
        pose : array, shape (3,)
            The true one: units and radians.
        pose_filter : Judged
        collision : bool
        """
        found = pose_filter.estimate()
        self._place_error = math.hypot(found.x - pose[0], found.y - pose[1])
        turn = short_turn(found.heading - pose[2])
        self._turn_error = abs(math.degrees(turn))
        self._right = self._place_error <= CLAIM_RADIUS and abs(turn) <= CLAIM_TURN
        self._claim, self._probability = found.certain, found.probability
        self._colliding += collision
        self._count(cycle)
        self._compare_equal(cycle, pose, pose_filter)
        if self.kidnapped is not None and cycle >= self.kidnapped:
            since = cycle - self.kidnapped
            restarted = any(at >= self.kidnapped for at in pose_filter.restarts)
            if self._noticed is None and (restarted or not self._claim):
                self._noticed = since
            if self.found is None and self._claim and self._right:
                self.found = since
        if cycle % TRUTH_PERIOD == 0:
            held = pose_filter.probability_near(*(float(value) for value in pose))
            if held is not None:
                self._truth.append(round(held, 4))

    def _compare_equal(self, cycle: int, pose: NDArray[np.float64], pose_filter: Judged) -> None:
        """Update how soon the true pose and those equal to it are known to be the only ones left."""
        since = 0 if self.kidnapped is None else self.kidnapped
        if self._equal is None or self._alike is not None or (self.task.kidnap and self.kidnapped is None):
            return
        x, y, heading = (float(value) for value in pose)
        poses = [(x, y, heading), *self._equal((x, y, heading))]
        if self._equals is None:
            self._equals = len(poses) - 1
        if len(poses) > 1:
            held = [pose_filter.probability_near(*each) or 0.0 for each in poses]
            if sum(held) > CERTAIN:
                self._alike = cycle - since

    def rest(self) -> None:
        """Fill the rest of the run: the robot stands for good, and all remaining cycles are alike."""
        self._rested = self.cycles
        for cycle in range(self.cycles + 1, self.last_cycle + 1):
            self._count(cycle)
            if cycle % TRUTH_PERIOD == 0 and self._truth:
                self._truth.append(self._truth[-1])

    def _count(self, cycle: int) -> None:
        self.cycles = cycle
        entry = self._calibration[min(int(self._probability * 10.0), 9)]
        entry[0] += 1
        entry[1] += self._right
        kind = bisect.bisect_right(SAID, self._probability) - 1
        if kind >= 0 and self._said[kind] is None:
            self._said[kind] = [round(self._probability, 4), self._right]
        if not self._claim:
            return
        self._claimed += 1
        self._wrongly += not self._right
        if self._first_claim is None:
            self._first_claim, self._first_claim_wrong = cycle, not self._right
        if self._right and self.first_right is None:
            self.first_right = cycle

    def outcome(self, collisions: int, pose_filter: Judged) -> Outcome:
        """Sum up.

        Parameters
        ----------
        collisions : int
            Beginnings of collisions.
        pose_filter : Judged

        Returns
        -------
        Outcome
        """
        times = 1000.0 * np.array(self.times)
        quantiles = np.round(np.quantile(times, [0.5, 0.99, 1.0], axis=0), 3)
        steps = np.log(np.maximum(times.sum(axis=1), 1e-9) / LEAST_MS) / math.log(MS_RATIO)
        counts = np.bincount(np.clip(steps, 0, MS_STEPS - 1).astype(np.int64), minlength=MS_STEPS)
        return Outcome(
            cycles=self.cycles,
            start=[round(value, 4) for value in self.start],
            room=round(self.room, 1),
            first_right=self.first_right,
            first_claim=self._first_claim,
            first_claim_wrong=self._first_claim_wrong,
            claimed=self._claimed,
            wrongly=self._wrongly,
            final_claim=self._claim,
            final_place_error=round(self._place_error, 4),
            final_turn_error_deg=round(self._turn_error, 3),
            collisions=collisions,
            colliding=self._colliding,
            restarts=list(pose_filter.restarts),
            kidnapped=self.kidnapped,
            noticed=self._noticed,
            found=self.found,
            arrived=self.arrived,
            rested=self._rested,
            truth=self._truth,
            calibration=self._calibration,
            said=self._said,
            equals=self._equals,
            alike=self._alike,
            filter_ms=quantiles[:, 0].tolist(),
            drive_ms=quantiles[:, 1].tolist(),
            ms_counts=counts.tolist(),
            given_up=round(pose_filter.given_up, 6),
        )
