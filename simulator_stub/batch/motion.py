"""Wheels and walls for many robots, each alone in its world, with numpy, to the last bit as for one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.kinematics import ROBOT_RADIUS
from ciberrato.labtables import NOWHERE, TOUCHED, LabTables

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


def cosines_and_sines(angles: Floats) -> tuple[Floats, Floats]:
    """Compute them as `math` does: numpy's may differ in the last bit.

    Parameters
    ----------
    angles : array
        Radians.

    Returns
    -------
    cosines, sines : array
        Of the same shape.
    """
    numbers = angles.ravel().tolist()
    cosines = np.fromiter(map(math.cos, numbers), np.float64, len(numbers))
    sines = np.fromiter(map(math.sin, numbers), np.float64, len(numbers))
    return cosines.reshape(angles.shape), sines.reshape(angles.shape)


def wrap(angles: Floats) -> Floats:
    """Take at most one turn off angles: `ciberrato.angles.wrap_once`."""
    turn = 2 * math.pi
    return np.where(angles > math.pi, angles - turn, np.where(angles < -math.pi, angles + turn, angles))


def touching(tables: LabTables, x: Floats, y: Floats) -> Booleans:
    """Find out which robots would overlap a face.

    Parameters
    ----------
    tables : LabTables
    x, y : array, shape (n,)
        Their centres.

    Returns
    -------
    array of bool, shape (n,)
    """
    rows = tables.rows_at(x, y)
    counts = np.where(rows == NOWHERE, TOUCHED + 1, tables.touched_count[rows])
    result = np.zeros(x.size, np.bool_)
    listed = np.flatnonzero((counts > 0) & (counts <= TOUCHED))
    if listed.size:
        width = int(counts[listed].max())
        faces = tables.faces[tables.touched[rows[listed], :width]]
        near = _overlap(faces, x[listed, np.newaxis], y[listed, np.newaxis])
        result[listed] = (near & (np.arange(width) < counts[listed, np.newaxis])).any(axis=1)
    for robot in np.flatnonzero(counts > TOUCHED).tolist():
        result[robot] = tables.walls.touches(float(x[robot]), float(y[robot]), ROBOT_RADIUS)
    return result


def _overlap(faces: Floats, x: Floats, y: Floats) -> Booleans:
    """Whether points are nearer than a radius to faces; shapes (n, k, 9) and (n, 1)."""
    length, ux, uy = faces[..., 4], faces[..., 7], faces[..., 8]
    dx, dy = x - faces[..., 0], y - faces[..., 1]
    ex, ey = x - faces[..., 5], y - faces[..., 6]
    along = dx * ux + dy * uy
    distance = np.where(
        along < 0.0,
        np.sqrt(dx * dx + dy * dy),
        np.where(along > length, np.sqrt(ex * ex + ey * ey), np.abs(dx * uy - dy * ux)),
    )
    return distance < ROBOT_RADIUS
