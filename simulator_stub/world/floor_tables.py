"""The polygons on the floor as arrays, for machine code."""

from __future__ import annotations

import numpy as np

from ciberrato.arrays import Integers
from simulator_stub.world.floor import Floor

MOST_SQUARES = 2**22
"""Squares of a floor for which there are tables in a single simulation: that of 512 x 512 units."""


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

    @staticmethod
    def fit(floor: Floor) -> bool:
        """Return whether the tables of a floor are of moderate size."""
        columns = [column for column, _ in floor.squares] or [0]
        rows = [row for _, row in floor.squares] or [0]
        return (max(columns) - min(columns) + 1) * (max(rows) - min(rows) + 1) <= MOST_SQUARES

    def __init__(self, floor: Floor) -> None:
        squares = np.array(list(floor.squares) or [(0, 0)], np.int64)
        self.origin: tuple[int, int] = tuple(squares.min(axis=0).tolist())
        columns, rows = (np.ptp(squares, axis=0) + 1).tolist()
        outlines = list(dict.fromkeys(polygon for listed in floor.squares.values() for polygon in listed))
        number_of = {polygon: number for number, polygon in enumerate(outlines)}
        sizes = [len(polygon) for polygon in outlines]
        self.corner_first: Integers = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)
        self.corners = np.array([corner for polygon in outlines for corner in polygon]).reshape(-1, 2)
        column, row = (squares - squares.min(axis=0)).T
        counts = np.zeros((rows, columns), np.int64)
        if floor.squares:
            counts[row, column] = [len(listed) for listed in floor.squares.values()]
        ends = np.cumsum(counts).reshape(rows, columns)
        self.first = np.concatenate((ends - counts, ends[:, -1:]), axis=1)
        listed = list(floor.squares.values())
        in_order = [listed[place] for place in np.lexsort((column, row)).tolist()] if listed else []
        self.polygons = np.array([number_of[polygon] for one in in_order for polygon in one], np.int64)
