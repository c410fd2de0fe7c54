# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""Rays through occupancy grids in machine code made by numba, to the last bit those of numpy.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import math

import numpy as np

from ciberrato.machine_code import kept


@kept
def cast_rays(px, py, ux, uy, clearance, unknown, limit, out, begin, end):
    """Compute the range of some rays, operation by operation as `OccupancyGrid.cast` does for many at once.

    Parameters
    ----------
    px, py, ux, uy : shape (n,)
        Origins, in cells, and directions.
    clearance : int, shape (x + 2, y + 2)
        Distance in cells to the nearest full or unknown one; margins of one cell round the grid.
    unknown : bool, shape (x, y)
    limit : float
        Longest range, in cells.
    out : shape (n,)
        In cells; nan where the ray comes to an unknown cell.
    """
    rows, columns = unknown.shape
    for k in range(begin, end):
        x, y, a, b = px[k], py[k], ux[k], uy[k]
        i, j = math.floor(x), math.floor(y)
        per_a, per_b = 1.0 / a, 1.0 / b
        way = 0.0
        while True:
            if (i < 0 and a <= 0.0) or (i >= rows and a >= 0.0) or (j < 0 and b <= 0.0):
                way = limit
                break
            if way >= limit or (j >= columns and b >= 0.0):
                way = limit
                break
            room = clearance[min(max(i, -1), rows) + 1, min(max(j, -1), columns) + 1]
            if room == 0:
                if unknown[i, j]:
                    way = np.nan
                break
            reach = room - 1
            edge_x = i + reach + 1 if a > 0.0 else i - reach
            edge_y = j + reach + 1 if b > 0.0 else j - reach
            to_x = np.inf if a == 0.0 else (edge_x - x) * per_a
            to_y = np.inf if b == 0.0 else (edge_y - y) * per_b
            if to_x < to_y:
                way = to_x
                j = min(max(math.floor(y + way * b), j - reach), j + reach)
                i = edge_x if a > 0.0 else edge_x - 1
            else:
                way = to_y
                i = min(max(math.floor(x + way * a), i - reach), i + reach)
                j = edge_y if b > 0.0 else edge_y - 1
        out[k] = limit if way > limit else way
