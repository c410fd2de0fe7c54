"""The part of a live belief that goes into the log, for viewers: cells and modes, as often as they change."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ciberrato.localization.live.live_filter import LiveFilter

Cells = tuple[tuple[int, int, float], ...]
Modes = tuple[tuple[float, float, float, float], ...]

_EVERY = 5  # cycles
_LEAST = 0.001
_LEAST_MODE = 0.05
_MUCH = 0.05
"""Probability that must have gone to other cells for the cells to be logged again."""


class BeliefLog:
    """Says what of the belief is worth a place in the log.

    Parameters
    ----------
    live : LiveFilter
    rows, columns : int
        Rows and columns of the lab's cells.
    """

    def __init__(self, live: LiveFilter, rows: int, columns: int) -> None:
        self._live = live
        self._rows, self._columns = rows, columns
        self._logged: NDArray[np.float64] = np.zeros(rows * columns)

    def entries(self, time: int) -> tuple[Cells | None, Modes | None]:
        """Return the log's entries for a cycle.

        Parameters
        ----------
        time : int
            Simulated cycles so far.

        Returns
        -------
        cells : tuple of (int, int, float), or None
            Row (from the bottom), column and probability of the cells that have more than 0.001, rounded to
            3 decimals, if they have changed.
        modes : tuple of (float, float, float, float), or None
            x, y, degrees and probability of the poses that it may be, if they are several.
        """
        if time % _EVERY or self._live.filter is None:
            return None, None
        belief = self._live.filter.belief
        squares = np.bincount(belief.lattice.cell, belief.square_weights(), self._rows * self._columns)
        shares = np.asarray(squares, np.float64)
        cells: Cells | None = None
        if np.abs(shares - self._logged).sum() / 2.0 > _MUCH:
            self._logged = shares
            likely = np.flatnonzero(shares > _LEAST)
            cells = tuple(
                (int(cell) // self._columns, int(cell) % self._columns, round(float(shares[cell]), 3))
                for cell in likely
            )
        modes = tuple(
            (
                round(mode.x, 2),
                round(mode.y, 2),
                round(math.degrees(mode.heading), 1),
                round(mode.probability, 3),
            )
            for mode in self._live.modes()
            if mode.probability >= _LEAST_MODE
        )
        return cells, modes if len(modes) > 1 else None
