"""Occupancy grids: full, free and unknown cells, rays cast through them, distances to the full ones.

Probabilistic Robotics, chapter 9 (the maps), section 6.3.1 (ray casting), section 6.4.3 (cells that are not
explored: a third kind).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import finite_array, positive, where

_BLOCK = 32_768
# From so many rays on machine code is worth its call, where it is loaded.
_FEW = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancyGrid:
    """Full, free and unknown cells.

    Attributes
    ----------
    occupied : array_like, shape (x, y)
        Index 0 at the origin. One of: booleans, or 0 and 1, True being full; probabilities in [0, 1], with
        `threshold`; whole numbers -1 (unknown), 0 (free) and 100 (full) as map servers have them, with
        `threshold` for percentages between. Afterwards: read-only booleans, True where a cell is full.
    cell : float
        Width, in units of length.
    origin : (float, float)
        Corner of cell (0, 0). Everything off the grid is free and empty.
    threshold : float or (float, float), optional
        A cell is full from this probability on, and free below. With two, free below the first, full from the
        second on, and unknown between.
    unknown : array_like of bool, optional
        Cells of which nothing is known, besides those that `occupied` has as -1. Afterwards: all of them,
        read-only; none of them is full.
    """

    occupied: BoolArray
    cell: float
    origin: tuple[float, float] = (0.0, 0.0)
    threshold: float | tuple[float, float] | None = None
    unknown: BoolArray = field(default=None)  # type: ignore[arg-type]  # an array from the start on
    _clearance: IntArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        positive(self.cell, what="the width of a cell")
        values = np.asarray(self.occupied)
        if values.ndim != 2 or not values.size:
            raise ValueError(
                f"an occupancy grid needs two dimensions and some cells, not shape {values.shape}"
            )
        if np.shape(self.origin) != (2,):
            raise ValueError(f"the origin of an occupancy grid is x and y, not {self.origin}")
        finite_array(self.origin, what="the origin of an occupancy grid")
        occupied, unknown = _kinds(values, self.threshold)
        if self.unknown is not None:
            more = np.asarray(self.unknown, dtype=bool)
            if more.shape != occupied.shape:
                raise ValueError(f"`unknown` has shape {more.shape}, the map {occupied.shape}")
            unknown = unknown | more
        occupied = occupied & ~unknown
        for name, array in (("occupied", occupied), ("unknown", unknown)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "_clearance", _clearance(occupied | unknown))

    @classmethod
    def from_rows(
        cls,
        rows: ArrayLike,
        *,
        cell: float,
        origin: tuple[float, float] = (0.0, 0.0),
        threshold: float | tuple[float, float] | None = None,
    ) -> OccupancyGrid:
        """Create a grid from an array [row, column], row 0 the southernmost, as labs and map servers."""
        return cls(occupied=np.asarray(rows).T, cell=cell, origin=origin, threshold=threshold)

    def distance_field(self) -> FloatArray:
        """Compute each cell's distance to the middle of the nearest full cell, (x, y), in units of length.

        Unknown cells are not full; `LikelihoodField` treats beams that end in them by themselves.
        """
        from scipy.ndimage import distance_transform_edt

        if not self.occupied.any():
            return np.full(self.occupied.shape, np.inf)
        return np.asarray(distance_transform_edt(~self.occupied) * self.cell)

    def cast(self, x: ArrayLike, y: ArrayLike, angle: ArrayLike, max_range: float) -> FloatArray:
        """Compute the range of rays to the edge of the first full cell.

        A ray is followed from one empty square of cells to the next (as large as the map allows), so that a
        wide hall takes a few steps and the result is that of going cell by cell.

        Parameters
        ----------
        x, y, angle : array_like
            Origins of rays and their directions (radians), broadcast.
        max_range : float
            Given where nothing nearer is hit.

        Returns
        -------
        FloatArray
            The broadcast shape; 0 for rays that begin in a full cell, nan for those that come to (or begin
            in) an unknown cell before: how far they go is not known. `BeamModel(unknown="uniform")` takes
            these.

        Raises
        ------
        ValueError
            If a coordinate or angle is not finite, or the longest range not positive.
        """
        positive(max_range, what="max_range")
        x, y, angle = np.broadcast_arrays(
            finite_array(x, what="x"), finite_array(y, what="y"), finite_array(angle, what="angles")
        )
        result = np.empty(x.size)
        flat = x.ravel(), y.ravel(), angle.ravel()
        if x.size >= _FEW and compiled.loaded() is not None:
            self._cast_compiled(*flat, max_range / self.cell, result)
            return result.reshape(x.shape) * self.cell
        for start in range(0, x.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            px = (flat[0][block] - self.origin[0]) / self.cell
            py = (flat[1][block] - self.origin[1]) / self.cell
            result[block] = self._cast_block(px, py, flat[2][block], max_range / self.cell)
        return result.reshape(x.shape) * self.cell

    def _cast_compiled(
        self, x: FloatArray, y: FloatArray, angle: FloatArray, limit: float, out: FloatArray
    ) -> None:
        """Cast rays in machine code; cosines and sines are numpy's, and so all bits are."""
        loops: Any = compiled.loaded()
        given = (
            (x - self.origin[0]) / self.cell,
            (y - self.origin[1]) / self.cell,
            np.cos(angle),
            np.sin(angle),
        )
        compiled.share(
            lambda begin, end: loops.cast_rays(*given, self._clearance, self.unknown, limit, out, begin, end),
            out.size,
            out.size,
        )

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
        some_unknown = bool(self.unknown.any())
        while active.size:
            a = active
            room = self._clearance[np.clip(i[a], -1, rows) + 1, np.clip(j[a], -1, columns) + 1]
            full = room == 0
            if full.any():
                if some_unknown:
                    distance[a[full]] = np.where(
                        self.unknown[i[a[full]], j[a[full]]], np.nan, distance[a[full]]
                    )
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


