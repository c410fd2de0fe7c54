"""Turn, drive, turn over all states of a large grid in numpy: the prediction of `TurnDriveTurn`.

Each heading's image is one long row of numbers, with zeros between the rows of places as wide as the longest
drive: to move it by whole cells is then to add a piece of one long row to another, which numpy does several
times as fast as pieces of many short rows. What leaves a row of places ends in the zeros, and is lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.motion.lattice import LatticeKernels

# Kernels of more cells than this are better applied by Fourier transform (`passes.move`).
_WIDE = 400
# Headings of a block of a turn's matrix. Row by row of places, blocks stay in the cache.
_COLUMNS = 36


def fits(kernels: LatticeKernels) -> bool:
    """Return whether kernels are few enough entries each."""
    return len(kernels.kernel) > 0 and int(np.bincount(kernels.kernel).max()) <= _WIDE


def predict_long_rows(
    belief: FloatArray,
    free: BoolArray | None,
    first: FloatArray,
    last: FloatArray,
    kernels: LatticeKernels,
    work: dict[Any, FloatArray],
) -> FloatArray:
    """Return the belief after a turn, a drive and a turn; images are `passes.move`'s to the last bit.

    Parameters
    ----------
    belief : FloatArray, shape (x, y, heading)
    free : BoolArray, shape (x, y), optional
        Mass that ends elsewhere is lost.
    first, last : FloatArray, shapes (headings, directions) and (directions, headings)
        Of the belief's precision.
    kernels : LatticeKernels
        One for each direction.
    work : dict
        Holds arrays from call to call: fresh ones of this size cost page faults.
    """
    rows, columns, _ = belief.shape
    count, kind = first.shape[1], belief.dtype
    wide = columns + int(np.abs(kernels.cells[:, 1]).max())
    key = "long rows", count, wide, kind
    if key not in work:
        work.clear()
        work[key] = np.zeros((2, count, rows, wide), dtype=kind)
    images, driven = work[key]
    # The zeros stay: only places are written.
    places = images[:, :, :columns]
    turns = _parts(first)

    def turn(begin: int, end: int) -> None:
        for row in range(begin, end):
            for before, after, part in turns:
                np.matmul(part.T, belief[row][:, before].T, out=places[after, row])

    compiled.share(turn, rows, belief.size)
    order = np.argsort(kernels.kernel, kind="stable")
    ends = np.searchsorted(kernels.kernel[order], np.arange(count + 1)).tolist()
    steps = (kernels.cells @ np.array([wide, 1]))[order].tolist()
    shares = kernels.weights[order].tolist()
    inside = None
    if free is not None:
        inside = np.zeros((rows, wide), dtype=kind)
        inside[:, :columns] = free
        inside = inside.ravel()

    def move(begin: int, end: int) -> None:
        scratch = np.empty(rows * wide, dtype=kind)
        for k in range(begin, end):
            image, onto = images[k].ravel(), driven[k].reshape(-1)
            if ends[k] == ends[k + 1]:
                onto[:] = 0.0
            for entry in range(ends[k], ends[k + 1]):
                step, share = steps[entry], shares[entry]
                begins, stops = max(0, step), len(image) - max(0, -step)
                source, target = image[max(0, -step) : len(image) - max(0, step)], onto[begins:stops]
                if entry == ends[k]:
                    onto[:begins] = onto[stops:] = 0.0
                    np.multiply(source, share, out=target)
                else:
                    np.multiply(source, share, out=scratch[: len(source)])
                    np.add(target, scratch[: len(source)], out=target)
            if inside is not None:
                np.multiply(onto, inside, out=onto)

    compiled.share(move, count, belief.size)
    after = np.empty_like(belief)
    turns = _parts(last)

    def turn_again(begin: int, end: int) -> None:
        for row in range(begin, end):
            for before, onto, part in turns:
                np.matmul(driven[before, row, :columns].T, part, out=after[row][:, onto])

    compiled.share(turn_again, rows, belief.size)
    return after


def _parts(matrix: FloatArray) -> list[tuple[slice | IntArray, slice, FloatArray]]:
    """Return a matrix in blocks of columns, without the rows that are zero in a block.

    Returns
    -------
    list of (rows, columns, block)
        Rows are a slice, where those that are not zero lie side by side.
    """
    count, parts = matrix.shape[1], []
    for begin in range(0, count, _COLUMNS):
        columns = slice(begin, min(begin + _COLUMNS, count))
        held = np.flatnonzero(matrix[:, columns].any(axis=1))
        held = held if len(held) else np.zeros(1, dtype=np.intp)
        rows: slice | IntArray = held
        if len(held) == held[-1] - held[0] + 1:
            rows = slice(int(held[0]), int(held[-1]) + 1)
        parts.append((rows, columns, np.ascontiguousarray(matrix[rows, columns])))
    if 2 * sum(part.size for *_, part in parts) > matrix.size:
        return [(slice(None), slice(None), matrix)]
    return parts
