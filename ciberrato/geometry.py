"""The walls of a lab as arrays: distances, lines of sight, what lies inside.

A `WallMap` is built once per lab. A *face* is a side of a wall, a *corner* a vertex of one; the border of
the lab is a wall like the others. Lengths are in units, frame and origin are the lab's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.lab import Lab, Wall

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WallMap:
    """The walls of a lab that count for one purpose; made by `from_lab`.

    Attributes
    ----------
    width, height : float
        Size of the lab.
    start, end : array, shape (faces, 2)
        Ends of each face.
    direction : array, shape (faces, 2)
        Unit vector from start to end.
    length : array, shape (faces,)
    corners : array, shape (corners, 2)
        Corners of the walls, each once.
    polygons : tuple of array, shape (n, 2)
        Corners of every wall of the lab but the border, of any height: what the line sensor sees.
    """

    width: float
    height: float
    start: Floats
    end: Floats
    direction: Floats
    length: Floats
    corners: Floats
    polygons: tuple[Floats, ...]

    @classmethod
    def from_lab(cls, lab: Lab, *, at_least: float | None = None) -> WallMap:
        """Collect the walls that stop robots and reflect IR, or those that hide a beacon.

        Parameters
        ----------
        lab : Lab
        at_least : float or None
            Take walls of at least this height, which is what hides a beacon of this height; None = walls
            higher than 0.

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
            direction=edge / length[:, np.newaxis],
            length=length,
            corners=np.unique(start, axis=0),
            polygons=tuple(np.array(wall.corners) for wall in lab.walls),
        )

    def distance(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Distance of points to the nearest face.

        Parameters
        ----------
        x, y : array_like, broadcastable
            Units.

        Returns
        -------
        array
            Shape as broadcast. At most the width of the lab, as the real simulator has it. Only faces
            count: inside a wall it is the distance to the wall's faces too.
        """
        px, py = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        dx = px[..., np.newaxis] - self.start[:, 0]
        dy = py[..., np.newaxis] - self.start[:, 1]
        ux, uy = self.direction.T
        along = dx * ux + dy * uy
        ex = px[..., np.newaxis] - self.end[:, 0]
        ey = py[..., np.newaxis] - self.end[:, 1]
        distances = np.where(
            along < 0.0,
            np.sqrt(dx * dx + dy * dy),
            np.where(along > self.length, np.sqrt(ex * ex + ey * ey), np.abs(dx * uy - dy * ux)),
        )
        return np.asarray(np.minimum(distances.min(axis=-1, initial=self.width), self.width))

    def touches(self, x: float, y: float, radius: float) -> bool:
        """Whether a disc overlaps a face.

        Parameters
        ----------
        x, y, radius : float
            Units.

        Returns
        -------
        bool
            Whether the distance is less than the radius.
        """
        return bool(self.distance(x, y) < radius)

    def blocked(self, x0: ArrayLike, y0: ArrayLike, x1: ArrayLike, y1: ArrayLike) -> Booleans:
        """Whether a straight segment meets a wall.

        Parameters
        ----------
        x0, y0, x1, y1 : array_like, broadcastable
            Ends of the segments.

        Returns
        -------
        array of bool
            Shape as broadcast. Touching a face counts as meeting it; lying inside a wall without touching a
            face does not.
        """
        ax, ay, bx, by = (
            array[..., np.newaxis]
            for array in np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (x0, y0, x1, y1)))
        )
        cx, cy = self.start.T
        dx, dy = self.end.T
        a_side = _cross(cx, cy, dx, dy, ax, ay)
        b_side = _cross(cx, cy, dx, dy, bx, by)
        c_side = _cross(ax, ay, bx, by, cx, cy)
        d_side = _cross(ax, ay, bx, by, dx, dy)
        apart = (
            (np.maximum(ax, bx) < np.minimum(cx, dx))
            | (np.maximum(cx, dx) < np.minimum(ax, bx))
            | (np.maximum(ay, by) < np.minimum(cy, dy))
            | (np.maximum(cy, dy) < np.minimum(ay, by))
        )
        meets = (a_side * b_side <= 0.0) & (c_side * d_side <= 0.0) & ~apart
        return np.asarray(meets.any(axis=-1))

    def clearance(self, x0: ArrayLike, y0: ArrayLike, x1: ArrayLike, y1: ArrayLike) -> Floats:
        """Distance from the nearest face to a straight segment.

        Parameters
        ----------
        x0, y0, x1, y1 : array_like, broadcastable
            Ends of the segments.

        Returns
        -------
        array
            Units, shape as broadcast; 0 where the segment meets a face. A disc of a smaller radius can roll
            along the segment.
        """
        ax, ay, bx, by = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (x0, y0, x1, y1)))
        ends = np.minimum(self.distance(ax, ay), self.distance(bx, by))
        ex, ey = (bx - ax)[..., np.newaxis], (by - ay)[..., np.newaxis]
        dx = self.corners[:, 0] - ax[..., np.newaxis]
        dy = self.corners[:, 1] - ay[..., np.newaxis]
        squared = ex * ex + ey * ey
        along = np.clip((dx * ex + dy * ey) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
        corners = np.hypot(dx - along * ex, dy - along * ey).min(axis=-1, initial=np.inf)
        return np.asarray(np.where(self.blocked(ax, ay, bx, by), 0.0, np.minimum(ends, corners)))

    def inside_polygons(self, x: ArrayLike, y: ArrayLike) -> Booleans:
        """Whether points lie inside any wall polygon of the lab, whatever its height, the border excluded.

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
        for polygon in self.polygons:
            inside |= point_in_polygon(polygon, px, py)
        return inside


def point_in_polygon(polygon: Floats, x: Floats, y: Floats) -> Booleans:
    """Whether points lie inside a polygon, by the even-odd rule.

    Parameters
    ----------
    polygon : array, shape (n, 2)
        Corners in order.
    x, y : array
        Points, of one shape.

    Returns
    -------
    array of bool, shape of x
    """
    x0, y0 = polygon.T
    x1, y1 = np.roll(polygon, -1, axis=0).T
    px, py = x[..., np.newaxis], y[..., np.newaxis]
    straddles = (y0 > py) != (y1 > py)
    rise = np.where(y1 == y0, 1.0, y1 - y0)
    crosses = straddles & (px < x0 + (py - y0) * (x1 - x0) / rise)
    return np.asarray(np.count_nonzero(crosses, axis=-1) % 2 == 1)


def _faces(walls: list[Wall]) -> tuple[Floats, Floats]:
    faces = [
        (*corner, *following)
        for wall in walls
        for corner, following in zip(wall.corners, (*wall.corners[1:], wall.corners[0]), strict=True)
        if corner != following
    ]
    array = np.array(faces, dtype=np.float64).reshape(-1, 4)
    return array[:, :2].copy(), array[:, 2:].copy()


def _cross(ax: Floats, ay: Floats, bx: Floats, by: Floats, px: Floats, py: Floats) -> Floats:
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)
