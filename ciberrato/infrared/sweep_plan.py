"""Preparations of `ciberrato.infrared.sweep`: faces turned into every direction, and the view from a tile.

With the axes turned along a ray of direction phi, *ahead* is the coordinate along it, *aside* the one to its
left. A sensor sits half a unit ahead of the robot's centre; its left ray has the direction phi when its own
axis is at phi - 30 degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.geometry.tiles import box_corners, box_distances, point_box_distances
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import HALF_APERTURE, SENSOR_OFFSET
from ciberrato.reprs import short_repr

TOUCH = 1e-9
"""Units by which a ray may miss a face's end, or a sensor be behind a face, and still see it."""
SIDE = SENSOR_OFFSET * math.sin(HALF_APERTURE)
"""Units between the line of an edge ray and the robot's centre."""

NEAR = SENSOR_OFFSET + 1e-4
"""Units; within them a sensor may touch a face."""
INSIDE = 1e-3
"""Units; a box nearer to a face is taken to meet it."""
SLACK = 1e-6
"""Steps added to both ends of a run of directions."""
_KEPT = 4096
"""Faces of which the turned ends are kept."""
_ELEMENTS = 2**17
"""Tiles times faces planned at once."""

ALONG = SENSOR_OFFSET * np.array([1.0, math.cos(HALF_APERTURE), math.cos(HALF_APERTURE)])
ASIDE = np.array([0.0, -SIDE, SIDE])
"""Place of the sensor whose axis, left ray or right ray has a direction: ahead, and aside."""


def along(units: Floats, points: Floats) -> Floats:
    """Return the coordinates of points along unit vectors: products of pairs, summed up.

    Written out, as a matrix product's last bit depends on how many points are computed at once.

    Parameters
    ----------
    units : array, shape (n, 2)
    points : array, shape (2,) or (m, 2)

    Returns
    -------
    array, shape (n,) or (n, m)
    """
    x, y = points.T
    first, second = np.multiply.outer(units[:, 0], x), np.multiply.outer(units[:, 1], y)
    return np.asarray(np.add(first, second, out=first))


FaceColumns = tuple[Floats, Floats, Floats, Floats]
CornerColumns = tuple[Floats, Floats, Floats]


class Directions:
    """Walls seen in evenly spaced directions.

    Parameters
    ----------
    walls : WallMap
    first : float
        Radians.
    count : int
        A multiple of 12.

    Attributes
    ----------
    step : float
        Radians between directions.
    ahead, aside : array, shape (count, 2)
        Unit vectors along each direction and to its left.
    corners : array, shape (corners, 2)
        Corners of walls, each once.
    normal, offset : array, shape (faces, 2) and (faces,)
        Unit vector to the left of each face, and where its line is along that.
    """

    def __init__(self, walls: WallMap, first: float, count: int) -> None:
        if count % 12:
            raise ValueError(f"count: {count} is not a multiple of 12")
        self.walls, self.first, self.count = walls, first, count
        self.step = 2.0 * math.pi / count
        angles = first + self.step * np.arange(count)
        self.ahead = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self.aside = np.stack([-self.ahead[:, 1], self.ahead[:, 0]], axis=1)
        self.corners = np.unique(walls.start, axis=0)
        self.normal = np.stack([-walls.direction[:, 1], walls.direction[:, 0]], axis=1)
        self.offset = (walls.start * self.normal).sum(axis=1)
        self._faces: dict[int, FaceColumns] = {}
        self._corners: dict[int, CornerColumns] = {}

    def offsets(self, faces: Integers, places: Floats) -> Floats:
        """Return by how much the line of each face is to the left of each place, seen along it."""
        return np.asarray(self.offset[faces, np.newaxis] - along(self.normal[faces], places))

    def face(self, face: int) -> FaceColumns:
        """Return what a ray's distance to a face depends on, for all directions.

        Parameters
        ----------
        face : int

        Returns
        -------
        rate : array, shape (count, 1)
            Distance along the ray from the centre for a unit of offset.
        lead : array, shape (3, count, 1)
            By how much the sensor is ahead of that, for the axis, left and right ray.
        low, high : array, shape (3, count, 1)
            Bounds of the centre's place aside if the ray passes between the face's ends; none if edge-on.
        """
        known = self._faces.get(face)
        if known is None:
            if len(self._faces) >= _KEPT:
                self._faces.clear()
            known = self._faces[face] = self._turn_face(face)
        return known

    def _turn_face(self, face: int) -> FaceColumns:
        walls = self.walls
        start, end = along(self.aside, walls.start[face]), along(self.aside, walls.end[face])
        edge_on = np.abs(end - start) <= TOUCH * walls.length[face]
        slope = along(self.ahead, self.normal[face])
        rate = np.where(edge_on, 0.0, 1.0 / np.where(edge_on, 1.0, slope))
        lead = ALONG[:, np.newaxis] + ASIDE[:, np.newaxis] * (along(self.aside, self.normal[face]) * rate)
        low = np.where(edge_on, np.inf, np.minimum(start, end) - TOUCH) - ASIDE[:, np.newaxis]
        high = np.maximum(start, end) + TOUCH - ASIDE[:, np.newaxis]
        return rate[:, np.newaxis], lead[..., np.newaxis], low[..., np.newaxis], high[..., np.newaxis]

    def corner(self, corner: int) -> CornerColumns:
        """Return where a corner is, for all directions; shape (count, 1) each.

        Parameters
        ----------
        corner : int

        Returns
        -------
        ahead : array
            Along the direction.
        left, right : array
            Least and greatest place aside, seen along the cone's left and right edge, of a centre whose
            sensor has the corner inside that edge.
        """
        known = self._corners.get(corner)
        if known is None:
            if len(self._corners) >= _KEPT:
                self._corners.clear()
            shift, touch = self.count // 12, TOUCH * math.cos(HALF_APERTURE)
            aside = along(self.aside, self.corners[corner])
            known = self._corners[corner] = (
                along(self.ahead, self.corners[corner])[:, np.newaxis],
                (np.roll(aside, -shift) + SIDE - touch)[:, np.newaxis],
                (np.roll(aside, shift) - SIDE + touch)[:, np.newaxis],
            )
        return known