def _kinds(
    values: NDArray[Any], threshold: float | tuple[float, float] | None
) -> tuple[BoolArray, BoolArray]:
    """Return which cells are full and which are unknown."""
    limits = () if threshold is None else tuple(np.atleast_1d(np.asarray(threshold, dtype=float)))
    if len(limits) > 2 or not all(0.0 < limit <= 1.0 for limit in limits) or list(limits) != sorted(limits):
        raise ValueError(f"a threshold is a probability in (0, 1], or two that rise, not {threshold}")
    none = np.zeros(values.shape, dtype=bool)
    if values.dtype == bool:
        return values.copy(), none
    chances: FloatArray = np.asarray(values, dtype=float)
    if np.isnan(chances).any():
        raise ValueError(f"the map is nan at cell {where(np.isnan(chances))}; unknown cells are -1")
    unknown = np.asarray(chances == -1.0)
    known = chances[~unknown]
    if (known == np.rint(known)).all() and (unknown.any() or (known > 1.0).any()):
        chances, scale = chances / 100.0, "-1 (unknown), 0 (free) to 100 (full)"
    else:
        scale = "probabilities 0 to 1, or -1 (unknown)"
    wrong = ~((chances >= 0.0) & (chances <= 1.0) | unknown)
    if wrong.any():
        raise ValueError(f"cell {where(wrong)} of the map is {values[wrong].flat[0]}; cells are {scale}")
    if not limits:
        between = (chances > 0.0) & (chances < 1.0) & ~unknown
        if between.any():
            raise ValueError(
                f"cell {where(between)} of the map is {values[between].flat[0]}, between free and full: name "
                "the probability from which on cells are full (threshold=0.65, say)"
            )
        return np.asarray(chances == 1.0), unknown
    unknown = unknown | ((chances >= limits[0]) & (chances < limits[-1]))
    return np.asarray((chances >= limits[-1]) & ~unknown), unknown


def _leaving(i: IntArray, j: IntArray, ux: FloatArray, uy: FloatArray, rows: int, columns: int) -> BoolArray:
    """Return which rays are off the grid and can never come back to it."""
    return np.asarray(
        ((i < 0) & (ux <= 0.0))
        | ((i >= rows) & (ux >= 0.0))
        | ((j < 0) & (uy <= 0.0))
        | ((j >= columns) & (uy >= 0.0))
    )


def _clearance(occupied: BoolArray) -> IntArray:
    """Return the distance in cells to the nearest full one, diagonals as 1; 0 in a full cell, shape + 2.

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
