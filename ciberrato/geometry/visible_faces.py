"""Faces that a view cone can meet, nearest first, by the place and direction of its sensor.

The plane is divided into squares of half a unit and the circle into sectors of 45 degrees. For each pair a
list holds the nearest of the faces that a cone can meet whose sensor is in the square and looks into the
sector, by a lower bound of their distance. Loops over one sensor at a time and tables for many use them.
"""

from __future__ import annotations

import math
from itertools import islice

import numpy as np

from ciberrato.arrays import Booleans, Floats, Indices
from ciberrato.geometry.face_index import FaceIndex

SQUARES_PER_UNIT = 2
SECTORS = 8
SECTORS_PER_RADIAN = SECTORS / (2.0 * math.pi)

Seen = tuple[float, float, float, float, float, float]
"""A face: lower bound of its distance, start x and y, edge x and y (from start to end), length."""

SeenList = tuple[tuple[Seen, ...], float]
"""Faces by ascending bound, and the bound of the nearest one that is not there; infinite if all are."""

_HALF_APERTURE = math.pi / 6
_MARGIN = 1e-6
"""Far above rounding errors, in units and in radians."""
LONGEST = 24
"""Faces in a list; few sensors look as far as the last of them."""
CANDIDATES = (256, 2048)
"""Numbers of nearest faces among which those of all lists of a square are looked for, one after the other."""
_MAX_SQUARES = 8192
_NEARER = math.sqrt(0.5) / SQUARES_PER_UNIT + _MARGIN
"""Units that a point of a square may be nearer to a face than its centre is."""


