"""Evidence of the GPS on the position after a jump, when the offset is known."""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.pose_belief import PoseBelief

DOUBT = 0.02
"""Probability that an offset is wrong all the same, and the place may be anywhere."""


class PlaceDensity:
    """A normal distribution of the place for every heading, and a small share for everywhere.

    Parameters
    ----------
    mean : array, shape (bins, 2)
        Units, of a belief's bins.
    variance : float
        Along each axis, in units squared.
    """

    def __init__(self, mean: Floats, variance: float) -> None:
        self.mean = mean
        self.variance = variance

    def at(self, belief: PoseBelief, row: int) -> Floats:
        """Return the density at all squares for one bin, in probability a square; shape (squares,)."""
        lattice = belief.lattice
        x0, y0 = lattice.origin + belief.offset[row] - self.mean[row]
        along_x = np.exp(-0.5 * (x0 + lattice.resolution * np.arange(lattice.nx)) ** 2 / self.variance)
        along_y = np.exp(-0.5 * (y0 + lattice.resolution * np.arange(lattice.ny)) ** 2 / self.variance)
        line, column = np.divmod(lattice.site, lattice.nx)
        return self._mixed(along_x[column] * along_y[line], belief)

    def probability(self, belief: PoseBelief) -> float:
        """Return how much of the density is in the lab's free squares, for the bin where that is most of all.

        Parameters
        ----------
        belief : PoseBelief
        """
        return max(float(self.at(belief, row).sum()) for row in range(0, belief.bins, 9)) - DOUBT

    def listed(self, belief: PoseBelief) -> Floats:
        """Return the density at each state of a list."""
        x, y = belief.places(belief.bin, belief.square)
        off_x, off_y = x - self.mean[belief.bin, 0], y - self.mean[belief.bin, 1]
        return self._mixed(np.exp(-0.5 * (off_x**2 + off_y**2) / self.variance), belief)

    def _mixed(self, near: Floats, belief: PoseBelief) -> Floats:
        share = belief.lattice.resolution**2 / (2.0 * math.pi * self.variance)
        return np.asarray((1.0 - DOUBT) * share * near + DOUBT / belief.lattice.everywhere)


def weigh_place(belief: PoseBelief, before: PlaceDensity | None, after: PlaceDensity) -> None:
    """Multiply a belief by what a reading has changed in the density of the place; it is not normalized.

    Parameters
    ----------
    belief : PoseBelief
    before : PlaceDensity or None
        As it was foreseen without the reading; None: nothing was known.
    after : PlaceDensity
    """
    if belief.dense is None:
        ratio = after.listed(belief)
        if before is not None:
            ratio /= before.listed(belief)
        belief.weight *= ratio.astype(np.float32)
        return
    for row in range(belief.bins):
        ratio = after.at(belief, row)
        if before is not None:
            ratio /= before.at(belief, row)
        belief.dense[row, :-1] *= ratio.astype(np.float32)
