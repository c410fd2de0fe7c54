"""Shortest paths of a disc between walls: straight lines from corner to corner, and arcs around them.

The centre of a disc of radius r stays r away from all walls, so a shortest path is a string pulled tight
around circles of radius r about the walls' convex corners: it consists of common tangents of such circles and
of arcs on them. Where the string touches a circle, the wall lies inside the bend; only the arc between the
normals of the two faces that meet in the corner can be touched. `DiscPaths` finds all tangents that are free,
`PathsFrom` the shortest path from one start to the end of each.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ciberrato.arrays import Booleans, Floats, Indices
from ciberrato.geometry.walls import WallMap, face_distances
from ciberrato.world.lab import Lab

_STEP = math.radians(3.0)
"""Arcs are looked at in steps of that; in between a wall may come 0.0002 nearer than it should."""
_ROUNDING = 1e-9
_SQUARE = 0.25
"""Units between the entries of the table of distances."""
_BLOCK = 64
"""Lines looked at closely at once."""
_BATCH = 16
"""Paths looked at at once, shortest first, where the first free one counts."""
_BLOCK_ELEMENTS = 2**18
"""Pairs of corners looked at at once."""


class _Tangent(NamedTuple):
    """A free straight line that ends on the circle of a corner.

    `touch` and `origin` name a circle and the side on which it is passed: 2 * corner, plus 1 where it is on
    the right. `offset` and `origin_offset` are angles on the arc of the corner, in the sense of the passage.
    """

    touch: int
    offset: float
    length: float
    origin: int
    origin_offset: float


@dataclass(frozen=True, slots=True)
class _Corners:
    """Convex corners of walls.

    Attributes
    ----------
    x, y : array, shape (n,)
    normal : array, shape (n,)
        Angle of the outward normal of the face that comes first; the wall is on the left of its faces.
    turn : array, shape (n,)
        Angle from there to the normal of the face that follows, counter-clockwise, less than π.
    """

    x: Floats
    y: Floats
    normal: Floats
    turn: Floats

    def __getitem__(self, which: Indices | Booleans) -> _Corners:
        return _Corners(self.x[which], self.y[which], self.normal[which], self.turn[which])


class DiscPaths:
    """All that shortest paths of a disc in a lab can be made of.

    Parameters
    ----------
    lab : Lab
        Walls of height 0 are no obstacles; the border is one.
    radius : float
        Units.
    """

    def __init__(self, lab: Lab, radius: float) -> None:
        self.radius = radius
        self.walls = WallMap.from_lab(lab)
        corners = _convex_corners(lab)
        blocked = self._blocked_samples(corners)
        open_somewhere = np.array([not samples.all() for samples in blocked], dtype=np.bool_)
        self._corners = corners[open_somewhere]
        # How many samples before the n-th are blocked: no more at the end of an arc than at its beginning.
        self._blocked_before = [
            np.concatenate(([0], np.cumsum(samples))).tolist()
            for samples, kept in zip(blocked, open_somewhere, strict=True)
            if kept
        ]
        self._near = self._near_squares(lab)
        self._leaving = self._all_tangents()

    def __deepcopy__(self, memo: dict[int, object]) -> DiscPaths:
        return self

    def paths_from(self, x: float, y: float) -> PathsFrom:
        """Find the shortest paths from a place to all corners."""
        return PathsFrom(self, x, y)

    def _near_squares(self, lab: Lab) -> Booleans:
        """Mark the entries of a table of points all of whose neighbourhood is too near to a wall."""
        columns, rows = (math.ceil(size / _SQUARE) + 1 for size in (lab.width, lab.height))
        x, y = _SQUARE * np.arange(columns), _SQUARE * np.arange(rows)
        near = np.zeros((rows, columns), np.bool_)
        reach = self.radius - _SQUARE * math.sqrt(0.5) - _ROUNDING
        walls = self.walls
        low, high = np.minimum(walls.start, walls.end) - reach, np.maximum(walls.start, walls.end) + reach
        left, right = np.searchsorted(x, low[:, 0]), np.searchsorted(x, high[:, 0], "right")
        bottom, top = np.searchsorted(y, low[:, 1]), np.searchsorted(y, high[:, 1], "right")
        for face, box in enumerate(zip(bottom, top, left, right, strict=True)):
            part = (slice(box[0], box[1]), slice(box[2], box[3]))
            px, py = (grid.reshape(-1, 1) for grid in np.meshgrid(x[part[1]], y[part[0]]))
            one = slice(face, face + 1)
            distances = face_distances(
                px, py, walls.start[one], walls.end[one], walls.direction[one], walls.length[one]
            )
            near[part] |= (distances < reach).reshape(near[part].shape)
        return near

    def _blocked_samples(self, corners: _Corners) -> list[Booleans]:
        """Return for each corner which points of its arc are too near to some wall."""
        blocked = []
        walls, reach = self.walls, 2.0 * self.radius
        for x, y, normal, turn in zip(corners.x, corners.y, corners.normal, corners.turn, strict=True):
            angles = normal + np.linspace(0.0, turn, _samples(turn))
            px = (x + self.radius * np.cos(angles))[:, np.newaxis]
            py = (y + self.radius * np.sin(angles))[:, np.newaxis]
            near = (np.minimum(walls.start, walls.end) <= (x + reach, y + reach)).all(axis=1)
            near &= (np.maximum(walls.start, walls.end) >= (x - reach, y - reach)).all(axis=1)
            distances = face_distances(
                px, py, walls.start[near], walls.end[near], walls.direction[near], walls.length[near]
            )
            blocked.append(distances.min(axis=1) < self.radius - 1e3 * _ROUNDING)
        return blocked

    def _all_tangents(self) -> list[list[_Tangent]]:
        """Compute free tangents between circles, by the circle and side that they leave."""
        n = self._corners.x.size
        leaving: list[list[_Tangent]] = [[] for _ in range(2 * n)]
        rows = max(1, _BLOCK_ELEMENTS // max(1, n))
        for low in range(0, n, rows):
            one, other = np.triu_indices(n - low, 1)
            one, other = one[one < rows] + low, other[one < rows] + low
            for side in (1.0, -1.0):
                for other_side in (1.0, -1.0):
                    self._add_tangents(leaving, one, side, other, other_side)
        return leaving

    def _add_tangents(
        self, leaving: list[list[_Tangent]], one: Indices, side: float, other: Indices, other_side: float
    ) -> None:
        """Add the free tangents between pairs of circles, passed on given sides: 1 left, -1 right."""
        corners = self._corners
        dx, dy = corners.x[other] - corners.x[one], corners.y[other] - corners.y[one]
        distance = np.hypot(dx, dy)
        # Circles that are passed on different sides: the tangent crosses the line of their centres.
        across = self.radius * (other_side - side)
        usable = np.flatnonzero(distance > max(abs(across), _ROUNDING))
        one, other = one[usable], other[usable]
        ux, uy, length = _along(dx[usable], dy[usable], distance[usable], across)
        begin, end = self._offsets(one, side, ux, uy), self._offsets(other, other_side, ux, uy)
        touching = np.flatnonzero(~(np.isnan(begin) | np.isnan(end)))
        one, other = one[touching], other[touching]
        ux, uy, length, begin, end = (array[touching] for array in (ux, uy, length, begin, end))
        x0 = corners.x[one] + side * self.radius * uy
        y0 = corners.y[one] - side * self.radius * ux
        free = self.free(x0, y0, x0 + length * ux, y0 + length * uy)
        turn_one, turn_other = corners.turn[one], corners.turn[other]
        for index in np.flatnonzero(free).tolist():
            circle = 2 * int(one[index]) + (side < 0.0)
            other_circle = 2 * int(other[index]) + (other_side < 0.0)
            far, start, at = float(length[index]), float(begin[index]), float(end[index])
            leaving[circle].append(_Tangent(other_circle, at, far, circle, start))
            # The same line the other way round passes both circles on the other side.
            start, at = float(turn_other[index]) - at, float(turn_one[index]) - start
            leaving[other_circle ^ 1].append(_Tangent(circle ^ 1, at, far, other_circle ^ 1, start))

    def free(self, x0: Floats, y0: Floats, x1: Floats, y1: Floats) -> Booleans:
        """Find straight lines that the disc can go along, among n of them."""
        free = ~self._crosses_near_wall(x0, y0, x1, y1)
        which = np.flatnonzero(free)
        for low in range(0, which.size, _BLOCK):
            some = which[low : low + _BLOCK]
            free[some] = ~self.walls.obstructs(x0[some], y0[some], x1[some], y1[some], self.radius)
        return free

    def _crosses_near_wall(self, x0: Floats, y0: Floats, x1: Floats, y1: Floats) -> Booleans:
        """Sort out most lines that are not free, by samples along them and a table of points."""
        near = np.zeros(x0.size, np.bool_)
        # Points on a line are no farther apart than squares, and the nearest entry is half a diagonal away.
        steps = np.hypot(x1 - x0, y1 - y0) / _SQUARE
        for fraction_of in range(1, math.ceil(float(steps.max(initial=0.0)))):
            which = np.flatnonzero(~near & (steps > fraction_of))
            share = fraction_of / steps[which]
            column = np.rint((x0[which] + share * (x1[which] - x0[which])) / _SQUARE).astype(np.intp)
            row = np.rint((y0[which] + share * (y1[which] - y0[which])) / _SQUARE).astype(np.intp)
            rows, columns = self._near.shape
            outside = (column < 0) | (column >= columns) | (row < 0) | (row >= rows)
            near[which] = outside | self._near[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
        return near

    def tangents_from(self, x: float, y: float) -> list[tuple[_Tangent, tuple[float, float]]]:
        """List tangents from a point to circles, free or not, with the points where they touch."""
        corners, found = self._corners, []
        dx, dy = corners.x - x, corners.y - y
        distance = np.hypot(dx, dy)
        for side in (1.0, -1.0):
            across = self.radius * side
            which = np.flatnonzero(distance >= self.radius - 1e3 * _ROUNDING)
            ux, uy, length = _along(dx[which], dy[which], distance[which], across)
            offset = self._offsets(which, side, ux, uy)
            for index in np.flatnonzero(~np.isnan(offset)).tolist():
                far, across_x, across_y = float(length[index]), float(ux[index]), float(uy[index])
                tangent = _Tangent(2 * int(which[index]) + (side < 0.0), float(offset[index]), far, -1, 0.0)
                found.append((tangent, (x + far * across_x, y + far * across_y)))
        return found

    def leaving(self, circle: int) -> list[_Tangent]:
        """List the free tangents that leave a circle on a side."""
        return self._leaving[circle]

    def turn(self, circle: int) -> float:
        """Return the length of the arc of a circle that can be touched, in radians."""
        return float(self._corners.turn[circle // 2])

    def arc_is_free(self, circle: int, begin: float, end: float) -> bool:
        """Return whether the disc can go along the arc of a corner, between two offsets."""
        corner = circle // 2
        turn = float(self._corners.turn[corner])
        if circle % 2:
            begin, end = turn - end, turn - begin
        last = _samples(turn) - 1
        low = math.ceil(begin / turn * last - _ROUNDING)
        high = math.floor(end / turn * last + _ROUNDING)
        before = self._blocked_before[corner]
        low, high = max(low, 0), min(high, last)
        return high < low or before[high + 1] == before[low]

    def _offsets(self, which: Indices, side: float, ux: Floats, uy: Floats) -> Floats:
        """Compute where on their arcs tangents of direction u touch circles; nan where they do not."""
        corners = self._corners
        touch = np.arctan2(-side * ux, side * uy)
        ahead = np.mod(touch - corners.normal[which] + math.pi / 2, 2 * math.pi) - math.pi / 2
        turn = corners.turn[which]
        on_arc = (ahead >= -_ROUNDING) & (ahead <= turn + _ROUNDING)
        offset = np.clip(ahead if side > 0.0 else turn - ahead, 0.0, turn)
        return np.asarray(np.where(on_arc, offset, np.nan))


@lru_cache(maxsize=8)
def disc_paths(lab: Lab, radius: float) -> DiscPaths:
    """Return the `DiscPaths` of a lab, created at the first call."""
    return DiscPaths(lab, radius)


class PathsFrom:
    """Shortest paths from one place; made by `DiscPaths.paths_from`."""

    def __init__(self, paths: DiscPaths, x: float, y: float) -> None:
        self._paths = paths
        self._start = (x, y)
        # For each circle and side: where paths end on it, and how long they are.
        self._ends: dict[int, list[tuple[float, float]]] = {}
        candidates = paths.tangents_from(x, y)
        free = _free(paths, x, y, [point for _, point in candidates])
        waiting = [
            (tangent.length, tangent)
            for (tangent, _), is_free in zip(candidates, free, strict=True)
            if is_free
        ]
        heapq.heapify(waiting)
        done: set[_Tangent] = set()
        while waiting:
            length, tangent = heapq.heappop(waiting)
            if tangent in done:
                continue
            done.add(tangent)
            self._ends.setdefault(tangent.touch, []).append((tangent.offset, length))
            for onward in paths.leaving(tangent.touch):
                if onward not in done and self._joins(tangent, onward):
                    arc = paths.radius * (onward.origin_offset - tangent.offset)
                    heapq.heappush(waiting, (length + arc + onward.length, onward))

    def __deepcopy__(self, memo: dict[int, object]) -> PathsFrom:
        return self

    def _joins(self, tangent: _Tangent, onward: _Tangent) -> bool:
        begin, end = tangent.offset, onward.origin_offset
        return end >= begin - _ROUNDING and self._paths.arc_is_free(tangent.touch, begin, end)

    def length_to(self, x: float, y: float) -> float:
        """Compute the length of the shortest path from the start to a place.

        Parameters
        ----------
        x, y : float
            Units.

        Returns
        -------
        float
            Units; infinite if there is no path.
        """
        if _free(self._paths, *self._start, [(x, y)])[0]:
            return math.hypot(x - self._start[0], y - self._start[1])
        paths = []
        for tangent, point in self._paths.tangents_from(x, y):
            # Seen from the end, the circle is passed on the other side, and its arc the other way round.
            circle = tangent.touch ^ 1
            offset = self._paths.turn(circle) - tangent.offset
            reached = [
                length + self._paths.radius * (offset - begin)
                for begin, length in self._ends.get(circle, ())
                if offset >= begin - _ROUNDING and self._paths.arc_is_free(circle, begin, offset)
            ]
            if reached:
                paths.append((min(reached) + tangent.length, point))
        paths.sort()
        for low in range(0, len(paths), _BATCH):
            some = paths[low : low + _BATCH]
            free = _free(self._paths, x, y, [point for _, point in some])
            if free.any():
                return some[int(free.argmax())][0]
        return math.inf


def _free(paths: DiscPaths, x: float, y: float, points: list[tuple[float, float]]) -> Booleans:
    ends = np.array(points, dtype=np.float64).reshape(-1, 2)
    return ~paths.walls.obstructs(x, y, ends[:, 0], ends[:, 1], paths.radius)


def _samples(turn: float) -> int:
    return 2 + math.ceil(turn / _STEP)


def _along(dx: Floats, dy: Floats, distance: Floats, across: float) -> tuple[Floats, Floats, Floats]:
    """Compute direction and length of the lines that pass a point at a distance.

    Parameters
    ----------
    dx, dy, distance : array, shape (n,)
        Offsets of the points, and their distances.
    across : float
        Distance of the points to the left of the lines; negative to the right.

    Returns
    -------
    ux, uy, length : array, shape (n,)
    """
    length = np.sqrt(np.maximum(distance * distance - across * across, 0.0))
    squared = distance * distance
    # The point lies `length` ahead and `across` to the left.
    return (dx * length + dy * across) / squared, (dy * length - dx * across) / squared, length


def _convex_corners(lab: Lab) -> _Corners:
    found = []
    for wall in lab.walls:
        if wall.height <= 0.0:
            continue
        corners = [corner for corner, following in _pairs(wall.corners) if corner != following]
        if sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in _pairs(tuple(corners))) < 0.0:
            corners.reverse()  # the walls that a backslash draws are clockwise
        for index, (x, y) in enumerate(corners):
            before, after = corners[index - 1], corners[(index + 1) % len(corners)]
            ax, ay, bx, by = x - before[0], y - before[1], after[0] - x, after[1] - y
            turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
            if turn > _ROUNDING:
                found.append((x, y, math.atan2(-ax, ay), turn))
    return _Corners(*np.array(found, dtype=np.float64).reshape(-1, 4).T)


def _pairs(corners: tuple[tuple[float, float], ...]) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(zip(corners, (*corners[1:], *corners[:1]), strict=True))
