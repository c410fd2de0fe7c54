"""Motion over an (x, y, heading) grid that is the same at every place but not at every heading."""

from __future__ import annotations

import numpy as np

from ciberrato.bayes.arraytypes import FloatArray, IntArray

_BLOCK = 64


def apply_pose_kernel(belief: FloatArray, cells: IntArray, kernel: FloatArray) -> FloatArray:
    """Move a belief by a kernel; mass that leaves the grid is lost.

    Parameters
    ----------
    belief : FloatArray, shape (x, y, headings)
        Any sum.
    cells : IntArray, shape (n, 2)
        Displacements along x and y; one may occur several times.
    kernel : FloatArray, shape (n, headings, headings)
        [k, before, after]: probability of displacement k and the heading after, given the heading before.

    Returns
    -------
    FloatArray, shape (x, y, headings)
    """
    rows, columns, headings = belief.shape
    result = np.zeros_like(belief)
    flat = belief.reshape(-1, headings)
    for start in range(0, len(cells), _BLOCK):
        block = kernel[start : start + _BLOCK]
        turned = (flat @ block.transpose(1, 0, 2).reshape(headings, -1)).reshape(
            rows, columns, len(block), headings
        )
        for k, (i, j) in enumerate(cells[start : start + _BLOCK]):
            if abs(i) < rows and abs(j) < columns:
                to = slice(max(i, 0), rows + min(i, 0)), slice(max(j, 0), columns + min(j, 0))
                taken = slice(max(-i, 0), rows + min(-i, 0)), slice(max(-j, 0), columns + min(-j, 0))
                result[to] += turned[taken][:, :, k]
    return result
