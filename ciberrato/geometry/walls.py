"""The walls of a lab as arrays: distances, lines of sight, what lies inside.

A `WallMap` is built once per lab. A *face* is a side of a wall, a *corner* a vertex of one; the border of the
lab is a wall like the others. Lengths are in units, frame and origin are the lab's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Booleans, Floats
from ciberrato.geometry.face_index import FaceIndex
from ciberrato.geometry.nearest_faces import NearbyFaces
from ciberrato.geometry.visible_faces import ViewLists
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab, Wall

_BLOCK_ELEMENTS = 2**15
"""Points times faces worked on at once: arrays of 256 kB stay in the cache."""
_ROUNDING = 1e-12
"""Distance, as a fraction of a segment, of its end beyond a face that it still only touches."""
_GRAZE = 1e-9
"""Units."""
_FEW = 256
"""Points of which all are tested against a polygon: more are first held against its box."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WallMap:
    """The walls of a lab that count for one purpose; made by `from_lab`.

    Attributes
    ----------
    width, height : float
        Size of the lab.
    start, end : array, shape (faces, 2)
        Ends of each face; every corner of a wall is the start of one face and the end of another.
    edge : array, shape (faces, 2)
        From start to end.
    length : array, shape (faces,)
    direction : array, shape (faces, 2)
        Unit vector from start to end.
    polygons : tuple of array, shape (n, 2)
        Corners of every wall of the lab but the border, of any height: what the line sensor sees.
    """

    __repr__ = short_repr

    width: float
    height: float
    start: Floats
    end: Floats
    edge: Floats
    length: Floats
    direction: Floats
    polygons: tuple[Floats, ...]

    @classmethod
    def from_lab(cls, lab: Lab, *, at_least: float | None = None) -> WallMap:
        """Collect the walls that stop robots and reflect IR, or those that hide a beacon.

        Parameters
        ----------
        lab : Lab
        at_least : float or None
            Take walls of at least this height: those that hide a beacon of this height. None = walls higher
            than 0: those that stop robots and reflect IR.

        Returns
        -------
        WallMap
        """
        walls = [
            wall
            for wall in (lab.border, *lab.walls)
            if (wall.height > 0.0 if at_least is None else wall.height >= at_least)
        ]
        start, end = _faces(walls)
        edge = end - start
        length = np.sqrt(edge[:, 0] * edge[:, 0] + edge[:, 1] * edge[:, 1])
        return cls(
            width=lab.width,
            height=lab.height,
            start=start,
            end=end,
            edge=edge,
            length=length,
            direction=edge / length[:, np.newaxis],
            polygons=tuple(np.array(wall.corners) for wall in lab.walls),
        )

    @cached_property
    def _index(self) -> FaceIndex:
        return FaceIndex(self.start, self.end, self.direction, self.length)

    @cached_property
    def nearby(self) -> NearbyFaces:
        """The faces sorted by distance for each square unit: what makes one point at a time fast."""
        return NearbyFaces(self.start, self.end, self.edge, self.length, self.direction, self._index)

    @cached_property
    def views(self) -> ViewLists:
        """The faces that a view cone can meet: what makes one IR sensor at a time fast."""
        return ViewLists(self.start, self.end, self.edge, self.length, self.direction, self._index)

    def distance(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Compute the distances of points to the nearest face.

        Parameters
        ----------
        x, y : array_like, broadcastable
            Units.

        Returns
        -------
        array
            Shape as broadcast. At most the width of the lab, as in the real simulator. Only faces count:
            inside a wall it is the distance to the wall's faces too.
        """
        px, py = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        points = np.stack((px.reshape(-1), py.reshape(-1)))
        result = np.empty(px.size)
        step = max(1, _BLOCK_ELEMENTS // max(1, self.length.size))
        for low in range(0, px.size, step):
            block = points[:, low : low + step, np.newaxis]
            distances = face_distances(block[0], block[1], self.start, self.end, self.direction, self.length)
            result[low : low + step] = distances.min(axis=1, initial=self.width)
        return result.reshape(px.shape)

    def touches(self, x: float, y: float, radius: float) -> bool:
        """Return whether a disc overlaps a face. This is the collision rule, for one robot at a time.

        Parameters
        ----------
        x, y, radius : float
            Units.

        Returns
        -------
        bool
            Whether `distance` is less than the radius, to the last bit.
        """
        return radius > self.width or self.nearby.any_within(x, y, radius)

    def blocked(self, x0: ArrayLike, y0: ArrayLike, x1: ArrayLike, y1: ArrayLike) -> Booleans:
        """Return whether a wall stands between two points.

        Parameters
        ----------
        x0, y0, x1, y1 : array_like, broadcastable
            Ends of the lines of sight.

        Returns
        -------
        array of bool
            Shape as broadcast. A face that passes through the second point itself does not count; one that
            the line of sight merely touches before does.
        """
        ax, ay, bx, by = (
            array[..., np.newaxis]
            for array in np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (x0, y0, x1, y1)))
        )
        dx, dy = bx - ax, by - ay
        sx, sy = self.start[:, 0] - ax, self.start[:, 1] - ay
        ex, ey = self.end[:, 0] - ax, self.end[:, 1] - ay
        straddles = (dx * sy - dy * sx) * (dx * ey - dy * ex) <= 0.0
        slope = dx * self.edge[:, 1] - dy * self.edge[:, 0]
        # A face along the line of sight is met at a corner, where another face of its wall is met too.
        usable = straddles & (slope != 0.0)
        fraction = (sx * self.edge[:, 1] - sy * self.edge[:, 0]) / np.where(usable, slope, 1.0)
        return np.asarray((usable & (fraction >= 0.0) & (fraction < 1.0 - _ROUNDING)).any(axis=-1))

    def obstructs(
        self, x0: ArrayLike, y0: ArrayLike, x1: ArrayLike, y1: ArrayLike, radius: float
    ) -> Booleans:
        """Return whether a wall stops a disc that moves straight from one point to another.

        Parameters
        ----------
        x0, y0, x1, y1 : array_like, broadcastable
            The disc's centre at the start and at the end.
        radius : float
            Units.

        Returns
        -------
        array of bool
            Shape as broadcast. Grazing a wall, within rounding, is not being stopped.
        """
        ends = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (x0, y0, x1, y1)))
        ax, ay, bx, by = (array.reshape(-1, 1) for array in ends)
        near = (
            (np.minimum(self.start[:, 0], self.end[:, 0]) < np.maximum(ax, bx) + radius)
            & (np.maximum(self.start[:, 0], self.end[:, 0]) > np.minimum(ax, bx) - radius)
            & (np.minimum(self.start[:, 1], self.end[:, 1]) < np.maximum(ay, by) + radius)
            & (np.maximum(self.start[:, 1], self.end[:, 1]) > np.minimum(ay, by) - radius)
        )
        segment, face = np.nonzero(near)
        a = np.hstack((ax, ay))[segment]
        b = np.hstack((bx, by))[segment]
        c, d = self.start[face], self.end[face]
        distance = np.minimum(
            np.minimum(_point_segment(a, c, d), _point_segment(b, c, d)),
            np.minimum(_point_segment(c, a, b), _point_segment(d, a, b)),
        )
        crosses = (_cross(b - a, c - a) * _cross(b - a, d - a) < 0.0) & (
            _cross(d - c, a - c) * _cross(d - c, b - c) < 0.0
        )
        stopped = np.zeros(ax.size, np.bool_)
        stopped[segment[crosses | (distance < radius - _GRAZE)]] = True
        return stopped.reshape(ends[0].shape)

    def point_in_polygons(self, x: ArrayLike, y: ArrayLike) -> Booleans:
        """Return whether points lie inside a wall polygon of any height, without the border.

        Parameters
        ----------
        x, y : array_like, broadcastable
            Units.

        Returns
        -------
        array of bool
            Shape as broadcast; even-odd rule.
        """
        px, py = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        inside = np.zeros(px.shape, np.bool_)
        if px.size < _FEW:
            for polygon in self.polygons:
                inside |= _point_in_polygon(polygon, px, py)
            return inside
        for polygon in self.polygons:
            low, high = polygon.min(axis=0) - _GRAZE, polygon.max(axis=0) + _GRAZE
            near = (px >= low[0]) & (px <= high[0]) & (py >= low[1]) & (py <= high[1])
            inside[near] |= _point_in_polygon(polygon, px[near], py[near])
        return inside


def face_distances(
    x: Floats, y: Floats, start: Floats, end: Floats, direction: Floats, length: Floats
) -> Floats:
    """Compute the distances of points to faces, by the arithmetic of the real simulator.

    Parameters
    ----------
    x, y : array, shape (n, 1)
        Points.
    start, end, direction : array, shape (faces, 2)
    length : array, shape (faces,)
        As in `WallMap`.

    Returns
    -------
    array, shape (n, faces)
        Units.
    """
    dx, dy = x - start[:, 0], y - start[:, 1]
    ex, ey = x - end[:, 0], y - end[:, 1]
    ux, uy = direction[:, 0], direction[:, 1]
    along = dx * ux + dy * uy
    return np.where(
        along < 0.0,
        np.sqrt(dx * dx + dy * dy),
        np.where(along > length, np.sqrt(ex * ex + ey * ey), np.abs(dx * uy - dy * ux)),
    )


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _point_segment(point: Floats, start: Floats, end: Floats) -> Floats:
    """Compute the distances of points to segments, pair by pair; all of shape (n, 2)."""
    edge, offset = end - start, point - start
    squared = (edge * edge).sum(axis=1)
    along = np.clip((offset * edge).sum(axis=1) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    rest = offset - along[:, np.newaxis] * edge
    return np.asarray(np.hypot(rest[:, 0], rest[:, 1]))


def _point_in_polygon(polygon: Floats, x: Floats, y: Floats) -> Booleans:
    x0, y0 = polygon.T
    x1, y1 = np.roll(polygon, -1, axis=0).T
    px, py = x[..., np.newaxis], y[..., np.newaxis]
    straddles = (y0 > py) != (y1 > py)
    rise = np.where(y1 == y0, 1.0, y1 - y0)
    crosses = straddles & (px < x0 + (py - y0) * (x1 - x0) / rise)
    return np.asarray(np.count_nonzero(crosses, axis=-1) % 2 == 1)


def _faces(walls: list[Wall]) -> tuple[Floats, Floats]:
    """Return the sides of the walls, without those between two corners that are the same point."""
    faces = [
        (*corner, *following)
        for wall in walls
        for corner, following in zip(wall.corners, (*wall.corners[1:], wall.corners[0]), strict=True)
        if corner != following
    ]
    array = np.array(faces, dtype=np.float64).reshape(-1, 4)
    return array[:, :2].copy(), array[:, 2:].copy()
