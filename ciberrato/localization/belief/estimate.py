"""Estimates from a belief: the pose, its certainty, and the other hypotheses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.geometry.angles import short_turns
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.reprs import short_repr
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE

CLAIM_RADIUS = 0.5
"""Units: the probability of an estimate is that of all poses so near, and turned so little."""
CLAIM_TURN = math.radians(10.0)
CERTAIN = 0.99
"""Probability from which on the pose counts as known; probabilities are calibrated."""
LIKELY = 0.95
"""Probability above which a pose, once known, is good enough to go on with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseEstimate:
    """A pose and its probability.

    Attributes
    ----------
    x, y : float
        Units.
    heading : float
        Radians within ±π.
    probability : float
        Weight of all poses within `CLAIM_RADIUS` and `CLAIM_TURN`.
    cell : (int, int)
        Row (from the bottom) and column of the cell.
    """

    __repr__ = short_repr

    x: float
    y: float
    heading: float
    probability: float
    cell: tuple[int, int]

    @property
    def certain(self) -> bool:
        """Return whether the pose counts as known."""
        return self.probability > CERTAIN

    @property
    def likely(self) -> bool:
        """Return whether the pose is good enough to go on with, if it was known before."""
        return self.probability > LIKELY

    def moved_to(self, x: float, y: float, heading: float) -> PoseEstimate:
        """Return an estimate of another pose, with the same probability; the heading within ±π."""
        return PoseEstimate(x=x, y=y, heading=heading, probability=self.probability, cell=cell_at(x, y))


def cell_at(x: float, y: float) -> Cell:
    """Return the cell that a place in units is in: row (from the bottom) and column."""
    return math.floor(y / CELL_SIZE), math.floor(x / CELL_SIZE)


def estimate(belief: PoseBelief) -> PoseEstimate:
    """Find the pose around which the most likely state lies.

    Parameters
    ----------
    belief : PoseBelief

    Returns
    -------
    PoseEstimate
    """
    return modes(belief, most=1)[0]


def modes(belief: PoseBelief, *, most: int = 8, least: float = 0.02) -> list[PoseEstimate]:
    """Find the poses that the belief is gathered around, the most probable state's first.

    Parameters
    ----------
    belief : PoseBelief
    most : int
        Greatest number to return.
    least : float
        Probability below which no further pose is given.

    Returns
    -------
    list of PoseEstimate
        At least one. No state counts for two of them.
    """
    bins, squares, weights = _strongest(belief)
    x, y = belief.places(bins, squares)
    headings = belief.headings()[bins]
    left = weights.copy()
    found: list[PoseEstimate] = []
    while len(found) < most:
        peak = int(left.argmax())
        if found and left[peak] <= 0.0:
            break
        centre = (float(x[peak]), float(y[peak]), float(headings[peak]))
        for reach in (1.5, 1.2):
            near = _within(x, y, headings, centre, reach)
            centre = _mean(x, y, headings, left * near, centre)
        inside = _within(x, y, headings, centre, 1.0)
        probability = min(float((left * inside).sum()), 1.0)
        if found and probability < least:
            break
        found.append(_as_estimate(centre, probability))
        left[_within(x, y, headings, centre, 1.5)] = 0.0
        left[peak] = 0.0
    return found


def probability_near(belief: PoseBelief, x: float, y: float, heading: float) -> float:
    """Return the weight of the poses within `CLAIM_RADIUS` and `CLAIM_TURN` of a pose.

    Parameters
    ----------
    belief : PoseBelief
    x, y : float
        Units.
    heading : float
        Radians.

    Returns
    -------
    float
    """
    if belief.dense is None:
        bins, squares, weights = belief.listed()
    else:
        near = np.abs(short_turns(belief.headings() - heading)) <= CLAIM_TURN
        lattice = belief.lattice
        close = np.hypot(lattice.x - x, lattice.y - y) <= CLAIM_RADIUS + lattice.resolution
        bins, squares = (
            np.repeat(np.flatnonzero(near), close.sum()),
            np.tile(np.flatnonzero(close), near.sum()),
        )
        weights = belief.dense[bins, squares].astype(np.float64)
    places_x, places_y = belief.places(bins, squares)
    inside = _within(places_x, places_y, belief.headings()[bins], (x, y, heading), 1.0)
    return min(float((weights * inside).sum()), 1.0)


def spread(belief: PoseBelief, pose: PoseEstimate) -> tuple[float, float]:
    """Compute how wide a belief is around one of its modes.

    Parameters
    ----------
    belief : PoseBelief
    pose : PoseEstimate

    Returns
    -------
    place, turn : float
        Standard deviations of the states near it, in units (along an axis) and radians; 0 without any.
    """
    bins, squares, weights = _strongest(belief)
    x, y = belief.places(bins, squares)
    headings = belief.headings()[bins]
    centre = (pose.x, pose.y, pose.heading)
    near = weights * _within(x, y, headings, centre, 2.0)
    total = float(near.sum())
    if total <= 0.0:
        return 0.0, 0.0
    middle = _mean(x, y, headings, near, centre)
    away = (x - middle[0]) ** 2 + (y - middle[1]) ** 2
    turned = short_turns(headings - middle[2]) ** 2
    return math.sqrt(float((near * away).sum()) / total / 2.0), math.sqrt(
        float((near * turned).sum()) / total
    )


def _strongest(belief: PoseBelief) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Return the states that carry the belief; of a dense one only those well above the mean."""
    if belief.dense is None:
        return belief.listed()
    weights = belief.dense  # its last column is zero
    strong = weights > 0.02 * float(weights.max())
    if np.count_nonzero(strong) <= 20_000:
        bins, squares = np.nonzero(strong)
    else:
        peak = np.unravel_index(int(weights.argmax()), weights.shape)
        bins, squares = np.array([peak[0]]), np.array([peak[1]])
    return bins, squares, weights[bins, squares].astype(np.float64)


def _within(
    x: Floats, y: Floats, headings: Floats, centre: tuple[float, float, float], reach: float
) -> NDArray[np.bool_]:
    near = (x - centre[0]) ** 2 + (y - centre[1]) ** 2 <= (reach * CLAIM_RADIUS) ** 2
    turned = np.abs(short_turns(headings - centre[2])) <= reach * CLAIM_TURN
    return np.asarray(near & turned)


def _mean(
    x: Floats, y: Floats, headings: Floats, weights: Floats, centre: tuple[float, float, float]
) -> tuple[float, float, float]:
    total = float(weights.sum())
    if total <= 0.0:
        return centre
    turn = float((weights * short_turns(headings - centre[2])).sum()) / total
    return float((weights * x).sum()) / total, float((weights * y).sum()) / total, centre[2] + turn


def _as_estimate(pose: tuple[float, float, float], probability: float) -> PoseEstimate:
    x, y, heading = pose
    return PoseEstimate(
        x=x,
        y=y,
        heading=math.remainder(heading, 2.0 * math.pi),
        probability=probability,
        cell=cell_at(x, y),
    )
