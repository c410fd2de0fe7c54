"""Worth of a leg while the pose is unknown: the evidence between likely poses that its readings would bring.

It is the expected drop of the entropy over a sample of the belief (Thrun, Burgard, Fox, *Probabilistic
Robotics*, section 17.4) by a straight leg. Readings that could come from a small error of the pose tell
nothing. `agent.drives.disambiguation` plans whole paths, for a few hypotheses; this asks of one leg only, and
of many poses.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.drives.clearance import PoseSample
from ciberrato.arrays import Floats
from ciberrato.localization.tables.pose_tables import PoseTables
from ciberrato.localization.tables.reading_codes import code_distances

_STEP = 0.5
"""Units between two places of a leg that are looked at."""
_SPEED = 0.14  # units per cycle
_EXPONENT = 0.4
_CLIP = 5.0
"""Evidence that a cycle can give at most, as a natural logarithm, untempered."""
ERROR = 0.15
"""Units by which the place of a hypothesis may be out."""
_GREATEST = 4.0
"""Readings above count as equal: the robot stops before it has them."""


def expected_gain(
    tables: PoseTables,
    sample: PoseSample,
    turns: Floats,
    lengths: Floats,
    noise: float,
    error: float = ERROR,
) -> Floats:
    """Compute the expected drop of entropy over a sample of poses by straight legs.

    Parameters
    ----------
    tables : PoseTables
    sample : PoseSample
        Equally likely poses.
    turns : array, shape (legs,)
        Radians, before the leg.
    lengths : array, shape (legs,)
        Units.
    noise : float
        Standard deviation of a reading.
    error : float
        Units by which the place of a sampled pose may be out.

    Returns
    -------
    array, shape (legs,)
        Nats, from 0 to the logarithm of the number of poses.
    """
    along = np.arange(_STEP, max(float(lengths.max()), _STEP) + 1e-9, _STEP)
    heading = (sample.heading + turns[:, np.newaxis])[:, np.newaxis]
    x = sample.x + along[:, np.newaxis] * np.cos(heading)
    y = sample.y + along[:, np.newaxis] * np.sin(heading)
    by_code = np.minimum(1.0 / code_distances(), _GREATEST).astype(np.float32)
    readings, inside = readings_at(tables, by_code, x, y, np.broadcast_to(heading, x.shape))
    readings = np.where(inside[..., np.newaxis], readings, np.float32(0.0))
    cycle = np.zeros((*x.shape, x.shape[-1]), np.float32)
    for sensor in np.moveaxis(readings, -1, 0):  # one at a time: that stays in the processor's cache
        most = np.maximum(sensor[..., np.newaxis], sensor[..., np.newaxis, :])
        gap = np.abs(sensor[..., np.newaxis] - sensor[..., np.newaxis, :])
        # A reading of 1/d changes by d**-2 with a unit of place.
        most *= most
        most *= np.float32(error)
        gap -= most
        np.maximum(gap, 0.0, out=gap)
        gap *= gap
        cycle += gap
    cycle *= np.float32(0.5 / noise**2)
    np.minimum(cycle, np.float32(_CLIP), out=cycle)
    reached = (along <= lengths[:, np.newaxis] + 1e-9) * (_EXPONENT * _STEP / _SPEED)
    evidence = np.einsum("lpij,lp->lij", cycle, reached.astype(np.float32))
    return np.asarray(-np.log(np.exp(-evidence).mean(axis=-1)).mean(axis=-1), np.float64)


def readings_at(
    tables: PoseTables, by_code: NDArray[Any], x: Floats, y: Floats, heading: Floats
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return what the tables expect at some poses.

    Parameters
    ----------
    tables : PoseTables
    by_code : array, shape (256,)
        Reading for each code of a distance.
    x, y, heading : array
        Units and radians, of equal shape.

    Returns
    -------
    readings : array, shape (..., sensors)
    inside : array of bool, shape (...)
        True for the poses that a robot can have; the readings of the others mean nothing.
    """
    lattice = tables.lattice
    column = np.clip(np.round((x - lattice.origin[0]) / lattice.resolution), 0, lattice.nx - 1)
    row = np.clip(np.round((y - lattice.origin[1]) / lattice.resolution), 0, lattice.ny - 1)
    square = lattice.index[(row * lattice.nx + column).astype(np.int64)]
    inside = square < lattice.size
    square = np.minimum(square, lattice.size - 1)
    around = tables.codes[0].shape[0] // 2
    direction = np.round(heading / (2.0 * math.pi) * around).astype(np.int64) % around
    parts = [by_code[tables.codes[table][direction + ahead, square]] for table, ahead in tables.sensors]
    return np.stack(parts, axis=-1), inside