class ViewLists:
    """Lists of faces by square and sector.

    Parameters
    ----------
    start, end, edge, direction : array, shape (faces, 2)
    length : array, shape (faces,)
        As in `ciberrato.geometry.walls.WallMap`.
    index : FaceIndex
        Of these faces.

    Attributes
    ----------
    lists : dict of (column, row) to tuple of SeenList
        For each square that a robot has been in, what can be seen from it, by sector. Sector s begins at s
        times 45 degrees, counter-clockwise.
    all_faces : tuple of Seen
        All faces, without bounds.
    """

    def __init__(
        self,
        start: Floats,
        end: Floats,
        edge: Floats,
        length: Floats,
        direction: Floats,
        index: FaceIndex,
    ) -> None:
        self._index = index
        self._start, self._end, self._length, self._direction = start, end, length, direction
        columns = [array.tolist() for array in (*start.T, *edge.T, length)]
        self._faces: list[tuple[float, float, float, float, float]] = list(zip(*columns, strict=True))
        self.all_faces: tuple[Seen, ...] = tuple((-math.inf, *face) for face in self._faces)
        self.lists: dict[tuple[int, int], tuple[SeenList, ...]] = {}
        low = np.arange(SECTORS) / SECTORS_PER_RADIAN - _HALF_APERTURE - _MARGIN
        high = np.arange(1, SECTORS + 1) / SECTORS_PER_RADIAN + _HALF_APERTURE + _MARGIN
        middle = (low + high) / 2.0
        # The cones of a sector lie on one side of each of three lines: their edges, and one behind them.
        self._across_x = np.stack((-np.sin(low), np.sin(high), np.cos(middle)))
        self._across_y = np.stack((np.cos(low), -np.cos(high), np.sin(middle)))
        reach = np.abs(self._across_x) + np.abs(self._across_y)
        self._limit = (-0.5 / SQUARES_PER_UNIT * reach - _MARGIN).reshape(-1, 1)
        # Each in one piece: one square is soon looked at, and small steps count.
        self._start_x, self._start_y = np.ascontiguousarray(start.T)
        self._end_x, self._end_y = np.ascontiguousarray(end.T)

    def add(self, square: tuple[int, int]) -> tuple[SeenList, ...]:
        """Create the lists of a square.

        Parameters
        ----------
        square : (int, int)
            Column and row of its lower left corner, in half units.

        Returns
        -------
        tuple of SeenList
            By sector.
        """
        if len(self.lists) >= _MAX_SQUARES:
            # Only who roams a very large lab comes here; the oldest squares are the ones left behind.
            for old in list(islice(self.lists, _MAX_SQUARES // 4)):
                del self.lists[old]
        order, bounds, ahead, beyond = self.near(*square)
        nearest, faces = bounds.tolist(), order.tolist()
        sectors = []
        for here in ahead:
            chosen = here.nonzero()[0][: LONGEST + 1].tolist()
            reach = nearest[chosen.pop()] if len(chosen) > LONGEST else beyond
            sectors.append((tuple([(nearest[index], *self._faces[faces[index]]) for index in chosen]), reach))
        self.lists[square] = tuple(sectors)
        return self.lists[square]

    def near(self, column: int, row: int) -> tuple[Indices, Floats, Booleans, float]:
        """Find what can be seen from a square, among as many of the nearest faces as its lists need.

        Parameters
        ----------
        column, row : int
            Lower left corner of the square in half units.

        Returns
        -------
        faces, bounds, ahead : array, shape (n,), (n,) and (SECTORS, n)
            As `select` returns them.
        beyond : float
            Bound of all other faces; infinite if there are none.
        """
        size = 1.0 / SQUARES_PER_UNIT
        x, y = (column + 0.5) * size, (row + 0.5) * size
        # Mostly the first are enough: the lists are short, and end far away.
        for found in self._index.growing(x, y, CANDIDATES, _NEARER):
            order, bounds = found
            ahead = self._ahead(order, x, y)
            if order.size == len(self._faces) or np.count_nonzero(ahead, axis=1).min() > LONGEST:
                break
        # What is not among the candidates is no nearer than the last of them.
        return order, bounds, ahead, math.inf if order.size == len(self._faces) else float(bounds[-1])

    def _ahead(self, order: Indices, x: float, y: float) -> Booleans:
        """Find which of some faces cones of each sector can meet from the square round a point."""
        # By hand, as products so small do not need BLAS, nor its threads.
        across_x, across_y = self._across_x.reshape(-1, 1), self._across_y.reshape(-1, 1)
        start = across_x * (self._start_x[order] - x) + across_y * (self._start_y[order] - y)
        end = across_x * (self._end_x[order] - x) + across_y * (self._end_y[order] - y)
        inside: Booleans = (
            (np.maximum(start, end) >= self._limit).reshape(-1, SECTORS, order.size).all(axis=0)
        )
        return inside

    def select(self, column: Indices, row: Indices) -> tuple[Indices, Floats, Booleans]:
        """Find what can be seen from squares.

        Parameters
        ----------
        column, row : array of int, shape (n,)
            Their lower left corners in half units.

        Returns
        -------
        faces : array of int, shape (n, faces)
            All faces, by ascending bound.
        bounds : array, shape (n, faces)
            Lower bounds of their distances from any point in the square.
        ahead : array of bool, shape (n, SECTORS, faces)
            Whether a cone can meet them; sector s begins at s times 45 degrees, counter-clockwise.
        """
        size = 1.0 / SQUARES_PER_UNIT
        centre = np.stack(((column + 0.5) * size, (row + 0.5) * size), axis=-1)[:, np.newaxis]
        start, end = self._start - centre, self._end - centre
        along = -(start * self._direction).sum(axis=-1)
        along = np.minimum(np.maximum(along, 0.0), self._length)[..., np.newaxis]
        nearest = start + along * self._direction
        bounds = np.hypot(nearest[..., 0], nearest[..., 1]) - (size * math.sqrt(0.5) + _MARGIN)
        order = np.argsort(bounds, axis=-1, kind="stable")
        start = np.take_along_axis(start, order[..., np.newaxis], axis=1)
        end = np.take_along_axis(end, order[..., np.newaxis], axis=1)
        ahead = np.ones((column.size, SECTORS, bounds.shape[-1]), np.bool_)
        for across_x, across_y in zip(self._across_x, self._across_y, strict=True):
            x, y = across_x[:, np.newaxis], across_y[:, np.newaxis]
            limit = -size / 2.0 * (np.abs(x) + np.abs(y)) - _MARGIN
            inside = x * start[:, np.newaxis, :, 0] + y * start[:, np.newaxis, :, 1] >= limit
            inside |= x * end[:, np.newaxis, :, 0] + y * end[:, np.newaxis, :, 1] >= limit
            ahead &= inside
        return order, np.take_along_axis(bounds, order, axis=1), ahead