@dataclass(frozen=True, slots=True, eq=False)
class TilePlan:
    """The view from the places of a tile, by face and by corner.

    Attributes
    ----------
    distance, corner_distance : array
        Units from the box around the places.
    first, number, corner_first, corner_number : array of int
        Run of directions of the rays that may meet a face, of the axes whose cone may hold a corner.
    near : array of bool
        Whether rays may meet the face's line behind the sensor.
    touchable : array of bool
        Whether a robot may touch the face.
    hidden, hidden_apart : array of bool
        Whether the face is a far side of a convex wall, of any; of one that no robot touches.
    """

    __repr__ = short_repr

    distance: Floats
    first: Integers
    number: Integers
    near: Booleans
    touchable: Booleans
    hidden: Booleans
    hidden_apart: Booleans
    corner_distance: Floats
    corner_first: Integers
    corner_number: Integers

    def faces(self, stick_out: bool) -> Integers:
        """Return the faces to paint, nearest first; `stick_out`: sensors may be inside walls touched."""
        order = np.argsort(self.distance, kind="stable")
        return order[~(self.hidden_apart if stick_out else self.hidden)[order]]

    def faces_within(self, faces: Integers, farthest: Floats) -> Integers:
        """Return those of some faces that may be nearer than the farthest ray in each direction."""
        faces = faces[self.distance[faces] - SENSOR_OFFSET <= farthest.max()]
        reach = _greatest(farthest, self.first[faces], self.number[faces])
        return faces[self.distance[faces] - SENSOR_OFFSET <= reach]

    def corners_within(self, farthest: Floats) -> Integers:
        """Return the corners that may be nearer than the farthest distance in each direction."""
        reach = _greatest(farthest, self.corner_first, self.corner_number)
        return np.flatnonzero(self.corner_distance - SENSOR_OFFSET <= reach)

    def runs(self, faces: Integers) -> Integers:
        """Return numbers, first directions, numbers of directions and nearness of faces; shape (faces, 4)."""
        columns = (faces, self.first[faces], self.number[faces], self.near[faces])
        return np.stack(columns, axis=1).astype(np.int64)

    def corner_runs(self, corners: Integers) -> Integers:
        """Return numbers, first directions and numbers of directions of corners; shape (corners, 3)."""
        return np.stack((corners, self.corner_first[corners], self.corner_number[corners]), axis=1)


