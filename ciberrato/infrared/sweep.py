"""Distances that an IR sensor takes at many places, in evenly spaced directions.

The rule is that of `ciberrato.infrared.model.sensor_distances` (the least of three rays and of the corners in
the cone), computed for whole tiles of places at once. From a tile a face is met by rays of one run of
directions only. Faces are painted into the tile's table, nearest first: over this run each ray's distance to
the face's line, where the ray passes between its ends, replaces what is farther. A face that is farther off
than everything in its run is left out, and so are the far sides of convex walls, which no ray meets first.
The three rays in one direction, of the sensors that look there and 30 degrees to both sides, are parallel
lines, and are painted together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats, Integers
from ciberrato.geometry.tiles import Tiles
from ciberrato.geometry.walls import WallMap, face_distances
from ciberrato.infrared.model import SENSOR_OFFSET
from ciberrato.infrared.sweep_plan import (
    TOUCH,
    CornerColumns,
    Directions,
    FaceColumns,
    SweepPlan,
    TilePlan,
    along,
)

_BATCH = 12
"""Faces painted between two looks at what can be left out."""
_PLACES = 400
"""Places of the fullest tile, about; with more, faces are painted in vain, with fewer, calls cost more."""

Convert = Callable[[Floats], NDArray[Any]]


class Loops(Protocol):
    """Machine code for the loops of this module: `ciberrato.localization.belief.kernels`."""

    sweep_tile: Callable[..., Floats]


def tabulate_distances(
    walls: WallMap,
    places: Floats,
    first: float,
    count: int,
    *,
    convert: Convert | None = None,
    loops: Loops | None = None,
    progress: Callable[[float], None] | None = None,
) -> NDArray[Any]:
    """Compute the distance that a sensor takes in every place and direction.

    Parameters
    ----------
    walls : WallMap
    places : array, shape (places, 2)
        Centres of the robot, in units; outside of walls.
    first : float
        First direction: the axis of the sensor in the lab's frame, in radians.
    count : int
        Number of directions, evenly around the circle; a multiple of 12.
    convert : callable, optional
        Elementwise conversion of distances, done while they are in the processor's cache.
    loops : Loops, optional
        Machine code for the same arithmetic, to the last bit.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    array, shape (count, places)
        Units; infinite where no wall is seen. Of the type that `convert` returns.
    """
    sweep = Sweep(walls, first, count, convert=convert, loops=loops)
    table = np.empty((count, len(places)), sweep.dtype)
    tiles = Tiles(places, _tile_size(places))
    for number, (members, part) in enumerate(zip(tiles.members, sweep.tiles(places, tiles), strict=True)):
        if progress is not None and number % 8 == 0:
            progress(number / len(tiles.members))
        table[:, members] = part
    return table


class Sweep:
    """Distances in a lab for tiles of places, one tile after the other; arguments as `tabulate_distances`.

    What it computes for a place does not depend on the tile with which that is computed.
    """

    def __init__(
        self,
        walls: WallMap,
        first: float,
        count: int,
        *,
        convert: Convert | None = None,
        loops: Loops | None = None,
    ) -> None:
        self.dtype = np.dtype(np.float64) if convert is None else convert(np.ones(1)).dtype
        self._convert = convert
        self._directions = Directions(walls, first, count)
        self._plan = SweepPlan(self._directions)
        self._painter, self._loops = _NumpyPainter(self._directions), loops
        self._compiled = self._plan.arrays() if loops is not None else ()

    def tile(self, places: Floats) -> NDArray[Any]:
        """Compute the distances at the places of one tile; shape (count, places)."""
        if self._loops is not None:
            return self._converted(self._loops.sweep_tile(np.ascontiguousarray(places), *self._compiled))
        low, high = places.min(axis=0)[np.newaxis], places.max(axis=0)[np.newaxis]
        return self._sweep(self._plan.tiles(low, high)[0], places)

    def tiles(self, places: Floats, tiles: Tiles) -> Iterator[NDArray[Any]]:
        """Yield the distances at the places of each tile."""
        if self._loops is not None:
            yield from (self.tile(places[members]) for members in tiles.members)
            return
        step = self._plan.at_once
        for first in range(0, len(tiles.members), step):
            some = slice(first, first + step)
            plans = self._plan.tiles(tiles.low[some], tiles.high[some])
            for plan, members in zip(plans, tiles.members[some], strict=True):
                yield self._sweep(plan, places[members])

    def _sweep(self, plan: TilePlan, places: Floats) -> NDArray[Any]:
        return self._converted(_sweep_tile(self._directions, plan, places, self._painter))

    def _converted(self, distances: Floats) -> NDArray[Any]:
        return distances if self._convert is None else self._convert(distances)


def _tile_size(places: Floats) -> float:
    """Return an edge, in units, with which the fullest tile has about `_PLACES`; at most 2."""
    size = 2.0
    while size > 0.25 and len(places):
        fullest = np.unique(np.floor(places / size) @ (1.0, 1e6), return_counts=True)[1].max()
        if fullest <= 1.25 * _PLACES:
            break
        size /= 2.0
    return size


class _NumpyPainter:
    """Paints with numpy, in arrays of its own: fresh ones would have to be got from the system.

    Parameters
    ----------
    directions : Directions
    """

    def __init__(self, directions: Directions) -> None:
        self._directions = directions
        self._make_room(0)

    def _make_room(self, places: int) -> None:
        size = self._directions.count * places
        self._base, self._rays = np.empty(size), np.empty(3 * size)
        self._masks = np.empty((2, 3 * size), np.bool_)

    def faces(self, rays: Floats, across: Floats, offsets: Floats, runs: Integers) -> None:
        """Apply faces to the distances along rays.

        Parameters
        ----------
        rays : array, shape (3, count, places)
        across : array, shape (count, places)
        offsets : array, shape (faces, places)
        runs : array of int, shape (faces, 4)
            Face, first direction, number of directions, whether its line may be met behind the sensor.
        """
        count = self._directions.count
        if across.size > self._base.size:
            self._make_room(across.shape[1])
        for offset, (face, first, number, near) in zip(offsets, runs.tolist(), strict=True):
            columns = self._directions.face(face)
            for begin, end in _runs(first, number, count):
                self._face(rays, across, offset, columns, begin, end, -TOUCH if near else -math.inf)

    def corners(
        self, squared: Floats, turned: tuple[Floats, Floats, Floats], squares: Floats, runs: Integers
    ) -> None:
        """Apply corners to squared distances.

        Parameters
        ----------
        squared : array, shape (count, places)
        turned : tuple of array, shape (count, places)
            Places ahead; and aside, seen along the left and right edge of the cone.
        squares : array, shape (corners, places)
        runs : array of int, shape (corners, 3)
            Corner, first direction, number of directions.
        """
        if squared.size > self._base.size:
            self._make_room(squared.shape[1])
        for square, (corner, first, number) in zip(squares, runs.tolist(), strict=True):
            columns = self._directions.corner(corner)
            for begin, end in _runs(first, number, self._directions.count):
                self._corner(squared, turned, square, columns, begin, end)

    def _face(
        self,
        rays: Floats,
        across: Floats,
        offset: Floats,
        columns: FaceColumns,
        begin: int,
        end: int,
        least: float,
    ) -> None:
        rate, lead, low, high = (column[..., begin:end, :] for column in columns)
        rows, size = end - begin, across.shape[1]
        length = self._base[: rows * size].reshape(rows, size)
        reach = self._rays[: 3 * rows * size].reshape(3, rows, size)
        beside, other = self._masks[:, : 3 * rows * size].reshape(2, 3, rows, size)
        np.multiply(rate, offset, out=length)
        np.subtract(length, lead, out=reach)
        np.less(across[begin:end], low, out=beside)
        np.greater(across[begin:end], high, out=other)
        np.logical_or(beside, other, out=beside)
        if least > -math.inf:
            np.less(reach, least, out=other)
            np.logical_or(beside, other, out=beside)
        np.copyto(reach, np.inf, where=beside)
        np.minimum(rays[:, begin:end], reach, out=rays[:, begin:end])

    def _corner(
        self,
        squared: Floats,
        turned: tuple[Floats, Floats, Floats],
        square: Floats,
        columns: CornerColumns,
        begin: int,
        end: int,
    ) -> None:
        along, across_left, across_right = (array[begin:end] for array in turned)
        ahead, left, right = (column[begin:end] for column in columns)
        rows, size = along.shape
        distance = self._base[: rows * size].reshape(rows, size)
        beside, other = self._masks[:, : rows * size].reshape(2, rows, size)
        np.add(along, square, out=distance)
        np.subtract(distance, ahead, out=distance)
        np.less(across_left, left, out=beside)
        np.greater(across_right, right, out=other)
        np.logical_or(beside, other, out=beside)
        np.copyto(distance, np.inf, where=beside)
        np.minimum(squared[begin:end], distance, out=squared[begin:end])


def _sweep_tile(directions: Directions, plan: TilePlan, places: Floats, painter: _NumpyPainter) -> Floats:
    ahead, across = along(directions.ahead, places), along(directions.aside, places)
    rays = _paint_faces(directions, plan, places, across, painter)
    shift = directions.count // 12
    squared = np.minimum(np.roll(rays[1], -shift, axis=0), np.roll(rays[2], shift, axis=0))
    np.minimum(squared, rays[0], out=squared)
    np.maximum(squared, 0.0, out=squared)
    corners = plan.corners_within(squared.max(axis=1))
    squared *= squared
    _paint_corners(directions, plan, corners, places, (ahead, across), squared, painter)
    np.maximum(squared, 0.0, out=squared)
    return np.asarray(np.sqrt(squared, out=squared))


def _paint_faces(
    directions: Directions, plan: TilePlan, places: Floats, across: Floats, painter: _NumpyPainter
) -> Floats:
    """Compute the distances of the first faces along rays; shape (3, directions of the ray, places)."""
    rays = np.full((3, directions.count, len(places)), np.inf)
    left = plan.faces(_stick_out(directions.walls, plan, places))
    while left.size:
        some, left = left[:_BATCH], left[_BATCH:]
        painter.faces(rays, across, directions.offsets(some, places), plan.runs(some))
        if left.size:
            left = plan.faces_within(left, rays.max(axis=(0, 2)))
    return rays


def _stick_out(walls: WallMap, plan: TilePlan, places: Floats) -> bool:
    """Return whether a sensor of a robot that touches a wall, within tolerances, may be behind its face."""
    near = np.flatnonzero(plan.touchable)
    if not near.size:
        return False
    ends = walls.start[near], walls.end[near], walls.direction[near], walls.length[near]
    return bool(face_distances(places[:, :1], places[:, 1:], *ends).min() < SENSOR_OFFSET - TOUCH / 2.0)


def _paint_corners(
    directions: Directions,
    plan: TilePlan,
    corners: Integers,
    places: Floats,
    turned: tuple[Floats, Floats],
    squared: Floats,
    painter: _NumpyPainter,
) -> None:
    """Apply the corners in the cone to squared distances."""
    ahead, across = turned
    shift = len(squared) // 12
    sides = (ahead, np.roll(across, -shift, axis=0), np.roll(across, shift, axis=0))
    away = directions.corners[corners, np.newaxis, :] - places
    squares = (away * away).sum(axis=-1) + SENSOR_OFFSET**2
    painter.corners(squared, sides, squares, plan.corner_runs(corners))


def _runs(first: int, number: int, count: int) -> tuple[tuple[int, int], ...]:
    """Return a run of directions as one or two slices of the circle."""
    if first + number <= count:
        return ((first, first + number),)
    return ((first, count), (0, first + number - count))
