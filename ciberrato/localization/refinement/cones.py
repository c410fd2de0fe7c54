"""IR distances at many poses: `ciberrato.infrared.cone_arrays`, in machine code where that is loaded."""

from __future__ import annotations

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.geometry.visible_faces import SECTORS, SECTORS_PER_RADIAN
from ciberrato.infrared.cone_arrays import many_cone_distances
from ciberrato.infrared.cone_scalar import single_cone_distances
from ciberrato.infrared.face_tables import LabTables
from ciberrato.localization.belief import compiled


def cone_distances(
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
        Units; infinite where no wall is seen. The same with machine code and without, to the last bit.
    """
    kernels = compiled.kernels()
    if kernels is None:
        return many_cone_distances(tables, x, y, direction, cosine, sine)
    rows = tables.rows_at(x, y)
    sectors = np.floor(direction * SECTORS_PER_RADIAN).astype(np.int64) % SECTORS
    found: Floats = kernels.cone_distances(tables.faces, tables.seen, rows, sectors, x, y, cosine, sine)
    for sensor in np.flatnonzero(np.isnan(found)).tolist():
        place = float(x[sensor]), float(y[sensor])
        found[sensor] = single_cone_distances(tables.walls, *place, [float(direction[sensor])], 0.0)[0]
    return found
