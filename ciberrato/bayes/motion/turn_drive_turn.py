r"""Odometry as turn, drive, turn, in three passes: for large grids and for noise finer than the cells.

The heading is spread by :math:`W(\delta_1, \sigma_1^2)`, each heading's image is moved along it by
:math:`N(\tau, \sigma_\tau^2)`, and the heading is spread again by :math:`W(\delta_2, \sigma_2^2)`:
Probabilistic Robotics, table 5.6, with distributions in the place of samples. The direction of the drive is
taken from the heading cells, so these should be fine against the way driven (a way of 1 m in steps of 2
degrees: 1.7 cm sideways). The work for N states is two products with a small matrix and some ten additions a
state, whatever the noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.convolution import gaussian_kernel
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading, Prediction
from ciberrato.bayes.spaces import StateSpace


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnDriveTurn:
    """Three passes over an (x, y, heading) grid.

    Mass that leaves the grid, or ends in a cell that is not free, is lost.

    Attributes
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    noise : OdometryNoise
        Standard deviations.
    free : BoolArray, shape (x, y), optional
        Where the robot can be; everywhere if None.
    window : float
        Cut the drive off beyond this many sigmas; drops at most `erfc(window / sqrt 2)` of it, which is
        reported.
    skip_below : float
        Leave out headings whose whole image holds less mass than this.
    """

    space: StateSpace
    noise: OdometryNoise
    free: BoolArray | None = None
    window: float = 4.0
    skip_below: float = 0.0
    _work: list[FloatArray] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if len(self.space.axes) != 3 or not math.isclose(self.space.axes[2].length, 2.0 * math.pi):
            raise ValueError("odometry needs axes x, y, heading, the last over a whole turn")
        if self.free is not None and self.free.shape != self.space.shape[:2]:
            raise ValueError(f"the free cells have shape {self.free.shape}, the space {self.space.shape[:2]}")
        if not self.window > 0.0 or not self.skip_below >= 0.0:
            raise ValueError("the window must be positive and the mass to skip 0 or more")

    def predict(self, belief: ArrayLike, control: OdometryReading) -> FloatArray:
        """Move a belief, shape (x, y, heading), by an odometry reading. Not normalized."""
        return self.predict_with_losses(belief, control).belief

    def predict_with_losses(self, belief: ArrayLike, control: OdometryReading) -> Prediction:
        """Move a belief and say what was left out.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            Sums to 1.
        control : OdometryReading
            The relative motion measured.

        Returns
        -------
        Prediction
        """
        belief = np.asarray(belief, dtype=float)
        if belief.shape != self.space.shape:
            raise ValueError(f"belief has shape {belief.shape}, the space {self.space.shape}")
        rows, columns, headings = belief.shape
        rot1, trans, rot2 = self.noise.sigmas(control)
        # Heading first, so that each heading's image lies in one piece for the drive; the transposition is
        # the product's.
        if not self._work:
            # Kept from call to call: fresh arrays of this size cost as much in page faults as the work on
            # them.
            self._work.extend(np.empty((headings, rows * columns)) for _ in range(2))
        images, driven = self._work
        np.matmul(self.turn_matrix(control.rot1, rot1).T, belief.reshape(-1, headings).T, out=images)
        driven[...] = 0.0
        scratch = np.empty((rows, columns))
        skipped = 0.0
        for k, heading in enumerate(self.space.axes[2].centres):
            image = images[k].reshape(rows, columns)
            mass = float(image.sum()) if self.skip_below > 0.0 else math.inf
            if mass < self.skip_below:
                skipped += mass
                continue
            self._drive(
                image, driven[k].reshape(rows, columns), float(heading), control.trans, trans, scratch
            )
        if self.free is not None:
            driven *= self.free.ravel()
        moved = driven.T @ self.turn_matrix(control.rot2, rot2)
        return Prediction(moved.reshape(belief.shape), skipped, math.erfc(self.window / math.sqrt(2.0)))

    def turn_matrix(self, turn: float, sigma: float) -> FloatArray:
        """Give p(heading after | heading before), shape (before, after), with the exact mean and spread."""
        axis = self.space.axes[2]
        kernel = gaussian_kernel(turn / axis.cell, (sigma / axis.cell) ** 2)
        row = np.zeros(axis.size)
        np.add.at(row, (kernel.first + np.arange(len(kernel.weights))) % axis.size, kernel.weights)
        return np.stack([np.roll(row, k) for k in range(axis.size)])

    def drive_kernel(self, heading: float, trans: float, sigma: float) -> dict[tuple[int, int], float]:
        """Give the distribution over displacements in cells, {(x, y): weight}, of driving along a heading.

        The Gaussian along the way is sampled four times a cell, and each sample shared by the four cells
        around it: the mean is exact, and the spread grows by up to a quarter of a square cell along either
        axis.
        """
        spacing = min(axis.cell for axis in self.space.axes[:2]) / 4.0
        # At least seven samples, so that a spread finer than the cells still has its variance.
        count = max(3, math.ceil(self.window * sigma / spacing))
        places = np.linspace(-1.0, 1.0, 2 * count + 1) * self.window
        weights = np.exp(-0.5 * places**2)
        weights /= weights.sum()
        way = trans + sigma * places
        x = way * math.cos(heading) / self.space.axes[0].cell
        y = way * math.sin(heading) / self.space.axes[1].cell
        i, j = np.floor(x).astype(int), np.floor(y).astype(int)
        u, v = x - i, y - j
        kernel: dict[tuple[int, int], float] = {}
        for di, dj, share in (
            (0, 0, (1 - u) * (1 - v)),
            (1, 0, u * (1 - v)),
            (0, 1, (1 - u) * v),
            (1, 1, u * v),
        ):
            for a, b, w in zip(i + di, j + dj, weights * share, strict=True):
                if w > 1e-15:
                    kernel[int(a), int(b)] = kernel.get((int(a), int(b)), 0.0) + float(w)
        return kernel

    def _drive(
        self,
        image: FloatArray,
        target: FloatArray,
        heading: float,
        trans: float,
        sigma: float,
        scratch: FloatArray,
    ) -> None:
        rows, columns = image.shape
        for (i, j), weight in self.drive_kernel(heading, trans, sigma).items():
            if abs(i) < rows and abs(j) < columns:
                to = slice(max(i, 0), rows + min(i, 0)), slice(max(j, 0), columns + min(j, 0))
                taken = image[max(-i, 0) : rows + min(-i, 0), max(-j, 0) : columns + min(-j, 0)]
                product = scratch[: taken.shape[0], : taken.shape[1]]
                np.multiply(taken, weight, out=product)
                target[to] += product
