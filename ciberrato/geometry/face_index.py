"""The faces nearest to a point, without looking at all of them.

The plane is divided into square tiles, and each face is listed in all tiles that the box around it meets;
faces that would be listed in very many are looked at for every point instead. A face that is in no tile of a
block of tiles is farther away than the block's border. So the block grows until as many faces as are asked
for are nearer than that: then they are the nearest of all, and what is found is what a look at all faces
finds, to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ciberrato.arrays import Floats, Indices, Integers

_FEW = 16384
"""Faces of which all are looked at: that takes no longer."""
_IN_A_TILE = 16
"""Faces that a tile has on an average."""
_MOST_TILES = 64
"""Tiles that a face is listed in at most."""
_MARGIN = 1e-6
"""Units, far above rounding errors."""


class FaceIndex:
    """Faces by tiles.

    Parameters
    ----------
    start, end, direction : array, shape (faces, 2)
    length : array, shape (faces,)
        As in `ciberrato.geometry.walls.WallMap`.
    """

    def __init__(self, start: Floats, end: Floats, direction: Floats, length: Floats) -> None:
        # Each in one piece: few points are looked at at a time, and small steps count.
        self._start_x, self._start_y = np.ascontiguousarray(start.T)
        self._direction_x, self._direction_y = np.ascontiguousarray(direction.T)
        self._length = length
        self._tiled = length.size > _FEW
        if self._tiled:
            self._list(np.minimum(start, end), np.maximum(start, end))

    def _list(self, low: Floats, high: Floats) -> None:
        """List the faces, given the corners of the boxes around them, by tiles."""
        self._origin = low.min(axis=0)
        width, height = high.max(axis=0) - self._origin
        tiles = self._length.size / _IN_A_TILE
        self._size = max(math.sqrt(width * height / tiles), width / tiles, height / tiles, _MARGIN)
        first = np.floor((low - self._origin) / self._size).astype(np.int64)
        last = np.floor((high - self._origin) / self._size).astype(np.int64)
        self._columns, self._rows = (int(number) + 1 for number in last.max(axis=0))
        across, up = (last - first + 1).T
        many = across * up
        self._everywhere = np.flatnonzero(many > _MOST_TILES)
        listed = np.flatnonzero(many <= _MOST_TILES)
        faces = np.repeat(listed, many[listed])
        step = np.arange(faces.size) - np.repeat(np.cumsum(many[listed]) - many[listed], many[listed])
        column, row = first[faces, 0] + step % across[faces], first[faces, 1] + step // across[faces]
        tile = row * self._columns + column
        order = np.argsort(tile, kind="stable")
        self._listed = faces[order]
        self._begin = np.searchsorted(tile[order], np.arange(self._columns * self._rows + 1))

    def nearest(self, x: float, y: float, count: int, slack: float) -> tuple[Indices, Floats]:
        """Find the faces nearest to a point.

        Parameters
        ----------
        x, y : float
            Units.
        count : int
            Number of faces.
        slack : float
            Units that a point of interest around this one may be nearer to a face.

        Returns
        -------
        faces : array of int, shape (min(count, faces),)
            Their numbers by ascending bound; those with the same in ascending order, but the last ones, of
            which it may be any.
        bounds : array, of the same shape
            Lower bounds of distances: those from the point, less the slack; units.
        """
        if not self._tiled:
            return next(self.growing(x, y, (count,), slack))
        # So many rings around the middle tile, and a circle of that radius has about as many as asked for.
        rings = math.ceil(math.sqrt(count / (math.pi * _IN_A_TILE)))
        while True:
            faces, within = self._around(x, y, rings)
            if faces.size < count and within < math.inf:  # as near the border
                rings += rings // 2 + 1
                continue
            bounds = self._distances(x, y, faces) - slack
            order = least(bounds, count)
            bounds = bounds[order]
            if within == math.inf or (order.size == count and bounds[-1] < within - slack):
                return faces[order], bounds
            rings += rings // 2 + 1

    def growing(
        self, x: float, y: float, counts: Sequence[int], slack: float
    ) -> Iterator[tuple[Indices, Floats]]:
        """Yield what `nearest` returns for each of some numbers of faces.

        Distances are computed once where all faces are looked at.
        """
        if self._tiled:
            for count in counts:
                yield self.nearest(x, y, count, slack)
            return
        bounds = self._distances(x, y, slice(None)) - slack
        for count in counts:
            order = least(bounds, count)
            yield order, bounds[order]

    def _around(self, x: float, y: float, rings: int) -> tuple[Integers, float]:
        """Return the faces of a block of tiles, and the distance within which there are no others."""
        column = math.floor((x - self._origin[0]) / self._size)
        row = math.floor((y - self._origin[1]) / self._size)
        left, right = max(column - rings, 0), min(column + rings + 1, self._columns)
        bottom, top = max(row - rings, 0), min(row + rings + 1, self._rows)
        if left == 0 and bottom == 0 and right == self._columns and top == self._rows:
            return np.arange(self._length.size), math.inf
        parts = [self._everywhere]
        if left < right:
            for line in range(bottom, top):
                low, high = line * self._columns + left, line * self._columns + right
                parts.append(self._listed[self._begin[low] : self._begin[high]])
        # The middle tile, with the point in it, is none of the rings.
        faces = np.concatenate(parts)
        faces.sort()
        fresh = np.ones(faces.size, np.bool_)  # as np.unique does, in half the time
        np.not_equal(faces[1:], faces[:-1], out=fresh[1:])
        return faces[fresh], rings * self._size - _MARGIN

    def _distances(self, x: float, y: float, faces: Integers | slice) -> Floats:
        dx, dy = x - self._start_x[faces], y - self._start_y[faces]
        ux, uy = self._direction_x[faces], self._direction_y[faces]
        along = np.minimum(np.maximum(dx * ux + dy * uy, 0.0), self._length[faces])
        return np.asarray(np.hypot(dx - along * ux, dy - along * uy))


def least(values: Floats, count: int) -> Indices:
    """Return the indices of the least values in ascending order, equal ones as they stand.

    Parameters
    ----------
    values : array, shape (n,)
    count : int
        Most indices.

    Returns
    -------
    array of int, shape (min(count, n),)
        Without sorting all values.
    """
    if count >= values.size:
        return np.argsort(values, kind="stable")
    chosen = np.sort(np.argpartition(values, count)[:count])
    ordered: Indices = chosen[np.argsort(values[chosen], kind="stable")]
    return ordered