class SweepPlan:
    """Plans of tiles.

    Parameters
    ----------
    directions : Directions
    """

    def __init__(self, directions: Directions) -> None:
        self._directions = directions
        self._loops = _loops(directions.walls)
        self._outward = _outward(directions, self._loops)
        self.at_once = max(_ELEMENTS // max(len(directions.walls.length), 1), 1)
        """Number of tiles that are planned together without much memory."""

    def arrays(self) -> tuple[tuple[NDArray[Any], ...], Floats, Floats, float]:
        """Return what machine code makes its plans of: the faces, the corners, the directions, the first."""
        directions, walls = self._directions, self._directions.walls
        wall = np.zeros(len(walls.length), np.int64)
        wall[self._loops[1:]] = 1
        lines = (walls.start, walls.end, walls.direction, walls.length, directions.normal, directions.offset)
        faces = tuple(map(np.ascontiguousarray, (*lines, self._outward, np.cumsum(wall))))
        units = np.stack([directions.ahead, directions.aside])
        return faces, directions.corners, units, directions.first

    def tiles(self, low: Floats, high: Floats) -> list[TilePlan]:
        """Return the plans of tiles.

        Parameters
        ----------
        low, high : array, shape (tiles, 2)
            Corners of the least boxes around their places.

        Returns
        -------
        list of TilePlan
        """
        directions, walls = self._directions, self._directions.walls
        distance = box_distances(low, high, walls)
        begin, end = _bearings(low, high, np.stack([walls.start, walls.end], axis=1))
        # The centre is up to SIDE beside the line of a ray.
        turn = np.arcsin(np.minimum(SIDE / np.maximum(distance, SIDE), 1.0))
        meets = (distance < INSIDE) | (end - begin + 2.0 * turn >= math.pi)
        first, number = self._runs(begin - turn, end + turn, meets)
        touchable = distance < NEAR
        hidden, hidden_apart = self._hidden(low, high, touchable)
        corner_distance = point_box_distances(low, high, directions.corners)
        begin, end = _bearings(low, high, directions.corners[:, np.newaxis])
        cone = self._runs(begin - HALF_APERTURE, end + HALF_APERTURE, corner_distance < INSIDE)
        faces = (distance, first, number, meets | touchable, touchable, hidden, hidden_apart)
        return [TilePlan(*row) for row in zip(*faces, corner_distance, *cone, strict=True)]

    def _runs(self, begin: Floats, end: Floats, everywhere: Booleans) -> tuple[Integers, Integers]:
        """Return first directions and numbers of directions between angles."""
        count, first, step = self._directions.count, self._directions.first, self._directions.step
        low = np.floor((begin - first) / step - SLACK).astype(np.int64)
        number = np.ceil((end - first) / step + SLACK).astype(np.int64) + 1 - low
        everywhere = everywhere | (number >= count)
        return np.where(everywhere, 0, low % count), np.where(everywhere, count, number)

    def _hidden(self, low: Floats, high: Floats, touchable: Booleans) -> tuple[Booleans, Booleans]:
        """Return which faces are far sides of convex walls, seen from anywhere in a box."""
        walls, normal = self._directions.walls, self._directions.normal
        offset = (walls.start * normal).sum(axis=1)
        sides = (box_corners(low, high) @ normal.T - offset) * self._outward
        starts = self._loops
        outside = np.logical_or.reduceat(sides.min(axis=0) > 0.0, starts, axis=1)
        touched = np.logical_or.reduceat(touchable, starts, axis=1)
        lengths = np.diff(np.append(starts, len(walls.length)))
        # A sensor may be half a unit nearer to the outer side than the centre is.
        hidden = (sides.max(axis=0) < -NEAR) & np.repeat(outside, lengths, axis=1)
        return hidden, hidden & ~np.repeat(touched, lengths, axis=1)


def _loops(walls: WallMap) -> Integers:
    """Return the first face of each wall."""
    joined = (walls.end[:-1] == walls.start[1:]).all(axis=1)
    starts, begin = [0], 0
    closed = False
    for face in range(len(walls.length)):
        if face and (closed or not joined[face - 1]):
            starts.append(face)
            begin = face
        closed = bool((walls.end[face] == walls.start[begin]).all())
    return np.array(starts, np.int64)


def _outward(directions: Directions, loops: Integers) -> Floats:
    """Return 1 for faces of convex walls with the outer side at their left, -1 at their right, else 0."""
    walls = directions.walls
    outward = np.zeros(len(walls.length))
    for begin, end in zip(loops, [*loops[1:], len(walls.length)], strict=True):
        along = walls.direction[begin:end]
        following = np.roll(along, -1, axis=0)
        cross = along[:, 0] * following[:, 1] - along[:, 1] * following[:, 0]
        whole = np.arctan2(cross, (along * following).sum(axis=1)).sum()
        same = bool((cross > 0.0).all() or (cross < 0.0).all())
        closed = bool((walls.end[end - 1] == walls.start[begin]).all())
        if same and closed and abs(abs(whole) - 2.0 * math.pi) < 1e-6:
            outward[begin:end] = -np.sign(whole)
    return outward


def _bearings(low: Floats, high: Floats, ends: Floats) -> tuple[Floats, Floats]:
    """Return between which angles convex things lie, seen from boxes that they do not meet.

    Parameters
    ----------
    low, high : array, shape (boxes, 2)
    ends : array, shape (things, ends, 2)

    Returns
    -------
    begin, end : array, shape (boxes, things)
        Radians.
    """
    away = ends[:, :, np.newaxis] - np.moveaxis(box_corners(low, high), 0, 1)[:, np.newaxis, np.newaxis]
    angle = np.arctan2(away[..., 1], away[..., 0]).reshape(len(low), len(ends), -1)
    middle = ends.mean(axis=1) - ((low + high) / 2.0)[:, np.newaxis]
    ahead = np.arctan2(middle[..., 1], middle[..., 0])
    turned = angle - ahead[..., np.newaxis]
    turned -= 2.0 * math.pi * np.round(turned / (2.0 * math.pi))
    return ahead + turned.min(axis=-1), ahead + turned.max(axis=-1)


def _greatest(values: Floats, first: Integers, number: Integers) -> Floats:
    """Return the greatest value in runs around a circle.

    Parameters
    ----------
    values : array, shape (count,)
    first, number : array of int, shape (runs,)
        At least one each.
    """
    level = np.concatenate([values, values])
    levels = [level]
    while 2 ** len(levels) <= len(values):
        level = level.copy()
        half = 2 ** (len(levels) - 1)
        np.maximum(level[:-half], level[half:], out=level[:-half])
        levels.append(level)
    table = np.array(levels)
    power = np.frexp(number.astype(np.float64))[1] - 1
    return np.asarray(np.maximum(table[power, first], table[power, first + number - 2**power]))
