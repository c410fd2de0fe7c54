"""Choice of the steps of a run that get a panel: a long tail in which nothing happens is not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.offline.summary import peak
from ciberrato.world.coordinates import Cell

LEAST_CUT = 2
"""Fewer panels than this are not worth a note."""

_CERTAIN = 0.9995
"""Least probability that three decimals show as 1.000."""


class Choice(NamedTuple):
    """Choice of the steps to draw.

    Attributes
    ----------
    blocks : list of int
        In order, 0 = the prior.
    note : str
        Note about steps that are left out; empty if none are.
    """

    blocks: list[int]
    note: str


def without_tail(quiet: Sequence[bool], reason: str) -> Choice:
    """Remove the quiet end of a run except its first block, from which on it is quiet, and its last.

    Parameters
    ----------
    quiet : sequence of bool
        For each block, whether it shows nothing new.
    reason : str
        Reason for those that are left out.

    Returns
    -------
    Choice
    """
    count = len(quiet)
    begin = count
    while begin and quiet[begin - 1]:
        begin -= 1
    cut = range(begin + 1, count - 1)
    if len(cut) < LEAST_CUT:
        return Choice(list(range(count)), "")
    # Block 0 is the prior, block 1 is step 0.
    note = f"steps {cut[0] - 1} to {cut[-1] - 1} are not drawn: {reason}"
    return Choice([index for index in range(count) if index not in cut], note)


def telling_blocks(beliefs: NDArray[np.float64], true_cells: Sequence[Cell | None] | None = None) -> Choice:
    """Choose the blocks of a belief file: those that are certain to the end are all alike.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
    true_cells : sequence of (row, column) or None
        A step that is certain of another cell than the true one is always drawn.

    Returns
    -------
    Choice
    """

    def quiet(index: int) -> bool:
        belief = beliefs[index]
        if np.isnan(belief).any() or float(belief.max()) < _CERTAIN:
            return False
        true = None if true_cells is None else true_cells[index]
        return true is None or peak(belief).cells[0] == true

    right = "" if true_cells is None else ", which is the true one"
    return without_tail(
        [quiet(index) for index in range(len(beliefs))], f"p = 1.000 for one cell in each{right}"
    )
