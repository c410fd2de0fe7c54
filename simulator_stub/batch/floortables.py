"""The polygons on the floor as arrays, for machine code."""

from __future__ import annotations

import numpy as np

from ciberrato.arrays import Integers
from simulator_stub.world.floor import Floor


class FloorTables:
    """The polygons of a `Floor`, by its squares.

    Parameters
    ----------
    floor : Floor

    Attributes
    ----------
    origin : (int, int)
        Column and row of the first square.
    first : array of int, shape (squares up, squares right + 1)
        Index in `polygons` of the begin of each square's list; it ends where that of the next one begins.
    polygons : array of int
        Numbers of the polygons, square by square.
    corner_first : array of int, shape (polygons + 1,)
        Index in `corners` of each polygon's first corner.
    corners : array, shape (corners, 2)
        Units.
    """

    def __init__(self, floor: Floor) -> None:
        columns = [column for column, _ in floor.squares] or [0]
        rows = [row for _, row in floor.squares] or [0]
        self.origin = (min(columns), min(rows))
        shape = (max(rows) - min(rows) + 1, max(columns) - min(columns) + 1)
        outlines = list(dict.fromkeys(polygon for listed in floor.squares.values() for polygon in listed))
        number_of = {polygon: number for number, polygon in enumerate(outlines)}
        sizes = [len(polygon) for polygon in outlines]
        self.corner_first: Integers = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)
        self.corners = np.array([corner for polygon in outlines for corner in polygon]).reshape(-1, 2)
        self.first = np.zeros((shape[0], shape[1] + 1), np.int64)
        listed: list[int] = []
        for row in range(shape[0]):
            for column in range(shape[1]):
                self.first[row, column] = len(listed)
                square = (column + self.origin[0], row + self.origin[1])
                listed += [number_of[polygon] for polygon in floor.squares.get(square, ())]
            self.first[row, -1] = len(listed)
        self.polygons = np.array(listed, np.int64)
