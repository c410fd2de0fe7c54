"""Turn, drive, turn over all states of a large grid in numpy: the prediction of `TurnDriveTurn`.

Each heading's image is one long row of numbers, with zeros between the rows of places as wide as the longest
drive: to move it by whole cells is then to add a piece of one long row to another, which numpy does several
times as fast as pieces of many short rows. What leaves a row of places ends in the zeros, and is lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.motion.lattice import LatticeKernels

# Kernels of more cells than this are better applied by Fourier transform (`passes.move`).
_WIDE = 400


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
    compiled.share(
        lambda begin, end: np.matmul(
            first.T, belief[begin:end].swapaxes(1, 2), out=places[:, begin:end].swapaxes(0, 1)
        ),
        rows,
        belief.size,
    )
    order = np.argsort(kernels.kernel, kind="stable")
    ends = np.searchsorted(kernels.kernel[order], np.arange(count + 1))
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
            onto[:] = 0.0
            for step, share in zip(steps[ends[k] : ends[k + 1]], shares[ends[k] : ends[k + 1]], strict=True):
                source = image[max(0, -step) : len(image) - max(0, step)]
                target = onto[max(0, step) : len(image) - max(0, -step)]
                product = np.multiply(source, share, out=scratch[: len(source)])
                np.add(target, product, out=target)
            if inside is not None:
                np.multiply(onto, inside, out=onto)

    compiled.share(move, count, belief.size)
    after = np.empty_like(belief)
    arrived = driven[:, :, :columns].transpose(1, 2, 0)
    compiled.share(
        lambda begin, end: np.matmul(arrived[begin:end], last, out=after[begin:end]), rows, belief.size
    )
    return after
