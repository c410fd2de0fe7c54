"""Distinguish a few possible poses: multi-hypothesis active localization.

When a handful of poses is left, the robot knows a lot about what it would see: on the same path relative to
itself, every hypothesis predicts its own readings. The paths that are free under all hypotheses form one
graph over relative poses. On it the quickest path to every relative place is found, the evidence between each
pair of hypotheses is added up along it, and the place with the greatest expected drop of entropy for the
time that it takes to get there is the goal (Jensfelt and Kristensen, *Active global localization for a
mobile robot using multiple hypothesis tracking*, 2001; Thrun, Burgard, Fox, *Probabilistic Robotics*,
section 17.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.drives.clearance import clearance
from agent.drives.outlook import readings_at
from ciberrato.arrays import Floats, Integers
from ciberrato.geometry.angles import short_turn
from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.tables.pose_tables import PoseTables
from ciberrato.localization.tables.reading_codes import code_distances
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import Target

_SPACING = 0.35
_RADIUS = 18  # nodes to each side
_CLEARANCE = 0.56  # units of clearance that a node must have
_LEAVING = 0.5
_DIRECTIONS = 8
_SPEED = 0.14  # units per cycle
_TURN_RATE = 0.27  # radians per cycle
_TURN_START = 3.0  # cycles that stopping and starting to turn cost
_EXPONENT = 0.4
_CLIP = 5.0
"""Evidence that a cycle can give at most, as a natural logarithm, untempered."""
_GROUND = _EXPONENT * 4.0
"""Evidence of the ground sensor in a cycle; the filter takes a report as wrong with probability 0.02."""
_STOP = 5.0
"""Cycles added to every path, so that none is chosen for its shortness only."""
_LONGEST = 70.0
_PLACE, _TURN = 0.12, 0.07
"""Units and radians by which the pose of a hypothesis may be out, at least."""
_ERRORS = (
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
)
"""Of x, y and heading, as multiples of what each may be out by."""

FIRST_TURNS: Floats = np.arange(_DIRECTIONS, dtype=np.float64) * (2.0 * math.pi / _DIRECTIONS)
"""Turns in radians with which a path may begin."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The first leg of the path that is expected to be most informative.

    Attributes
    ----------
    turn : float
        Radians to turn by at first.
    length : float
        Units to drive then.
    gain : float
        Expected drop of entropy on the whole path, in nats.
    cycles : float
        Time of the whole path.
    """

    turn: float
    length: float
    gain: float
    cycles: float


class PredictedReadings:
    """Readings that a robot would have under each hypothesis.

    A hypothesis is a little out of place, and an edge that is just in view is not in view a little aside. So
    what is predicted is a range for each sensor: all that is expected within the error of the pose.

    Parameters
    ----------
    tables : PoseTables
    noise : float
        Standard deviation of a reading.
    place, turn : float
        Units and radians by which the pose of a hypothesis may be out.
    """

    def __init__(self, tables: PoseTables, noise: float, place: float = _PLACE, turn: float = _TURN) -> None:
        self._tables = tables
        self._out = np.array([place, place, turn])
        self._readings = 1.0 / code_distances() / noise

    def __call__(self, x: Floats, y: Floats, heading: Floats) -> tuple[Floats, Floats]:
        """Return the range of the expected readings at some poses, in standard deviations.

        Parameters
        ----------
        x, y, heading : array
            Units and radians, of equal shape.

        Returns
        -------
        low, high : array, shape (..., sensors)
            0 where no robot can be.
        """
        middle, inside = self._at(x, y, heading)
        low = high = np.where(inside[..., np.newaxis], middle, 0.0)
        for error in _ERRORS:
            dx, dy, turn = error * self._out
            other, free = self._at(x + dx, y + dy, heading + turn)
            both = (inside & free)[..., np.newaxis]
            low = np.where(both, np.minimum(low, other), low)
            high = np.where(both, np.maximum(high, other), high)
        return low, high

    def _at(self, x: Floats, y: Floats, heading: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        return readings_at(self._tables, self._readings, x, y, heading)


def plan(
    tables: PoseTables,
    hypotheses: list[PoseEstimate],
    noise: float,
    barred: NDArray[np.bool_],
    targets: Sequence[Target] = (),
    spread: tuple[float, float] = (0.0, 0.0),
) -> Plan | None:
    """Find the path that best separates some hypotheses for the time that it takes.

    Parameters
    ----------
    tables : PoseTables
    hypotheses : list of PoseEstimate
        At least two.
    noise : float
        Standard deviation of a reading.
    barred : array of bool, shape (8,)
        Mask of first turns, in steps of 45 degrees to the left, that are not allowed.
    targets : sequence of Target
        Places that the ground sensor reports: where rooms are equal for IR, only they make a difference.
    spread : (float, float)
        Standard deviations of place (units) and heading (radians) within a hypothesis.

    Returns
    -------
    Plan or None
        None if there is no path that is free under all hypotheses.
    """
    poses = np.array([(h.x, h.y, h.heading) for h in hypotheses])
    weights = np.array([h.probability for h in hypotheses])
    weights /= weights.sum()
    free = _free(tables, poses)
    times, parents = _quickest(free, barred)
    reached = np.flatnonzero((times < _LONGEST) & (parents >= 0))
    if not len(reached):
        return None
    predict_readings = PredictedReadings(tables, noise, max(_PLACE, spread[0]), max(_TURN, spread[1]))
    evidence = _evidence(predict_readings, poses, times, parents, reached, targets)
    gain = _gain(weights, evidence)
    best = int((gain / (times[reached] + _STOP)).argmax())
    turn, length = _first_leg(int(reached[best]), parents)
    return Plan(turn, length, float(gain[best]), float(times[reached[best]]))


_SIDE = 2 * _RADIUS + 1
_NODES = _SIDE * _SIDE
_ANGLES = FIRST_TURNS
_MOVES = [(round(math.cos(a)), round(math.sin(a))) for a in _ANGLES]
_LENGTHS = np.array([_SPACING * math.hypot(*move) for move in _MOVES])
_TURNS = np.abs((_ANGLES - _ANGLES[:, np.newaxis] + math.pi) % (2.0 * math.pi) - math.pi)
_TURN_COSTS = np.where(_TURNS > 0.01, _TURNS / _TURN_RATE + _TURN_START, 0.0)


def _relative() -> tuple[Floats, Floats]:
    line = _SPACING * np.arange(-_RADIUS, _RADIUS + 1)
    return np.tile(line, (_SIDE, 1)), np.tile(line[:, np.newaxis], (1, _SIDE))


def _places(
    poses: Floats, ahead: NDArray[np.floating[Any]], left: NDArray[np.floating[Any]]
) -> tuple[Floats, Floats]:
    """Compute relative places as seen by each hypothesis; shape (hypotheses, ...)."""
    expand = (slice(None),) + (np.newaxis,) * ahead.ndim
    x, y, heading = (poses[:, i][expand] for i in range(3))
    cosine, sine = np.cos(heading), np.sin(heading)
    return x + cosine * ahead - sine * left, y + sine * ahead + cosine * left


def _free(tables: PoseTables, poses: Floats) -> NDArray[np.bool_]:
    """Return which relative places are free under all hypotheses."""
    ahead, left = _relative()
    clearances = clearance(tables.lattice, *_places(poses, ahead, left))
    here = clearances[:, _RADIUS, _RADIUS][:, np.newaxis, np.newaxis]
    near = np.hypot(ahead, left) < _LEAVING
    free: NDArray[np.bool_] = np.all(
        (clearances >= _CLEARANCE) | (near & (clearances >= here) & (clearances > 0.0)), axis=0
    )
    return free


def _quickest(free: NDArray[np.bool_], barred: NDArray[np.bool_]) -> tuple[Floats, Integers]:
    """Find the quickest path to every place and direction of arrival.

    Returns
    -------
    times : array, shape (8 * nodes,)
        Cycles; infinite where there is no path.
    parents : array of int, shape (8 * nodes,)
        The place and direction before; -1 at the start and where there is no path.
    """
    times = np.full((_DIRECTIONS, _SIDE, _SIDE), np.inf)
    parents = np.full((_DIRECTIONS, _SIDE, _SIDE), -1, np.int64)
    numbers = np.arange(_NODES).reshape(_SIDE, _SIDE)
    free = free.copy()
    free[_RADIUS, _RADIUS] = False  # no path leads back
    for step in range(_RADIUS * 3):
        changed = False
        for direction, (dx, dy) in enumerate(_MOVES):
            before = times + _TURN_COSTS[:, direction][:, np.newaxis, np.newaxis]
            came = before.argmin(axis=0)
            cost = np.take_along_axis(before, came[np.newaxis], axis=0)[0]
            origin = came * _NODES + numbers
            if step == 0 and not barred[direction]:
                cost = cost.copy()
                cost[_RADIUS, _RADIUS] = _TURN_COSTS[0, direction]
                origin[_RADIUS, _RADIUS] = _RADIUS * _SIDE + _RADIUS
            target, source = _shifted(dx, dy)
            new = np.where(free[target], cost[source] + _LENGTHS[direction] / _SPEED, np.inf)
            new[new > _LONGEST] = np.inf
            better = new < times[direction][target] - 1e-9
            if better.any():
                changed = True
                times[direction][target] = np.where(better, new, times[direction][target])
                parents[direction][target] = np.where(better, origin[source], parents[direction][target])
        if not changed:
            break
    return times.ravel(), parents.ravel()


def _shifted(dx: int, dy: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    def pair(d: int) -> tuple[slice, slice]:
        return (slice(max(d, 0), _SIDE + min(d, 0)), slice(max(-d, 0), _SIDE + min(-d, 0)))

    (to_x, from_x), (to_y, from_y) = pair(dx), pair(dy)
    return (to_y, to_x), (from_y, from_x)


def _evidence(
    predict_readings: PredictedReadings,
    poses: Floats,
    times: Floats,
    parents: Integers,
    reached: Integers,
    targets: Sequence[Target] = (),
) -> Floats:
    """Add up the evidence between hypotheses along the paths; shape (reached, hypotheses, hypotheses)."""
    direction, node = reached // _NODES, reached % _NODES
    ahead = (node % _SIDE - _RADIUS) * _SPACING
    left = (node // _SIDE - _RADIUS) * _SPACING
    x, y = _places(poses, ahead, left)
    heading = poses[:, 2][:, np.newaxis] + _ANGLES[direction]
    apart = _apart(predict_readings(x, y, heading)) + _ground_apart(x, y, targets)
    apart *= (_LENGTHS[direction] / _SPEED)[:, np.newaxis, np.newaxis]
    # Ways that begin with a turn see what is to be seen on it, first.
    turning = _turning(predict_readings, poses)
    start = _RADIUS * _SIDE + _RADIUS
    first = parents[reached] == start
    apart[first] += turning[direction[first]]
    position = np.full(len(times), len(reached), np.int64)
    position[reached] = np.arange(len(reached))
    above = np.where(first, len(reached), position[np.maximum(parents[reached], 0)])
    above = np.append(above, len(reached))
    total = np.concatenate([apart, np.zeros((1, *apart.shape[1:]))])
    while (above < len(reached)).any():
        total = total + total[above]
        above = above[above]
    return total[:-1]


def _turning(predict_readings: PredictedReadings, poses: Floats) -> Floats:
    """Compute the evidence of turning in place to each direction; shape (8, hypotheses, hypotheses)."""
    looks = 2 * _DIRECTIONS
    angles = 2.0 * math.pi / looks * np.arange(looks)
    shape = (len(poses), looks)
    x, y = np.broadcast_to(poses[:, :1], shape), np.broadcast_to(poses[:, 1:2], shape)
    apart = _apart(predict_readings(x, y, poses[:, 2:] + angles)) * (2.0 * math.pi / looks / _TURN_RATE)
    turned = [np.zeros_like(apart[0])]
    for direction in range(1, _DIRECTIONS):
        steps = min(direction, _DIRECTIONS - direction) * 2
        sign = 1 if direction <= _DIRECTIONS // 2 else -1
        turned.append(apart[[sign * k % looks for k in range(1, steps + 1)]].sum(axis=0))
    return np.array(turned)


def _apart(foretold: tuple[Floats, Floats]) -> Floats:
    """Compute the evidence of a cycle between pairs; from (hypotheses, places, sensors) to (places, h, h)."""
    low, high = (part.transpose(1, 0, 2) for part in foretold)
    gap = low[:, :, np.newaxis] - high[:, np.newaxis]
    gap = np.maximum(np.maximum(gap, gap.transpose(0, 2, 1, 3)), 0.0)
    return np.asarray(_EXPONENT * np.minimum(0.5 * (gap**2).sum(axis=-1), _CLIP))


def _ground_apart(x: Floats, y: Floats, targets: Sequence[Target]) -> Floats:
    """Compute the evidence of the ground sensor in a cycle between pairs, as `_apart`."""
    differ = np.zeros((x.shape[1], len(x), len(x)), np.bool_)
    for target in targets:
        beyond = np.hypot(x - target.x, y - target.y).T - (target.radius - ROBOT_RADIUS)
        inside, outside = beyond < -_PLACE, beyond > _PLACE
        differ |= inside[:, :, np.newaxis] & outside[:, np.newaxis]
    return np.asarray(_GROUND * (differ | differ.transpose(0, 2, 1)), np.float64)


def _gain(weights: Floats, evidence: Floats) -> Floats:
    """Return the expected drop of the entropy over hypotheses, in nats; shape (paths,)."""
    left = (weights * np.exp(-evidence)).sum(axis=-1)  # of the sum, if the hypothesis of the row is true
    return np.asarray(-(weights * np.log(left)).sum(axis=-1))


def _first_leg(state: int, parents: Integers) -> tuple[float, float]:
    """Trace a path back to its first leg: the turn, and how far straight on."""
    chain = [state]
    start = _RADIUS * _SIDE + _RADIUS
    while parents[chain[-1]] not in (-1, start):
        chain.append(int(parents[chain[-1]]))
    chain.reverse()
    direction = chain[0] // _NODES
    straight = 0
    for entry in chain:
        if entry // _NODES != direction:
            break
        straight += 1
    angle = short_turn(float(_ANGLES[direction]))
    return angle, straight * float(_LENGTHS[direction])
