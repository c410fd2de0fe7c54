"""Displacements between the cells of a planar grid, as the densities over end poses need them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray, IntArray
from ciberrato.reprs import short_repr

# Greatest number of parts, each way, that a cell is cut into.
_MOST_PARTS = 8


class Displacements(NamedTuple):
    """Whole-cell displacements; those nearby several times, for the parts of the target cell.

    Attributes
    ----------
    cells : IntArray, shape (n, 2)
        Along x and y.
    distance : FloatArray, shape (n,)
        To the middle of the target cell or part, in units of length; positive.
    direction : FloatArray, shape (n,)
        Direction of the same point, radians.
    inverse_distance : FloatArray, shape (n,)
        Integral of 1 / distance over the cell or part: what turns a density over distance and direction into
        mass.
    area : FloatArray, shape (n,)
        Area of the cell or part.
    """

    cells: IntArray
    distance: FloatArray
    direction: FloatArray
    inverse_distance: FloatArray
    area: FloatArray

    def take(self, chosen: ArrayLike) -> Displacements:
        """Return those of the indices or the mask."""
        rows = np.asarray(chosen)
        cells, distance, direction, inverse_distance, area = (field[rows] for field in self)
        return Displacements(cells, distance, direction, inverse_distance, area)

    def __repr__(self) -> str:
        return short_repr(self)


def displacements(
    reach: tuple[int, int], cell: tuple[float, float], *, rotation: float | None = None
) -> Displacements:
    """List all displacements up to a reach.

    Seen from the start, near cells cover wide angles. Where that is wide against the noise of the heading, a
    cell is cut into p x p parts that all stand for the same displacement: p is the least number for which a
    part at the cell's distance is no wider than 1.4 sigma, at most 8. The cell of no displacement has
    ceil(1.5 / sigma) parts each way, 4 to 8.

    Parameters
    ----------
    reach : (int, int)
        Greatest number of cells along x and y, both ways.
    cell : (float, float)
        Cell widths along x and y.
    rotation : float, optional
        Standard deviation of the heading at the start, radians. If None, cells are not cut.

    Returns
    -------
    Displacements
    """
    i, j = np.meshgrid(np.arange(-reach[0], reach[0] + 1), np.arange(-reach[1], reach[1] + 1), indexing="ij")
    cells = np.stack([i.ravel(), j.ravel()], axis=1)
    width = np.array(cell)
    middle = cells * width
    counts = np.ones(len(cells), dtype=int)
    if rotation is not None:
        distance = np.hypot(middle[:, 0], middle[:, 1])
        here = distance == 0.0
        needed = np.ceil(width.max() / (1.4 * rotation * np.where(here, 1.0, distance)) - 1e-9)
        counts = np.clip(needed, 1, _MOST_PARTS).astype(int)
        counts[here] = int(np.clip(np.ceil(1.5 / rotation), 4, _MOST_PARTS))
    pieces = []
    for count in np.unique(counts):
        chosen = counts == count
        steps = (np.arange(count) + 0.5) / count - 0.5
        a, b = np.meshgrid(steps * cell[0], steps * cell[1], indexing="ij")
        parts = np.stack([a.ravel(), b.ravel()], axis=1)
        places = (middle[chosen, np.newaxis] + parts).reshape(-1, 2)
        pieces.append(
            (
                np.repeat(cells[chosen], count * count, axis=0),
                places,
                np.tile(width / count, (len(places), 1)),
            )
        )
    cells, middle, size = (np.concatenate([piece[k] for piece in pieces]) for k in range(3))
    return Displacements(
        cells=cells.astype(np.intp),
        distance=np.hypot(middle[:, 0], middle[:, 1]),
        direction=np.arctan2(middle[:, 1], middle[:, 0]),
        inverse_distance=_inverse_distance(middle, size),
        area=size.prod(axis=1),
    )


def _inverse_distance(middle: FloatArray, size: FloatArray) -> FloatArray:
    """Integrate 1 / distance over rectangles, in closed form."""

    def corner(x: FloatArray, y: FloatArray) -> FloatArray:
        # Antiderivative of 1 / hypot(x, y) in both variables; 0 log 0 terms vanish.
        with np.errstate(divide="ignore", invalid="ignore"):
            first = np.where(x == 0.0, 0.0, x * np.arcsinh(y / np.abs(x)))
            second = np.where(y == 0.0, 0.0, y * np.arcsinh(x / np.abs(y)))
        return np.asarray(first + second)

    low, high = middle - size / 2.0, middle + size / 2.0
    return (
        corner(high[:, 0], high[:, 1])
        - corner(low[:, 0], high[:, 1])
        - corner(high[:, 0], low[:, 1])
        + corner(low[:, 0], low[:, 1])
    )
