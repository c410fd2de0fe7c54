"""Points in square tiles: what is found once for a tile need not be looked for at every point."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ciberrato.arrays import Floats, Integers
from ciberrato.geometry.walls import WallMap, face_distances

_TILE = 2.0  # units; of the tiles in which nearest faces are looked for
_MARGIN = 1e-6  # units, far above rounding errors
_ELEMENTS = 2**18
"""Tiles times faces worked on at once."""


class Tiles:
    """Points grouped by the tile that they are in.

    Parameters
    ----------
    places : array, shape (n, 2)
        Units.
    size : float
        Units; edge of a tile.

    Attributes
    ----------
    members : list of array of int
        Points of each tile, ascending.
    low, high : array, shape (tiles, 2)
        Corners of the least box around the points of each tile, sides parallel to the axes.
    """

    def __init__(self, places: Floats, size: float) -> None:
        tile = np.floor(places / size).astype(np.int64)
        tile -= tile.min(axis=0, initial=0)
        columns = int(tile[:, 0].max(initial=0)) + 1
        keys, number = np.unique(tile[:, 1] * columns + tile[:, 0], return_inverse=True)
        order = np.argsort(number, kind="stable")
        bounds = np.searchsorted(number[order], np.arange(len(keys) + 1))
        self.members: list[Integers] = np.split(order, bounds[1:-1]) if len(keys) else []
        self.low = np.zeros((0, 2)) if not len(keys) else np.minimum.reduceat(places[order], bounds[:-1])
        self.high = np.zeros((0, 2)) if not len(keys) else np.maximum.reduceat(places[order], bounds[:-1])


def near_faces(walls: WallMap, places: Floats, tile: float = _TILE) -> Iterator[tuple[Integers, Integers]]:
    """Yield groups of points with the faces that may be the nearest one of any of them.

    Parameters
    ----------
    walls : WallMap
    places : array, shape (n, 2)
        Units.
    tile : float
        Units; edge of a group's tile.

    Yields
    ------
    members, faces : array of int
        Ascending.
    """
    tiles = Tiles(places, tile)
    middle = (tiles.low + tiles.high) / 2.0
    radius = np.hypot(*(tiles.high - middle).T)
    step = max(_ELEMENTS // max(len(walls.length), 1), 1)
    for first in range(0, len(middle), step):
        x, y = middle[first : first + step, :1], middle[first : first + step, 1:]
        distance = face_distances(x, y, walls.start, walls.end, walls.direction, walls.length)
        reach = distance.min(axis=1) + 2.0 * radius[first : first + step] + _MARGIN
        near = distance <= reach[:, np.newaxis]
        for number, row in enumerate(near, start=first):
            yield tiles.members[number], np.flatnonzero(row)


def wall_distances(walls: WallMap, places: Floats, tile: float = _TILE) -> Floats:
    """Compute the distances of many points to the nearest face: `WallMap.distance`, to the last bit, sooner.

    Parameters
    ----------
    walls : WallMap
        With at least one face.
    places : array, shape (n, 2)
        Units.
    tile : float
        Units; less where places are dense.

    Returns
    -------
    array, shape (n,)
    """
    result = np.empty(len(places))
    for members, faces in near_faces(walls, places, tile):
        x, y = places[members, :1], places[members, 1:]
        ends = walls.start[faces], walls.end[faces], walls.direction[faces], walls.length[faces]
        result[members] = face_distances(x, y, *ends).min(axis=1, initial=walls.width)
    return result


def box_distances(low: Floats, high: Floats, walls: WallMap) -> Floats:
    """Compute the distances of boxes, sides parallel to the axes, to faces.

    Parameters
    ----------
    low, high : array, shape (boxes, 2)
        Lower left and upper right corners.
    walls : WallMap

    Returns
    -------
    array, shape (boxes, faces)
        Units; 0 where a face meets the box.
    """
    start, end = walls.start, walls.end
    distance = np.minimum(point_box_distances(low, high, start), point_box_distances(low, high, end))
    normal = np.stack([-walls.direction[:, 1], walls.direction[:, 0]], axis=1)
    offset = (start * normal).sum(axis=1)
    sides = []
    for corner in box_corners(low, high):
        faces = (start, end, walls.direction, walls.length)
        np.minimum(distance, face_distances(corner[:, :1], corner[:, 1:], *faces), out=distance)
        sides.append(corner @ normal.T - offset)
    least, most = np.minimum(start, end), np.maximum(start, end)
    apart = (least > high[:, np.newaxis]).any(axis=-1) | (most < low[:, np.newaxis]).any(axis=-1)
    apart |= np.min(sides, axis=0) > 0.0
    apart |= np.max(sides, axis=0) < 0.0
    return np.where(apart, distance, 0.0)


def point_box_distances(low: Floats, high: Floats, points: Floats) -> Floats:
    """Compute the distances of points to boxes; shape (boxes, points)."""
    gap = np.maximum(low[:, np.newaxis] - points, points - high[:, np.newaxis])
    np.maximum(gap, 0.0, out=gap)
    return np.asarray(np.hypot(gap[..., 0], gap[..., 1]))


def box_corners(low: Floats, high: Floats) -> Floats:
    """Return the four corners of boxes; shape (4, boxes, 2)."""
    return np.stack(
        [np.stack([x, y], axis=1) for x in (low[:, 0], high[:, 0]) for y in (low[:, 1], high[:, 1])]
    )
