"""``active``: the next leg is the one that is expected to tell most about the pose, for the time it takes.

Every candidate leg is imagined from a sample of the likely poses. If pose i is the true one, the readings
along the leg are those expected for i, and pose j is left with a likelihood that falls with the squared
difference of its expected readings from those. The expected entropy after the leg is then a sum over
pairs of poses, and the leg with the greatest drop per cycle wins (Thrun, Burgard, Fox, *Probabilistic
Robotics*, section 17.4, with the readings' noise taken out of the expectation: the likeliest readings
stand for all).

Poses near one another count as one: what is to be found out is the place, not its decimals.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from agent.drives.base import STANDSTILL, Decision
from agent.drives.explore import ExploreDrive
from agent.drives.outlook import PoseSample, free_ways
from agent.drives.roam import Closed, Roamer
from agent.pose_filter.posefilter import PoseFilter
from agent.pose_filter.reading_codes import code_distances
from ciberrato.protocol.messages import Measures

Floats = NDArray[np.float64]

LONGEST_LEG = 4.0
_FIRST_TURNS = np.deg2rad(np.arange(-150, 181, 30))
_SECOND_TURNS = np.deg2rad(np.array([-90.0, 0.0, 90.0]))
_LOOKS = 5
"""At how many places of a leg readings are imagined."""
_NEAR = 0.7
_ALIKE = math.radians(20.0)
_POSES = 72


class _Mode(StrEnum):
    LOCALIZING = "localizing"
    LOCALIZED = "localized"


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
        self._cruise = cruise
        self._hold = hold
        self._stop = stop
        self._known = 0
        self._mode = _Mode.LOCALIZING

    @property
    def localized(self) -> bool:
        """Whether the pose is known and has been for a while."""
        return self._mode is _Mode.LOCALIZED

    def decide(self, measures: Measures, pose_filter: PoseFilter) -> Decision:
        """See `agent.drives.base.Drive`."""
        self._known = self._known + 1 if pose_filter.estimate().certain else 0
        if self._known >= self._hold:
            self._mode = _Mode.LOCALIZED
        elif self._known == 0:
            self._mode = _Mode.LOCALIZING
        if self._mode is _Mode.LOCALIZED:
            if self._stop:
                self._roamer.stand()
                return Decision(command=STANDSTILL, finished="localized")
            return self._explorer.decide(measures, pose_filter)
        return self._roamer.decide(measures, pose_filter)

    def _choose(self, pose_filter: PoseFilter, sample: PoseSample, closed: Closed) -> tuple[float, float]:
        """Choose the leg with the greatest expected drop of entropy per cycle."""
        step = max(len(sample.x) // _POSES, 1)
        poses = PoseSample(sample.x[::step], sample.y[::step], sample.heading[::step])
        lattice = pose_filter.tables.lattice
        ways = free_ways(lattice, poses, _FIRST_TURNS, LONGEST_LEG)
        alike = _alike(poses)
        shut = closed(_FIRST_TURNS)
        best, best_score = (float(math.pi), 1.0), -math.inf
        for number, turn in enumerate(_FIRST_TURNS):
            length = float(np.quantile(ways[number], 0.1)) - 0.1
            if length < 0.3 or shut[number]:
                continue
            features = self._imagine(pose_filter, poses, float(turn), length)
            cycles = abs(turn) / 0.18 + 3.0 + length / self._cruise
            gain = self._expected_drop(features, alike)
            score = gain / (cycles + 5.0)
            end = PoseSample(
                poses.x + length * np.cos(poses.heading + turn),
                poses.y + length * np.sin(poses.heading + turn),
                poses.heading + turn,
            )
            onward = free_ways(lattice, end, _SECOND_TURNS, LONGEST_LEG)
            for other, second in enumerate(_SECOND_TURNS):
                further = float(np.quantile(onward[other], 0.1)) - 0.1
                if further < 0.5:
                    continue
                both = np.concatenate(
                    [features, self._imagine(pose_filter, end, float(second), further)], axis=1
                )
                more = abs(second) / 0.18 + 3.0 + further / self._cruise
                score = max(score, self._expected_drop(both, alike) / (cycles + more + 5.0))
            score += 1e-4 * length / (1.0 + abs(turn))
            if score > best_score:
                best, best_score = (float(turn), length), score
        return best

    def _imagine(self, pose_filter: PoseFilter, poses: PoseSample, turn: float, length: float) -> Floats:
        """Give the readings expected along a leg, by their spread; shape (poses, looks * sensors)."""
        tables = pose_filter.tables
        lattice = tables.lattice
        heading = poses.heading + turn
        looks = np.linspace(min(0.4, length), length, _LOOKS)
        x = poses.x[:, np.newaxis] + looks * np.cos(heading)[:, np.newaxis]
        y = poses.y[:, np.newaxis] + looks * np.sin(heading)[:, np.newaxis]
        column = np.clip(np.round((x - lattice.origin[0]) / lattice.resolution), 0, lattice.nx - 1)
        row = np.clip(np.round((y - lattice.origin[1]) / lattice.resolution), 0, lattice.ny - 1)
        square = lattice.index[(row * lattice.nx + column).astype(np.int64)]
        inside = square < lattice.size
        square = np.minimum(square, lattice.size - 1)
        around = tables.codes[0].shape[0] // 2
        direction = np.round(heading / (2.0 * math.pi) * around).astype(np.int64) % around
        readings = 1.0 / code_distances()
        parts = []
        for table, ahead in tables.sensors:
            codes = tables.codes[table][(direction + ahead)[:, np.newaxis], square]
            parts.append(np.where(inside, self._scale(readings[codes]), 0.0))
        return np.concatenate(parts, axis=1)

    def _scale(self, reading: Floats) -> Floats:
        """Transform readings so that equal differences tell equally much."""
        spread = 0.06
        return np.asarray(
            np.arcsinh(reading * math.sqrt(spread / self._noise)) / math.sqrt(spread * self._noise)
        )

    def _expected_drop(self, features: Floats, alike: Floats) -> float:
        """Give the expected drop of the entropy over places, in nats, by such readings."""
        squares = (features**2).sum(axis=1)
        apart = squares[:, np.newaxis] + squares - 2.0 * features @ features.T
        likelihood = np.exp(-0.125 * np.minimum(np.maximum(apart, 0.0), 400.0))
        # Probability left to places like the true one, given the readings expected there.
        right = (likelihood * alike).sum(axis=1) / likelihood.sum(axis=1)
        before = alike.mean(axis=1)
        return float(np.log(right / before).mean())


def _alike(poses: PoseSample) -> Floats:
    """1 for pairs of poses that count as one, else 0; shape (poses, poses)."""
    near = (poses.x[:, np.newaxis] - poses.x) ** 2 + (poses.y[:, np.newaxis] - poses.y) ** 2 < _NEAR**2
    turn = np.abs((poses.heading[:, np.newaxis] - poses.heading + math.pi) % (2.0 * math.pi) - math.pi)
    return np.asarray(near & (turn < _ALIKE), np.float64)
