"""The product of a belief and what the sensors say about its states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ciberrato.localization.belief import compiled
from ciberrato.localization.belief.pose_belief import PoseBelief

Factor = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""Codes of all states, shape (bins, squares), and the likelihood of each code."""


def multiply(belief: PoseBelief, factors: list[Factor], by_bin: NDArray[np.float32] | None) -> None:
    """Multiply a belief by likelihoods; it is not normalized.

    Parameters
    ----------
    belief : PoseBelief
    factors : list of (array, array)
        Codes and likelihood of each IR sensor.
    by_bin : array, shape (bins,), or None
        Likelihood of each bin of headings.
    """
    kernels = compiled.kernels()
    if belief.dense is None:
        for codes, table in factors:
            if kernels is not None:
                kernels.multiply_sparse(belief.weight, belief.bin, belief.square, codes, table)
            else:
                belief.weight *= table[codes[belief.bin, belief.square]]
        if by_bin is not None:
            belief.weight *= by_bin[belief.bin]
        return
    if kernels is not None:
        for codes, table in factors:
            kernels.multiply_dense(belief.dense, codes, table)
        if by_bin is not None:
            belief.dense *= by_bin[:, np.newaxis]
        return
    taken = np.empty(belief.lattice.size, np.float32)
    for row in range(belief.bins):
        weights = belief.dense[row, :-1]
        for codes, table in factors:
            table.take(codes[row], out=taken, mode="clip")
            weights *= taken
        if by_bin is not None:
            weights *= by_bin[row]
