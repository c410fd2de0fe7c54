"""Occupancy grids: obstacles as full cells, rays cast through them, distances to them.

Probabilistic Robotics, chapter 9 (the maps) and section 6.3.1 (ray casting).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray

_BLOCK = 32_768


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancyGrid:
    """Full and free cells.

    Attributes
    ----------
    occupied : BoolArray, shape (x, y)
        Index 0 at the origin.
    cell : float
        Width, in units of length.
    origin : (float, float)
        Corner of cell (0, 0). Everything off the grid is free and empty.
    """

    occupied: BoolArray
    cell: float
    origin: tuple[float, float] = (0.0, 0.0)
    _clearance: IntArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        occupied = np.array(self.occupied, dtype=bool)
        if occupied.ndim != 2 or not self.cell > 0.0:
            raise ValueError("an occupancy grid needs two dimensions and a positive cell")
        occupied.setflags(write=False)
        object.__setattr__(self, "occupied", occupied)
        object.__setattr__(self, "_clearance", _clearance(occupied))

    def distance_field(self) -> FloatArray:
        """Give each cell's distance to the middle of the nearest full cell, (x, y), in units of length."""
        from scipy.ndimage import distance_transform_edt

        if not self.occupied.any():
            return np.full(self.occupied.shape, np.inf)
        return np.asarray(distance_transform_edt(~self.occupied) * self.cell)

    def cast(self, x: ArrayLike, y: ArrayLike, angle: ArrayLike, max_range: float) -> FloatArray:
        """Give the range of rays to the edge of the first full cell.

        A ray is followed from one empty square of cells to the next (as large as the map allows), so that a
        wide hall takes a few steps and the result is that of going cell by cell.

        Parameters
        ----------
        x, y, angle : array_like
            Where rays begin and their directions (radians), broadcast.
        max_range : float
            Given where nothing nearer is hit.

        Returns
        -------
        FloatArray
            The broadcast shape; 0 for rays that begin in a full cell.
        """
        x, y, angle = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (x, y, angle)))
        result = np.empty(x.size)
        flat = x.ravel(), y.ravel(), angle.ravel()
        for start in range(0, x.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            px = (flat[0][block] - self.origin[0]) / self.cell
            py = (flat[1][block] - self.origin[1]) / self.cell
            result[block] = self._cast_block(px, py, flat[2][block], max_range / self.cell)
        return result.reshape(x.shape) * self.cell

    def _cast_block(self, px: FloatArray, py: FloatArray, angle: FloatArray, limit: float) -> FloatArray:
        ux, uy = np.cos(angle), np.sin(angle)
        with np.errstate(divide="ignore"):
            inverse_x, inverse_y = 1.0 / ux, 1.0 / uy
        i, j = np.floor(px).astype(np.intp), np.floor(py).astype(np.intp)
        distance = np.zeros(len(px))
        rows, columns = self.occupied.shape
        # Two cells of margin around the grid, of which the outer marks that a ray has left for good.
        active = np.arange(len(px))
        off = _leaving(i, j, ux, uy, rows, columns)
        distance[off] = limit
        active = active[~off]
        while active.size:
            a = active
            room = self._clearance[np.clip(i[a], -1, rows) + 1, np.clip(j[a], -1, columns) + 1]
            full = room == 0
            if full.any():
                active, a, room = a[~full], a[~full], room[~full]
                if not a.size:
                    break
            reach = room - 1
            # Where the ray leaves the square of cells that reaches so far either way.
            edge_x = np.where(ux[a] > 0.0, i[a] + reach + 1, i[a] - reach)
            edge_y = np.where(uy[a] > 0.0, j[a] + reach + 1, j[a] - reach)
            with np.errstate(invalid="ignore"):
                to_x = np.where(ux[a] == 0.0, np.inf, (edge_x - px[a]) * inverse_x[a])
                to_y = np.where(uy[a] == 0.0, np.inf, (edge_y - py[a]) * inverse_y[a])
            by_x = to_x < to_y
            way = np.minimum(to_x, to_y)
            # The cell entered follows from the edge crossed, not from rounding; the other index stays in the
            # square.
            other_i = np.clip(np.floor(px[a] + way * ux[a]).astype(np.intp), i[a] - reach, i[a] + reach)
            other_j = np.clip(np.floor(py[a] + way * uy[a]).astype(np.intp), j[a] - reach, j[a] + reach)
            i[a] = np.where(by_x, np.where(ux[a] > 0.0, edge_x, edge_x - 1), other_i)
            j[a] = np.where(by_x, other_j, np.where(uy[a] > 0.0, edge_y, edge_y - 1))
            distance[a] = way
            done = (way >= limit) | _leaving(i[a], j[a], ux[a], uy[a], rows, columns)
            distance[a[done]] = limit
            active = a[~done]
        return np.minimum(distance, limit)


def _leaving(i: IntArray, j: IntArray, ux: FloatArray, uy: FloatArray, rows: int, columns: int) -> BoolArray:
    """Tell which rays are off the grid and can never come back to it."""
    return np.asarray(
        ((i < 0) & (ux <= 0.0))
        | ((i >= rows) & (ux >= 0.0))
        | ((j < 0) & (uy <= 0.0))
        | ((j >= columns) & (uy >= 0.0))
    )


def _clearance(occupied: BoolArray) -> IntArray:
    """Give how many cells off the nearest full one is, diagonally counted as 1; 0 in a full cell, shape + 2.

    The margin of one cell around the grid has 1: rays off the grid go one cell at a time.
    """
    from scipy.ndimage import distance_transform_cdt

    padded = np.pad(occupied, 1)
    if occupied.any():
        result = distance_transform_cdt(~padded, metric="chessboard").astype(np.intp)
    else:
        result = np.full(padded.shape, max(padded.shape), dtype=np.intp)
    # No square may reach beyond the margin: what is there is not in the table.
    rows, columns = padded.shape
    i, j = np.arange(rows)[:, np.newaxis], np.arange(columns)
    inside = np.minimum(np.minimum(i, rows - 1 - i), np.minimum(j, columns - 1 - j)) + 1
    return np.asarray(np.minimum(result, np.maximum(inside, 1)))
