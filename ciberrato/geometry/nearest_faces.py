"""The faces around a place, nearest first: for questions about one point at a time.

numpy takes a microsecond to start on an array, however short; a loop over the few faces that matter is
faster. So the plane is divided into squares of one unit, and each square, when it is first asked about,
gets the list of all faces sorted by a lower bound of their distance from any point in it. A loop over the
list may stop as soon as the bound is beyond the best that it has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice

from ciberrato.arrays import Floats
from ciberrato.geometry.face_index import FaceIndex

Face = tuple[float, float, float, float, float, float, float, float, float]
"""Start x and y, end x and y, edge x and y (from start to end), length, direction x and y (unit vector)."""

_HALF_DIAGONAL = math.sqrt(0.5)
_MARGIN = 1e-9
_MAX_FACES = 256
_MAX_SQUARES = 8192


class NearbyFaces:
    """Faces sorted by distance for each square of the plane.

    Parameters
    ----------
    start, end, edge, direction : array, shape (faces, 2)
    length : array, shape (faces,)
        As in `ciberrato.geometry.walls.WallMap`.
    index : FaceIndex
        Of these faces.
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
        columns = (*start.T, *end.T, *edge.T, length, *direction.T)
        self._faces: list[Face] = list(zip(*(column.tolist() for column in columns), strict=True))
        self._squares: dict[tuple[int, int], tuple[list[float], list[Face], float]] = {}

    def around(self, x: float, y: float) -> tuple[list[float], list[Face], float]:
        """Return the faces around a point.

        Parameters
        ----------
        x, y : float
            Units.

        Returns
        -------
        bounds : list of float
            Lower bound of each face's distance, ascending.
        faces : list of Face
            In the same order.
        reach : float
            Bound of the nearest face that is not in the list; infinite if all are.
        """
        key = (math.floor(x), math.floor(y))
        square = self._squares.get(key)
        if square is None:
            if len(self._squares) >= _MAX_SQUARES:
                # Only who roams a very large lab comes here; the oldest squares are the ones left behind.
                for old in list(islice(self._squares, _MAX_SQUARES // 4)):
                    del self._squares[old]
            square = self._squares[key] = self._sort(*key)
        return square

    def nearest_first(self, x: float, y: float) -> Iterator[tuple[float, Face]]:
        """Yield all faces, in ascending order of the bounds.

        Parameters
        ----------
        x, y : float
            Units.

        Yields
        ------
        bound : float
            No face from here on is nearer.
        face : Face
        """
        bounds, faces, reach = self.around(x, y)
        yield from zip(bounds, faces, strict=True)
        if reach < math.inf:
            yield from ((reach, face) for face in self._faces)

    def any_within(self, x: float, y: float, radius: float) -> bool:
        """Return whether any face is nearer to a point than a radius.

        Parameters
        ----------
        x, y, radius : float
            Units.

        Returns
        -------
        bool
        """
        bounds, faces, reach = self.around(x, y)
        for bound, (x0, y0, x1, y1, _, _, length, ux, uy) in zip(bounds, faces, strict=True):
            if bound >= radius:
                return False
            # `ciberrato.geometry.walls.face_distances`, operation by operation.
            dx, dy = x - x0, y - y0
            along = dx * ux + dy * uy
            if along < 0.0:
                near = math.sqrt(dx * dx + dy * dy) < radius
            elif along > length:
                dx, dy = x - x1, y - y1
                near = math.sqrt(dx * dx + dy * dy) < radius
            else:
                near = -radius < dx * uy - dy * ux < radius
            if near:
                return True
        return reach < radius and any(_distance(x, y, face) < radius for face in self._faces)

    def _sort(self, column: int, row: int) -> tuple[list[float], list[Face], float]:
        slack = _HALF_DIAGONAL + _MARGIN
        order, found = self._index.nearest(column + 0.5, row + 0.5, _MAX_FACES + 1, slack)
        bounds = found.tolist()
        reach = bounds.pop() if len(bounds) > _MAX_FACES else math.inf
        return bounds, [self._faces[index] for index in order[:_MAX_FACES].tolist()], reach


def _distance(x: float, y: float, face: Face) -> float:
    """Compute the distance of a point to a face: `ciberrato.geometry.walls.face_distances`, step by step."""
    x0, y0, x1, y1, _, _, length, ux, uy = face
    dx, dy = x - x0, y - y0
    along = dx * ux + dy * uy
    if along < 0.0:
        return math.sqrt(dx * dx + dy * dy)
    if along > length:
        dx, dy = x - x1, y - y1
        return math.sqrt(dx * dx + dy * dy)
    return abs(dx * uy - dy * ux)
