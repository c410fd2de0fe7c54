"""Clearance ahead of the robot, as far as its belief can say: free paths of a sample of the likely poses.

A robot that does not know where it is can still know that it may drive on: if the way ahead is free from
every pose that it may have. All policies steer by these clearances, before and after the pose is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.physics.kinematics import ROBOT_RADIUS

SAMPLES = 96
_STEP = 0.1  # units between two looks along a path
SAFE_CLEARANCE = ROBOT_RADIUS + 0.03
_LEAVING = 0.35
"""Units within which a robot too near to a wall is to get away from it."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseSample:
    """Poses drawn from a belief, each as likely.

    Attributes
    ----------
    x, y : array, shape (samples,)
        Units.
    heading : array, shape (samples,)
        Radians.
    """

    x: Floats
    y: Floats
    heading: Floats


def draw(belief: PoseBelief, count: int = SAMPLES) -> PoseSample:
    """Draw poses at even steps through the cumulated weights: no random numbers are needed.

    Parameters
    ----------
    belief : PoseBelief
    count : int

    Returns
    -------
    PoseSample
    """
    size = belief.lattice.size
    steps = (np.arange(count) + 0.5) / count
    if belief.dense is None:
        total = np.cumsum(belief.weight, dtype=np.float64)
        chosen = np.minimum(np.searchsorted(total, steps * total[-1]), len(total) - 1)
        bins, squares = belief.bin[chosen], belief.square[chosen]
    else:
        by_bin = np.cumsum(belief.bin_weights())
        bins = np.minimum(np.searchsorted(by_bin, steps * by_bin[-1]), belief.bins - 1)
        squares = np.empty(count, np.int64)
        for row in np.unique(bins):
            members = np.flatnonzero(bins == row)
            total = np.cumsum(belief.dense[row, :-1], dtype=np.float64)
            places = (np.arange(len(members)) + 0.5) / len(members) * total[-1]
            squares[members] = np.minimum(np.searchsorted(total, places), size - 1)
    x, y = belief.places(bins, squares)
    return PoseSample(
        x=x,
        y=y,
        heading=bins * belief.bin_width + belief.heading_offset,
    )


def clearance(lattice: Lattice, x: Floats, y: Floats) -> Floats:
    """Return the distance to the nearest wall at the nodes nearest to some places; 0 where nothing is free.

    Parameters
    ----------
    lattice : Lattice
    x, y : array
        Units; any shape.

    Returns
    -------
    array
    """
    column = np.round((x - lattice.origin[0]) / lattice.resolution).astype(np.int64)
    row = np.round((y - lattice.origin[1]) / lattice.resolution).astype(np.int64)
    np.clip(column, 0, lattice.nx - 1, out=column)
    np.clip(row, 0, lattice.ny - 1, out=row)
    return np.asarray(lattice.padded_clearance[lattice.index[row * lattice.nx + column]])


def free_distances(lattice: Lattice, sample: PoseSample, turns: Floats, longest: float) -> Floats:
    """Compute how far each sampled pose could drive straight on after a turn.

    Parameters
    ----------
    lattice : Lattice
    sample : PoseSample
    turns : array, shape (turns,)
        Radians.
    longest : float
        Units that are looked at.

    Returns
    -------
    array, shape (turns, samples)
        Units.
    """
    distances = np.arange(_STEP, longest + _STEP / 2.0, _STEP)
    heading = sample.heading + turns[:, np.newaxis]
    x = sample.x[:, np.newaxis] + distances * np.cos(heading)[..., np.newaxis]
    y = sample.y[:, np.newaxis] + distances * np.sin(heading)[..., np.newaxis]
    clearances = clearance(lattice, x, y)
    # A robot that is near a wall, or whose square is, may go where it gets no nearer.
    here = clearance(lattice, sample.x, sample.y)[:, np.newaxis]
    free = (clearances >= SAFE_CLEARANCE) | (
        (clearances >= here) & (clearances > 0.0) & (distances <= _LEAVING)
    )
    return np.asarray(np.logical_and.accumulate(free, axis=-1).sum(axis=-1) * _STEP)


def arc_clearances(
    lattice: Lattice, sample: PoseSample, curvatures: Floats, length: float
) -> tuple[Floats, Floats]:
    """Compute the clearance along short arcs.

    Parameters
    ----------
    lattice : Lattice
    sample : PoseSample
    curvatures : array, shape (arcs,)
        Radians per unit of length; positive to the left.
    length : float
        Units.

    Returns
    -------
    least : array, shape (arcs, samples)
        Least clearance on the arc, its beginning left out.
    mean : array, shape (arcs, samples)
        Mean clearance, each at most 1.
    """
    distances = np.arange(_STEP, length + _STEP / 2.0, _STEP)
    turned = curvatures[:, np.newaxis] * (distances - _STEP / 2.0)
    heading = sample.heading[np.newaxis, :, np.newaxis] + turned[:, np.newaxis, :]
    x = sample.x[:, np.newaxis] + np.cumsum(_STEP * np.cos(heading), axis=-1)
    y = sample.y[:, np.newaxis] + np.cumsum(_STEP * np.sin(heading), axis=-1)
    clearances = clearance(lattice, x, y)
    return clearances.min(axis=-1), np.minimum(clearances, 1.0).mean(axis=-1)
