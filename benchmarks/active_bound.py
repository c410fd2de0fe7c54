"""Bound for active localization: how soon a robot that knows where it is could prove it.

``python -m benchmarks.active_bound OUTCOMES.jsonl`` takes the starts of the runs of an evaluation and drives
an oracle from each. The oracle knows the true pose, and the quickest path to every place in the lab: at full
speed, turning at the greatest rate, without inertia. Every cycle counts in full and says as much as is to be
expected of it, by the exact noise: the evidence against another pose is half the squared difference of the
expected readings over the variance. Other poses are those on a coarse lattice only, and one that would have
hit a wall is out. The time at which the first of all these paths leaves the true pose a probability of a
claim is a bound for every drive to a place: all that is left out could only make it later.

The bound is of expected evidence: a lucky reading may decide sooner.

Beside it stands the bound for any drive (`benchmarks.any_drive`), which knows which rooms are equal and
counts targets, and by which a lab allows a time or does not.
"""

from __future__ import annotations

import argparse
import heapq
import itertools
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats, Integers
from ciberrato.localization.belief.estimate import CERTAIN, CLAIM_RADIUS, CLAIM_TURN
from ciberrato.localization.tables.pose_tables import BINS, PoseTables
from ciberrato.localization.tables.reading_codes import code_distances
from ciberrato.physics.kinematics import MAX_POWER, ROBOT_RADIUS
from ciberrato.world.coordinates import Pose

_STRIDE = 2  # squares of a step
_DIRECTIONS = 8
_RATE = 2.0 * MAX_POWER  # radians per cycle; the wheels are a unit apart
_LOOK = math.pi / 8.0  # radians between two looks while turning
_REFUTED = 15.0  # nats from which on a pose is left out
_ROUNDING = 0.1


class Oracle:
    """Finds the quickest proof of a pose in a lab.

    Parameters
    ----------
    tables : PoseTables
    noise : float
        Standard deviation of a reading (ObstacleNoise).
    """

    def __init__(self, tables: PoseTables, noise: float) -> None:
        self._tables = tables
        self._deviation = math.sqrt(noise**2 + _ROUNDING**2 / 12.0)
        self._readings = 1.0 / code_distances()

    def soonest(self, start: Pose, longest: float = 300.0, *, claim: float = CERTAIN) -> float:
        """Return the cycles after which the pose can be known.

        Parameters
        ----------
        start : (float, float, float)
            True pose: units and radians.
        longest : float
            Cycles after which the search ends.
        claim : float
            Probability at which the pose counts as known.

        Returns
        -------
        float
            Infinite if no path shows the pose within `longest`.
        """
        lattice, stride = self._tables.lattice, _STRIDE * self._tables.lattice.resolution
        others = self._others(start)
        evidence = self._apart(others, start, (0.0, 0.0, 0.0))
        right = (np.hypot(others[:, 0] - start[0], others[:, 1] - start[1]) <= CLAIM_RADIUS) & (
            np.abs(_wrapped(others[:, 2] - start[2])) <= CLAIM_TURN
        )
        turns = [math.remainder(k * 2.0 * math.pi / _DIRECTIONS, 2.0 * math.pi) for k in range(_DIRECTIONS)]
        done: set[tuple[int, int, int]] = set()
        number = itertools.count()
        alive = np.flatnonzero(evidence < _REFUTED)
        queue: list[tuple[float, int, tuple[int, int, int], Integers, Floats]] = [
            (0.0, next(number), (0, 0, 0), alive, evidence[alive])
        ]
        while queue:
            time, _, place, alive, evidence = heapq.heappop(queue)
            if place in done:
                continue
            done.add(place)
            weights = np.exp(-evidence)
            if float((weights * right[alive]).sum()) >= claim * float(weights.sum()):
                return time
            ahead, left, facing = place
            here = (ahead * stride, left * stride)
            for step in (1, -1):  # to turn on
                turned = (facing + step) % _DIRECTIONS
                after = time + 2.0 * math.pi / _DIRECTIONS / _RATE
                if (ahead, left, turned) in done or after > longest:
                    continue
                gained = evidence.copy()
                for look in (0.5, 1.0):
                    angle = turns[facing] + step * look * 2.0 * math.pi / _DIRECTIONS
                    gained += _LOOK / _RATE * self._apart(others[alive], start, (*here, angle))
                kept = gained < _REFUTED
                heapq.heappush(queue, (after, next(number), (ahead, left, turned), alive[kept], gained[kept]))
            dx, dy = round(math.cos(turns[facing])), round(math.sin(turns[facing]))
            target = (ahead + dx, left + dy, facing)
            cycles = stride * math.hypot(dx, dy) / MAX_POWER
            there = _moved(np.array([start]), (target[0] * stride, target[1] * stride, turns[facing]))
            square = self._squares(there)
            if (
                target in done
                or time + cycles > longest
                or lattice.padded_clearance[square][0] < ROBOT_RADIUS - lattice.resolution / 2.0
            ):
                continue
            motion = (target[0] * stride, target[1] * stride, turns[facing])
            gained = evidence + cycles * self._apart(others[alive], start, motion)
            kept = gained < _REFUTED
            heapq.heappush(queue, (time + cycles, next(number), target, alive[kept], gained[kept]))
        return math.inf

    def _others(self, start: Pose) -> Floats:
        """List all poses on the lattice, with headings in steps from the true one, and the true pose."""
        lattice = self._tables.lattice
        roomy = np.flatnonzero(lattice.clearance >= ROBOT_RADIUS - lattice.resolution / 2.0)
        headings = start[2] + 2.0 * math.pi / BINS * np.arange(BINS)
        x, y = (np.tile(part[roomy], BINS) for part in (lattice.x, lattice.y))
        return np.concatenate([np.array([start]), np.stack([x, y, np.repeat(headings, len(roomy))], axis=1)])

    def _squares(self, poses: Floats) -> Integers:
        lattice = self._tables.lattice
        column = np.round((poses[:, 0] - lattice.origin[0]) / lattice.resolution).astype(np.int64)
        row = np.round((poses[:, 1] - lattice.origin[1]) / lattice.resolution).astype(np.int64)
        np.clip(column, 0, lattice.nx - 1, out=column)
        np.clip(row, 0, lattice.ny - 1, out=row)
        return np.asarray(lattice.index[row * lattice.nx + column])

    def _apart(self, others: Floats, start: Pose, motion: Pose) -> Floats:
        """Return the evidence of a cycle against each pose after a motion, in nats; shape (poses,)."""
        tables, size = self._tables, self._tables.lattice.size
        poses = _moved(np.concatenate([np.array([start]), others]), motion)
        squares = self._squares(poses)
        free = tables.lattice.padded_clearance[squares] >= ROBOT_RADIUS - tables.lattice.resolution
        squares = np.minimum(squares, size - 1)
        around = BINS * tables.steps
        direction = np.round(poses[:, 2] / (2.0 * math.pi) * around).astype(np.int64) % around
        total: Floats = np.zeros(len(others))
        for table, ahead in tables.sensors:
            expected = self._readings[tables.codes[table][direction + ahead, squares]]
            total += 0.5 * ((expected[1:] - expected[0]) / self._deviation) ** 2
        return np.where(free[1:], total, np.inf)


