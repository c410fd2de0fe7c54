"""The floor as the line sensor sees it: which points are inside a wall or a painted line."""

from __future__ import annotations

import math
from collections import defaultdict

from ciberrato.world.coordinates import Point
from ciberrato.world.lab import Lab

SQUARES_PER_UNIT = 4
"""Small squares keep most lookups from finding any polygon at all."""

NEAR = 0.25
"""Units around a point that `Floor.around` answers for."""

_ROUNDING = 1e-9

Outline = tuple[float, float, float, float, tuple[Point, ...] | None]
"""Least and greatest x, least and greatest y, and the corners; None for an upright rectangle, as most are."""


class Floor:
    """The polygons of a lab, listed under the squares that they are near to.

    Parameters
    ----------
    lab : Lab
        Its walls count whatever their height; its border does not.

    Attributes
    ----------
    squares : dict of (column, row) to tuple of polygons
        Polygons within `NEAR` of a square, by bounding boxes; squares with nothing near are not listed.
    """

    def __init__(self, lab: Lab) -> None:
        squares: defaultdict[tuple[int, int], list[tuple[Point, ...]]] = defaultdict(list)
        for wall in lab.walls:
            xs = [x for x, _ in wall.corners]
            ys = [y for _, y in wall.corners]
            for column in range(_square(min(xs) - NEAR), _square(max(xs) + NEAR) + 1):
                for row in range(_square(min(ys) - NEAR), _square(max(ys) + NEAR) + 1):
                    squares[column, row].append(wall.corners)
        self.squares = {square: tuple(polygons) for square, polygons in squares.items()}
        self._outlines = {
            square: tuple(_outline(polygon) for polygon in polygons) for square, polygons in squares.items()
        }

    def around(self, x: float, y: float) -> tuple[Outline, ...]:
        """List the polygons that any point within `NEAR` of a point may be inside."""
        return self._outlines.get((_square(x), _square(y)), ())

    def is_marked(self, x: float, y: float) -> bool:
        """Return whether a point is inside any polygon, by the even-odd rule."""
        return inside_any(self.around(x, y), x, y)


def _square(length: float) -> int:
    return math.floor(length * SQUARES_PER_UNIT)


def inside_any(outlines: tuple[Outline, ...], x: float, y: float) -> bool:
    """Return whether a point is inside any of some polygons, by the even-odd rule."""
    for left, right, bottom, top, corners in outlines:
        if left <= x < right and bottom <= y < top and (corners is None or _inside(x, y, corners)):
            return True
    return False


def _outline(corners: tuple[Point, ...]) -> Outline:
    xs, ys = [x for x, _ in corners], [y for _, y in corners]
    left, right, bottom, top = min(xs), max(xs), min(ys), max(ys)
    if len(corners) == 4 and {*corners} == {(left, bottom), (right, bottom), (right, top), (left, top)}:
        # Its sides are crossed at just these places: the rule comes down to comparing with them.
        return left, right, bottom, top, None
    return left - _ROUNDING, right + _ROUNDING, bottom, top, corners


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
