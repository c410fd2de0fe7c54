"""The floor as the line sensor sees it: which points are inside a wall or a painted line."""

from __future__ import annotations

import math
from collections import defaultdict

from ciberrato.lab import Lab, Point

SQUARES_PER_UNIT = 4
"""Small squares keep most lookups from finding any polygon at all."""


NEAR = 0.25
"""Units: the size of a square."""

_AROUND = (-1, 0, 1)


class Floor:
    """The polygons of a lab, listed under the squares that their bounding boxes touch.

    Parameters
    ----------
    lab : Lab
        Its walls count whatever their height; its border does not.

    Attributes
    ----------
    squares : dict of (column, row) to tuple of polygons
        What may be marked in each square; squares without are not listed.
    near_squares : set of (column, row)
        The squares listed there, and those around them.
    """

    def __init__(self, lab: Lab) -> None:
        squares: defaultdict[tuple[int, int], list[tuple[Point, ...]]] = defaultdict(list)
        for wall in lab.walls:
            xs = [x * SQUARES_PER_UNIT for x, _ in wall.corners]
            ys = [y * SQUARES_PER_UNIT for _, y in wall.corners]
            for column in range(math.floor(min(xs)), math.floor(max(xs)) + 1):
                for row in range(math.floor(min(ys)), math.floor(max(ys)) + 1):
                    squares[column, row].append(wall.corners)
        self.squares = {square: tuple(polygons) for square, polygons in squares.items()}
        self.near_squares = {
            (column + right, row + up) for column, row in squares for right in _AROUND for up in _AROUND
        }

    def is_near_mark(self, x: float, y: float) -> bool:
        """Whether any point within `NEAR` of one may be marked."""
        return (math.floor(x * SQUARES_PER_UNIT), math.floor(y * SQUARES_PER_UNIT)) in self.near_squares

    def is_marked(self, x: float, y: float) -> bool:
        """Whether a point is inside any polygon, by the even-odd rule."""
        polygons = self.squares.get((math.floor(x * SQUARES_PER_UNIT), math.floor(y * SQUARES_PER_UNIT)))
        return polygons is not None and any(_inside(x, y, polygon) for polygon in polygons)


def _inside(x: float, y: float, corners: tuple[Point, ...]) -> bool:
    inside = False
    previous_x, previous_y = corners[-1]
    for corner_x, corner_y in corners:
        if (corner_y > y) != (previous_y > y):
            crossing = corner_x + (y - corner_y) * (previous_x - corner_x) / (previous_y - corner_y)
            if x < crossing:
                inside = not inside
        previous_x, previous_y = corner_x, corner_y
    return inside
