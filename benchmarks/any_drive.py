"""Bound for localization by any drive: what the best possible readings could tell, however it is driven.

Take a true pose and a rival, a pose elsewhere in the lab. Whatever the drive, however it is chosen from what
was read, the expected evidence of t cycles between the two is at most the sum, over the cycles, of the
greatest evidence that a reading has anywhere the robot can be by then: at full speed, without inertia or
motor noise. The evidence of a reading is the Kullback-Leibler divergence of two normal distributions, half
the squared difference of the expected readings over the variance; rounding only takes away from it. A rival
that would be in a wall where the true pose is free, or on a target where the true pose is not, is refuted at
once.

A filter that claims the true pose with probability b within t cycles, and is right in a share c of its
claims, claims it with at most b (1 - c) / c where the rival is true: so calibrated claims need

    kl(b | b (1 - c) / c) <= evidence(t),

kl being the divergence of two coins (Kaufmann, Cappe, Garivier, J. Mach. Learn. Res. 17, 2016, lemma 1). For
m rivals together the evidence is that against their mixture, at most -log(mean(exp(-evidence of each))), and
what is allowed is divided by m. The mean over starts of the greatest b bounds the share of runs that can have
claimed their pose by cycle t, and so the quantiles of the time.

Computed on the places of the coarse lattice and 24 directions, with exact rays; how far the robot gets is
rounded up accordingly. Few rivals are looked at: more could only make the bound later.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats, Integers
from ciberrato.checks.equal_places import equal_poses, equal_rooms
from ciberrato.checks.free_space import free_space
from ciberrato.geometry.tiles import wall_distances
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, sensor_distances
from ciberrato.localization.belief.estimate import CERTAIN, CLAIM_RADIUS, CLAIM_TURN
from ciberrato.localization.tables.pose_tables import BINS, PoseTables
from ciberrato.localization.tables.reading_codes import code_distances
from ciberrato.physics.kinematics import MAX_POWER, ROBOT_RADIUS
from ciberrato.world.coordinates import Pose
from ciberrato.world.lab import Lab

DIRECTIONS = 24
_DETOUR = 1.0 / math.cos(math.pi / 8.0)  # of paths along eight directions, at most
_NEAR = 1.5  # units around the start in which rivals are looked for
_RIVALS = 6
_SURE = 1e3  # nats of what refutes at once
_FIRST_RIVALS = 16
_STRONG = 5000  # poses that the first reading leaves
_CLIP = 4.0  # nats of a reading, while rivals are looked for
_TIGHT = 0.02  # units


class AnyDrive:
    """Bounds how soon the pose of a robot can be known.

    Parameters
    ----------
    lab : Lab
    tables : PoseTables
        On the coarse lattice; rivals are looked for on it, and then moved to where they are least refuted.
    noise : float
        Standard deviation of a reading (ObstacleNoise).
    compass : bool
        Whether the heading is known: then only rivals with the same one are.
    """

    def __init__(self, lab: Lab, tables: PoseTables, noise: float, *, compass: bool = False) -> None:
        self._walls = WallMap.from_lab(lab)
        self._size = (lab.width, lab.height)
        self._tables = tables
        self._noise = max(noise, 1e-3)
        self._targets = lab.targets
        # Rooms that are equal for IR; whether a target distinguishes them is a matter of the drive.
        blind = dataclasses.replace(lab, targets=())
        self._space = free_space(blind)
        self._rooms = [] if self._space is None else equal_rooms(blind, self._space, noise)
        self._compass = compass
        step = 2.0 * math.pi / DIRECTIONS
        self._turns = step * np.arange(DIRECTIONS)
        self._ahead = [round(angle / step) for angle in tables.angles]

    def evidence(self, start: Pose, cycles: int, rivals: Floats | None = None) -> Floats:
        """Compute the most that any drive can be expected to tell between a pose and its rivals.

        Parameters
        ----------
        start : (float, float, float)
            True pose: units and radians.
        cycles : int
        rivals : array, shape (rivals, 3), optional
            Default: those that are found to be the hardest to refute.

        Returns
        -------
        array, shape (rivals, cycles + 1)
            Nats after so many cycles.
        """
        places, ways = self._reachable(start, MAX_POWER * cycles)
        equal = np.empty((0, 3))
        if rivals is None:
            equal = self.equal(start)
            found = [pose for pose in self.rivals(start) if all(_apart(pose, known) for known in equal)]
            rivals = np.vstack([equal, np.array(found).reshape(-1, 3)])
        rates = self._rates(start, rivals, places, len(equal))
        # A robot that has turned by an angle has lost the time of half as many units.
        turned = np.minimum(self._turns, 2.0 * math.pi - self._turns)
        spare = self._spare
        way = np.maximum(ways - spare, 0.0)[:, np.newaxis]
        way = way + 0.5 * np.maximum(turned - math.pi / DIRECTIONS, 0.0)
        time = np.ceil(way / MAX_POWER - 1e-9).astype(np.int64)
        most = np.zeros((len(rivals), cycles + 1))
        inside = time <= cycles
        for number, rate in enumerate(rates):
            np.maximum.at(most[number], time[inside], rate[inside])
        total: Floats = np.cumsum(np.maximum.accumulate(most, axis=1), axis=1)
        return total

    @property
    def _spare(self) -> float:
        """Units that a place may be from the nearest one that is looked at."""
        return self._tables.lattice.resolution * math.sqrt(0.5)

    def equal(self, start: Pose) -> Floats:
        """Return the poses whose IR readings are equal wherever the robot drives; shape (poses, 3)."""
        if self._space is None:
            return np.empty((0, 3))
        found = equal_poses(self._space, self._rooms, start, compass=self._compass)
        return np.array(found).reshape(-1, 3)

    def rivals(self, start: Pose) -> Floats:
        """Find the poses that are the hardest to tell from one; shape (at most 12, 3)."""
        lattice = self._tables.lattice
        others = self._others(start)
        first = self._roughly(start, others, (0.0, 0.0, 0.0))
        others = others[np.argsort(first, kind="stable")[:_STRONG]]
        places, _ = self._reachable(start, _NEAR)
        refuted = np.zeros(len(others))
        chosen = places[np.linspace(0, len(places) - 1, min(len(places), 12)).astype(np.int64)]
        for (ahead, left), turn in itertools.product(chosen.tolist(), self._turns[::3].tolist()):
            refuted += np.minimum(self._roughly(start, others, (ahead, left, turn)), _CLIP)
        found: list[Floats] = []
        for index in np.argsort(refuted, kind="stable"):
            other = others[index]
            if all(_apart(other, known) for known in found):
                found.append(other)
            if len(found) == _FIRST_RIVALS:
                break
        if not found:
            return np.empty((0, 3))
        poses = np.array(found)
        shift, turn = lattice.resolution / 2.0, math.pi / BINS
        for scale in (1.0, 0.5, 0.25, 0.12):
            moves = (
                np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3))) * (shift, shift, turn) * scale
            )
            if self._compass:
                moves = moves[moves[:, 2] == 0.0]
            tried = (poses[:, np.newaxis] + moves).reshape(-1, 3)
            tried[~(self._apart_from(tried, start))] = np.nan
            misfit = np.minimum(self._rates(start, tried, chosen), _CLIP).sum(axis=(1, 2))
            best = np.nan_to_num(misfit, nan=np.inf).reshape(len(poses), -1)
            poses = tried.reshape(len(poses), -1, 3)[np.arange(len(poses)), best.argmin(axis=1)]
        found = []
        for pose in poses[np.argsort(best.min(axis=1), kind="stable")]:
            if not np.isnan(pose).any() and all(_apart(pose, known) for known in found):
                found.append(pose)
        return np.array(found[:_RIVALS]).reshape(-1, 3)

    def _others(self, start: Pose) -> Floats:
        lattice = self._tables.lattice
        roomy = np.flatnonzero(lattice.clearance >= ROBOT_RADIUS - lattice.resolution / 2.0)
        turns = np.zeros(1) if self._compass else 2.0 * math.pi / BINS * np.arange(BINS)
        x, y = (np.tile(part[roomy], len(turns)) for part in (lattice.x, lattice.y))
        others = np.stack([x, y, start[2] + np.repeat(turns, len(roomy))], axis=1)
        return others[self._apart_from(others, start)]

    def _apart_from(self, poses: Floats, start: Pose) -> NDArray[np.bool_]:
        """Return which poses are no right answer where the true one is."""
        far = np.hypot(poses[:, 0] - start[0], poses[:, 1] - start[1]) > 2.0 * CLAIM_RADIUS
        turned = np.abs(np.remainder(poses[:, 2] - start[2] + math.pi, 2.0 * math.pi) - math.pi)
        return np.asarray(far | (turned > 2.0 * CLAIM_TURN))

    def _roughly(self, start: Pose, others: Floats, motion: Pose) -> Floats:
        """Return the evidence of a reading after a motion against each pose, by the tables."""
        tables, lattice = self._tables, self._tables.lattice
        poses = moved(np.vstack([np.array([start]), others]), np.array([motion[:2]]), motion[2])[:, 0]
        column = np.clip(np.round((poses[:, 0] - lattice.origin[0]) / lattice.resolution), 0, lattice.nx - 1)
        row = np.clip(np.round((poses[:, 1] - lattice.origin[1]) / lattice.resolution), 0, lattice.ny - 1)
        squares: Integers = lattice.index[(row * lattice.nx + column).astype(np.int64)]
        free = squares < lattice.size
        around = BINS * tables.steps
        direction = np.round(poses[:, 2] / (2.0 * math.pi) * around).astype(np.int64) % around
        total: Floats = np.zeros(len(others))
        readings = np.minimum(1.0 / code_distances(), 4.0)
        # A square's distances differ by more than the noise; what differs by that much is no evidence yet.
        for table, ahead in tables.sensors:
            expected = readings[tables.codes[table][direction + ahead, np.minimum(squares, lattice.size - 1)]]
            width = self._noise + 0.5 * lattice.resolution * np.maximum(expected[1:], expected[0]) ** 2
            total += 0.5 * ((expected[1:] - expected[0]) / width) ** 2
        return np.where(free[1:], total, _CLIP)

    def _reachable(self, start: Pose, longest: float) -> tuple[Floats, Floats]:
        """List the places within some units' drive, relative to the start, and how far each is at least."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        lattice = self._tables.lattice
        free = lattice.padded_clearance >= ROBOT_RADIUS - lattice.resolution / 2.0
        free[lattice.size] = False
        ends, lengths = [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            beside = lattice.neighbours(dx, dy)[: lattice.size]
            joined = np.flatnonzero(free[: lattice.size] & free[beside])
            ends.append(np.stack([joined, beside[joined]]))
            lengths.append(np.full(len(joined), math.hypot(dx, dy) * lattice.resolution))
        one, other = np.concatenate(ends, axis=1).astype(np.int32)
        graph = coo_array((np.concatenate(lengths), (one, other)), shape=(lattice.size, lattice.size)).tocsr()
        away = np.hypot(lattice.x - start[0], lattice.y - start[1])
        first = int(np.where(free[: lattice.size], away, np.inf).argmin())
        ways = dijkstra(graph, directed=False, indices=first, limit=(longest + 1.0) * _DETOUR) / _DETOUR
        ways = np.maximum(ways - away[first], 0.0)
        kept = np.flatnonzero(ways <= longest)
        east, north = lattice.x[kept] - start[0], lattice.y[kept] - start[1]
        cosine, sine = math.cos(start[2]), math.sin(start[2])
        relative = np.stack([cosine * east + sine * north, cosine * north - sine * east], axis=1)
        # The start itself, exactly, is the first.
        return np.vstack([[[0.0, 0.0]], relative]), np.append(0.0, ways[kept])

    def _rates(self, start: Pose, rivals: Floats, places: Floats, equal: int = 0) -> Floats:
        """Return the evidence of a reading against rivals; shape (rivals, places, directions).

        The first `equal` of them differ by targets only.
        """
        truth, at_truth, room = self._readings(np.array([start]), places)
        rival, at_rival, rival_room = self._readings(rivals, places)
        total = np.zeros((len(rivals), len(places), DIRECTIONS))
        for ahead in self._ahead:
            total += 0.5 * np.roll((rival - truth) / self._noise, -ahead, axis=2) ** 2
        hit = ~rival_room | ((at_rival < ROBOT_RADIUS) & (at_rival < at_truth - _TIGHT))
        total[np.broadcast_to((hit & room)[..., np.newaxis], total.shape)] = _SURE
        total[:equal] = 0.0
        at = moved(np.vstack([np.array([start]), rivals]), places, 0.0)
        for target in self._targets:
            beyond = np.hypot(at[..., 0] - target.x, at[..., 1] - target.y) - (target.radius - ROBOT_RADIUS)
            # Somewhere near the place one may be inside, and the other outside.
            inside, outside = beyond <= self._spare, beyond >= -self._spare
            differ = (inside[:1] & outside[1:] | inside[1:] & outside[:1]) & (
                np.abs(beyond[1:] - beyond[:1]) > _TIGHT
            )
            total[differ] = _SURE
        return total

    def _readings(self, poses: Floats, places: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Return readings (poses, places, directions), and distances to walls and what is free."""
        at = moved(poses, places, 0.0)
        flat = at.reshape(-1, 3)
        x, y = flat[:, 0], flat[:, 1]
        inside = (x > 0.0) & (y > 0.0) & (x < self._size[0]) & (y < self._size[1])
        inside &= ~self._walls.point_in_polygons(np.where(inside, x, -9.0), np.where(inside, y, -9.0))
        distance = np.where(inside, wall_distances(self._walls, np.nan_to_num(flat[:, :2])), 0.0)
        seen = np.zeros((len(flat), DIRECTIONS))
        some = np.flatnonzero(inside)
        with np.errstate(invalid="ignore", divide="ignore"):
            seen[some] = ideal_reading(
                sensor_distances(self._walls, x[some, None], y[some, None], flat[some, 2:] + self._turns)
            )
        shape = at.shape[:2]
        seen = np.nan_to_num(seen, nan=0.0, posinf=100.0).reshape(*shape, DIRECTIONS)
        return seen, distance.reshape(shape), inside.reshape(shape)


def moved(poses: Floats, places: Floats, turn: float) -> Floats:
    """Return where relative places are, turned by an angle, as seen from poses; shape (poses, places, 3)."""
    cosine, sine = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x = poses[:, :1] + cosine * places[:, 0] - sine * places[:, 1]
    y = poses[:, 1:2] + sine * places[:, 0] + cosine * places[:, 1]
    return np.stack([x, y, np.broadcast_to(poses[:, 2:] + turn, x.shape)], axis=2)


def _apart(one: Floats, other: Floats) -> bool:
    turned = abs(math.remainder(one[2] - other[2], 2.0 * math.pi))
    return bool(np.hypot(*(one[:2] - other[:2])) > 2.0 * CLAIM_RADIUS or turned > 2.0 * CLAIM_TURN)


def greatest_share(evidence: Floats, claim: float = CERTAIN) -> Floats:
    """Return the greatest probability with which a pose can have been claimed, given evidence against rivals.

    Parameters
    ----------
    evidence : array, shape (rivals, times)
        Nats.
    claim : float
        Share of the claims that are right.

    Returns
    -------
    array, shape (times,)
        1 where no rival hinders.
    """
    share = np.ones(evidence.shape[1])
    if not len(evidence):
        return share
    hardest = np.sort(np.minimum(evidence, 500.0), axis=0)
    for number in range(1, len(hardest) + 1):
        together = -np.log(np.mean(np.exp(-hardest[:number]), axis=0)) + 1e-12
        allowed = (1.0 - claim) / claim / number
        low, high = np.zeros_like(share), np.ones_like(share)
        for _ in range(40):
            middle = 0.5 * (low + high)
            fits = coin_divergence(middle, allowed * middle) <= together
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        share = np.minimum(share, np.where(together >= -math.log(allowed), 1.0, low))
    return share


def coin_divergence(one: Floats, other: Floats) -> Floats:
    """Return the Kullback-Leibler divergence of two coins in nats."""
    with np.errstate(divide="ignore", invalid="ignore"):
        heads = np.where(one > 0.0, one * np.log(one / other), 0.0)
        tails = np.where(one < 1.0, (1.0 - one) * np.log((1.0 - one) / (1.0 - other)), 0.0)
    return np.asarray(heads + tails)


def soonest_quantile(shares: Floats, share: float) -> float:
    """Return the first cycle at which so many of the runs can know their pose; infinite if none is.

    Parameters
    ----------
    shares : array, shape (starts, times)
        As of `greatest_share`.
    share : float
    """
    reached = np.flatnonzero(shares.mean(axis=0) >= share)
    return float(reached[0]) if len(reached) else math.inf