def _moved(poses: Floats, motion: Pose) -> Floats:
    """Move poses, shape (n, 3), by the same motion: units ahead and to the left, then radians."""
    ahead, left, turn = motion
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.stack(
        [
            poses[:, 0] + cosine * ahead - sine * left,
            poses[:, 1] + sine * ahead + cosine * left,
            poses[:, 2] + turn,
        ],
        axis=1,
    )


def _wrapped(angles: Floats) -> NDArray[np.float64]:
    return np.asarray(np.remainder(angles + math.pi, 2.0 * math.pi) - math.pi)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print, for each lab of a file of outcomes, the times of explore, active and the oracle."""
    from benchmarks.any_drive import AnyDrive, greatest_share, soonest_quantile
    from ciberrato.evaluation.episode import ANGLES, lab_of
    from ciberrato.evaluation.report import quantile, times_to_localize
    from ciberrato.evaluation.runner import read_evaluation
    from ciberrato.files.parameters import read_parameters
    from ciberrato.labs import find_parameters
    from ciberrato.localization.tables.cache import cached_tables
    from ciberrato.localization.tables.pose_tables import COARSE

    parser = argparse.ArgumentParser(prog="python -m benchmarks.active_bound", description=__doc__)
    parser.add_argument("outcomes", type=Path, help="file that ciberrato-evaluate has written")
    parser.add_argument("--most", type=int, default=24, help="starts a lab")
    parser.add_argument("--cycles", type=int, default=65, help="looked at, for any drive")
    parser.add_argument("--lab", nargs="+", default=[""], help="labs whose name contains one of these")
    options = parser.parse_args(arguments)
    results = read_evaluation(options.outcomes).results
    print("lab, parameters, compass: starts; cycles for half / 90 % of explore, active, oracle, any drive")
    for lab in sorted({one.task.lab for one in results if any(part in one.task.lab for part in options.lab)}):
        tables = cached_tables(lab_of(lab), ANGLES, COARSE)
        kinds = sorted({(one.task.parameters, one.task.compass) for one in results if one.task.lab == lab})
        for name, compass in kinds:
            runs = [one for one in results if one.task.lab == lab]
            runs = [one for one in runs if (one.task.parameters, one.task.compass) == (name, compass)]
            parameters = read_parameters(find_parameters(name))
            oracle = Oracle(tables, parameters.obstacle_noise)
            # After some way a GPS is as good as a compass: counted from the first cycle.
            known = compass or parameters.gps
            any_drive = AnyDrive(lab_of(lab), tables, parameters.obstacle_noise, compass=known)
            starts = [
                (x, y, math.radians(turn))
                for x, y, turn in sorted({tuple(one.outcome.start) for one in runs})[: options.most]
            ]
            # The oracle has no compass: for robots with one it bounds nothing.
            bound = np.array([math.nan if known else oracle.soonest(start) for start in starts])
            shares = np.array([greatest_share(any_drive.evidence(start, options.cycles)) for start in starts])
            shown = []
            for drive in ("explore", "active"):
                times = times_to_localize([one.outcome for one in runs if one.task.drive == drive])
                shown.append([quantile(times, share) for share in (0.5, 0.9)] if len(times) else [])
            shown.append([quantile(bound, share) for share in (0.5, 0.9)])
            shown.append([soonest_quantile(shares, share) for share in (0.5, 0.9)])
            columns = ", ".join(" / ".join(f"{value:.0f}" for value in pair) or "-" for pair in shown)
            where = "/".join(lab.split("/")[-2:])
            print(
                f"{where}, {name}, {'with' if compass else 'no'} compass: {len(starts)}; {columns}",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
