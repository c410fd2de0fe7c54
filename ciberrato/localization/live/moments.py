"""The belief over cells at chosen moments of a run, kept while the filter passes them."""

from __future__ import annotations

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.world.lab import CELL_SIZE, Lab


class CellMoments:
    """Keeps what the filter believed of the cells before the run, and at each moment that is marked.

    Parameters
    ----------
    lab : Lab
    """

    def __init__(self, lab: Lab) -> None:
        self._lab = lab
        self._prior: Floats | None = None
        self._marked: list[int] = []
        self._kept: list[Floats] = []

    def begin(self, belief: PoseBelief) -> None:
        """Store the belief before the first message."""
        self._prior = cell_probabilities(self._lab, belief)

    def mark(self, time: int) -> None:
        """Request the belief at a message, not older than earlier requests; time in cycles."""
        self._marked.append(time)

    def take(self, belief: PoseBelief, time: int) -> None:
        """Store a belief for all marks up to the time of its last message."""
        while len(self._kept) < len(self._marked) and self._marked[len(self._kept)] <= time:
            self._kept.append(cell_probabilities(self._lab, belief))

    @property
    def blocks(self) -> Floats:
        """The belief before the run, and at each mark passed; shape (blocks, rows, columns), row 0 below.

        Raises
        ------
        ValueError
            If the filter has not begun.
        """
        if self._prior is None:
            raise ValueError("no belief yet: the filter has no tables")
        return np.array([self._prior, *self._kept])


def cell_probabilities(lab: Lab, belief: PoseBelief) -> Floats:
    """Sum a belief up over headings and the places in each cell.

    Parameters
    ----------
    lab : Lab
    belief : PoseBelief

    Returns
    -------
    ndarray, shape (rows, columns)
        Row 0 is the bottom row; sums to 1.
    """
    size = lab.rows * lab.columns
    if belief.dense is not None:  # so many states that where in its square each of them is does not matter
        cells = np.bincount(belief.lattice.cell, belief.square_weights(), size)
    else:
        bins, squares, weights = belief.listed()
        x, y = belief.places(bins, squares)
        column = np.clip((x // CELL_SIZE).astype(np.int64), 0, lab.columns - 1)
        row = np.clip((y // CELL_SIZE).astype(np.int64), 0, lab.rows - 1)
        cells = np.bincount(row * lab.columns + column, weights, size)
    return np.asarray(cells.reshape(lab.rows, lab.columns) / cells.sum())
