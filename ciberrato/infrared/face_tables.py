"""Faces near each square of a lab, as arrays: for many places at once.

Squares are those of `ciberrato.geometry.visible_faces`, half a unit wide. A square gets its entries when it
is first asked for.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.geometry.visible_faces import LONGEST, SECTORS, SQUARES_PER_UNIT
from ciberrato.geometry.walls import WallMap
from ciberrato.physics.kinematics import ROBOT_RADIUS

OUTSIDE = 2
"""Units beyond the border that still have squares: sensors may stick out of the lab."""
TOUCHED = 12
"""Most faces listed that a robot in a square might touch; more are looked up one robot at a time."""
NOWHERE = -1
UNKNOWN = -2
"""Rows of places without a square, and of squares without entries."""

_CHUNK = 2**21
"""Squares times sectors times faces worked on at once."""
_MOST_FACES = 4096
"""Faces all of which are looked at for a square; of more, the nearest ones only."""


class LabTables:
    """Lists of faces by square; one for all batches in a lab.

    Parameters
    ----------
    walls : WallMap

    Attributes
    ----------
    walls : WallMap
    faces : array, shape (faces, 9)
        Start x and y, edge x and y, length, end x and y, direction x and y of each face.
    row_of : array of int, shape (squares up, squares right)
        Row of a square's entries in the arrays below.
    seen : array, shape (rows, SECTORS, LONGEST + 1, 2)
        Faces that a cone can meet, nearest first: lower bounds of their distances, infinite where a list is
        shorter, and their numbers. The last bound is that of the nearest face that is not in the list. In
        single precision and side by side, so that what is needed of a list is in one line of the cache.
    touched : array of int, shape (rows, TOUCHED)
        Faces that a robot might touch whose centre is in the square.
    touched_count : array of int, shape (rows,)
        Number of them; may be more than `TOUCHED`.
    """

    def __init__(self, walls: WallMap) -> None:
        self.walls = walls
        self.faces = np.ascontiguousarray(
            np.column_stack((walls.start, walls.edge, walls.length, walls.end, walls.direction))
        )
        across = math.ceil(walls.width) + 2 * OUTSIDE
        up = math.ceil(walls.height) + 2 * OUTSIDE
        self.row_of = np.full((up * SQUARES_PER_UNIT, across * SQUARES_PER_UNIT), UNKNOWN, np.int64)
        self._rows = 0
        self.seen = np.zeros((0, SECTORS, LONGEST + 1, 2), np.float32)
        self.touched = np.zeros((0, TOUCHED), np.int64)
        self.touched_count = np.zeros(0, np.int64)

    @property
    def squares(self) -> int:
        """Number of squares that have entries."""
        return self._rows

    def rows_at(self, x: Floats, y: Floats) -> Integers:
        """Find the rows of places; squares that have no entries yet get them.

        Parameters
        ----------
        x, y : array, shape (n,)
            Units.

        Returns
        -------
        array of int, shape (n,)
            `NOWHERE` where there is no square.
        """
        column = np.floor(x * SQUARES_PER_UNIT).astype(np.int64) + OUTSIDE * SQUARES_PER_UNIT
        row = np.floor(y * SQUARES_PER_UNIT).astype(np.int64) + OUTSIDE * SQUARES_PER_UNIT
        squares_up, squares_right = self.row_of.shape
        inside = (column >= 0) & (column < squares_right) & (row >= 0) & (row < squares_up)
        flat = np.where(inside, row * squares_right + column, 0)
        rows = self.row_of.ravel()[flat]
        if (rows[inside] == UNKNOWN).any():
            self._add(np.unique(flat[inside & (rows == UNKNOWN)]))
            rows = self.row_of.ravel()[flat]
        return np.where(inside, rows, NOWHERE)

    def _make_room(self, rows: int) -> None:
        more = rows - self.touched_count.size
        empty = np.zeros((more, SECTORS, LONGEST + 1, 2), np.float32)
        empty[..., 0] = np.inf
        self.seen = np.concatenate((self.seen, empty))
        self.touched = np.concatenate((self.touched, np.zeros((more, TOUCHED), np.int64)))
        self.touched_count = np.concatenate((self.touched_count, np.zeros(more, np.int64)))

    def _add(self, flat: Integers) -> None:
        """Create entries for squares, given by their places in the flattened `row_of`."""
        if self._rows + flat.size > self.touched_count.size:
            self._make_room(2 * (self._rows + flat.size))
        many = len(self.faces) > _MOST_FACES
        chunk = 1 if many else max(1, _CHUNK // (SECTORS * max(1, len(self.faces))))
        for low in range(0, flat.size, chunk):
            some = flat[low : low + chunk]
            up, right = np.divmod(some, self.row_of.shape[1])
            squares = right - OUTSIDE * SQUARES_PER_UNIT, up - OUTSIDE * SQUARES_PER_UNIT
            beyond = math.inf
            if many:
                column, row = (int(number[0]) for number in squares)
                nearest, limits, here, beyond = self.walls.views.near(column, row)
                order, bounds, ahead = nearest[np.newaxis], limits[np.newaxis], here[np.newaxis]
            else:
                order, bounds, ahead = self.walls.views.select(*squares)
            rows = slice(self._rows, self._rows + some.size)
            kept = np.argsort(~ahead, axis=-1, kind="stable")[..., : LONGEST + 1]
            listed = np.take_along_axis(ahead, kept, axis=-1)
            limits = np.take_along_axis(bounds[:, np.newaxis], kept, axis=-1)
            numbers = np.take_along_axis(order[:, np.newaxis], kept, axis=-1)
            self.seen[rows, :, : kept.shape[-1], 0] = np.where(listed, _round_down(limits), np.inf)
            self.seen[rows, :, : kept.shape[-1], 1] = np.where(listed, numbers, 0)
            unlisted = self.seen[rows, :, LONGEST, 0]
            np.minimum(unlisted, _round_down(np.full(unlisted.shape, beyond)), out=unlisted)
            self.touched[rows, : min(TOUCHED, order.shape[1])] = order[:, :TOUCHED]
            self.touched_count[rows] = (bounds < ROBOT_RADIUS).sum(axis=1)
            self.row_of.ravel()[some] = np.arange(rows.start, rows.stop)
            self._rows += some.size


@lru_cache(maxsize=16)
def tables_of(walls: WallMap) -> LabTables:
    """Return the tables for walls, created at the first call for these walls."""
    return LabTables(walls)


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
    """Return whether points are nearer than a radius to faces; shapes (n, k, 9) and (n, 1)."""
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


def _round_down(bounds: Floats) -> NDArray[np.float32]:
    single = bounds.astype(np.float32)
    return np.where(single > bounds, np.nextafter(single, np.float32(-np.inf)), single)
