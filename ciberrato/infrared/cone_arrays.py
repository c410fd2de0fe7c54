"""IR distances for many sensors: the arithmetic of `cone_scalar`, with numpy, to the last bit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats, Integers
from ciberrato.geometry.visible_faces import LONGEST, SECTORS, SECTORS_PER_RADIAN
from ciberrato.infrared.cone_pairs import IN_LINE
from ciberrato.infrared.cone_scalar import COS, TAN, single_cone_distances
from ciberrato.infrared.face_tables import NOWHERE, LabTables

_ROUNDS = (0, 3, 6, 12, LONGEST)
"""Faces are looked at in rounds; most sensors have found the nearest one after the first."""


def many_cone_distances(
    tables: LabTables, x: Floats, y: Floats, direction: Floats, cosine: Floats, sine: Floats
) -> Floats:
    """Compute the distances that sensors measure.

    Parameters
    ----------
    tables : LabTables
    x, y : array, shape (n,)
        Places of the sensors.
    direction, cosine, sine : array, shape (n,)
        Their axes in radians, wrapped once.

    Returns
    -------
    array, shape (n,)
        Units; infinite where no wall is seen.
    """
    rows = tables.rows_at(x, y)
    sectors = np.floor(direction * SECTORS_PER_RADIAN).astype(np.int64) % SECTORS
    lists = rows * SECTORS + sectors
    seen = tables.seen.reshape(-1, LONGEST + 1, 2)
    nearest = np.full(x.size, np.inf)
    alone = rows == NOWHERE
    waiting = np.flatnonzero(~alone)
    for begin, end in pairwise(_ROUNDS):
        chosen = lists[waiting]
        found, on_face = _nearest_of(
            tables.faces,
            seen[chosen, begin:end, 1].astype(np.int64),
            seen[chosen, begin:end, 0] < np.inf,
            *(array[waiting, np.newaxis] for array in (x, y, cosine, sine)),
        )
        np.minimum(nearest[waiting], found, out=found)
        nearest[waiting] = found
        alone[waiting[on_face]] = True
        unlooked_at = np.minimum(seen[chosen, end, 0], seen[chosen, LONGEST, 0])  # a list may be shorter
        waiting = waiting[(found > unlooked_at) & ~on_face]
        if waiting.size == 0:
            break
    alone[waiting] = True  # the list ends before the nearest wall
    for sensor in np.flatnonzero(alone).tolist():
        place = float(x[sensor]), float(y[sensor])
        nearest[sensor] = single_cone_distances(tables.walls, *place, [float(direction[sensor])], 0.0)[0]
    return nearest


def _nearest_of(
    faces: Floats,
    which: Integers,
    listed: NDArray[np.bool_],
    x: Floats,
    y: Floats,
    cosine: Floats,
    sine: Floats,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Find the nearest of each sensor's faces, and whether the sensor lies on one.

    Parameters
    ----------
    faces : array, shape (faces, 9)
    which : array of int, shape (n, k)
        The faces of each sensor.
    listed : array of bool, shape (n, k)
        Mask of those that count.
    x, y, cosine, sine : array, shape (n, 1)
    """
    chosen = faces[which]
    ex, ey = chosen[..., 2], chosen[..., 3]
    dx, dy = chosen[..., 0] - x, chosen[..., 1] - y
    area = dx * ey - dy * ex
    v, ve = dy * cosine - dx * sine, ey * cosine - ex * sine
    u_tan, ue_tan = (dx * cosine + dy * sine) * TAN, (ex * cosine + ey * sine) * TAN
    lo, lo_slope = v - u_tan, ve - ue_tan
    hi, hi_slope = v + u_tan, ve + ue_tan
    lo_left, lo_end_left = lo > 0.0, lo + lo_slope > 0.0
    hi_left, hi_end_left = hi > 0.0, hi + hi_slope > 0.0
    squared = dx * dx + dy * dy
    in_line = (area > -IN_LINE) & (area < IN_LINE)
    on_face = in_line & listed & (squared + dx * ex + dy * ey <= IN_LINE)
    # A face seen edge-on counts by its corners alone, one beside the cone not at all.
    crossed = listed & ~in_line & ~(lo_left & lo_end_left) & (hi_left | hi_end_left)
    nearest = np.where(listed & ~lo_left & hi_left, np.sqrt(squared), np.inf)
    for crosses, slope in (
        ((v > 0.0) != (v + ve > 0.0), ve),
        (lo_left != lo_end_left, lo_slope * COS),
        (hi_left != hi_end_left, hi_slope * COS),
    ):
        hit = np.divide(area, slope, out=np.full(area.shape, np.inf), where=crosses & crossed)
        np.minimum(nearest, np.where(hit >= 0.0, hit, np.inf), out=nearest)
    return np.asarray(nearest.min(axis=1)), np.asarray(on_face.any(axis=1))
