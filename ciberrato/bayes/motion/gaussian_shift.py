r"""Moving along one axis by a measured displacement with Gaussian noise.

.. math:: p(x' | u, x) = N(x' - x;\; u, \sigma^2)

Mean and variance are kept exactly wherever a distribution over whole cells can have them; smaller motion is
carried over to the next step instead of being rounded away (`predict_carried`). Probabilistic Robotics,
section 8.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.convolution import Edge, Kernel, convolve, gaussian_kernel, whole_steps
from ciberrato.bayes.motion.inputs import check_belief
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussianShift:
    """Gaussian displacement along one axis.

    Attributes
    ----------
    cell : float
        Cell width along the axis; units of the controls.
    sigma : float
        Standard deviation of a step, in these units, 0 or more.
    edge : {"wrap", "stay", "lose"}
        Treatment of mass that leaves the axis.
    axis : int
        Axis of the belief array.
    tail : float
        Mass of the Gaussian that may be cut off at a step.
    """

    __repr__ = short_repr

    cell: float
    sigma: float
    edge: Edge
    axis: int = -1
    tail: float = 1e-9

    def __post_init__(self) -> None:
        if not 0.0 < self.cell < math.inf or not 0.0 <= self.sigma < math.inf:
            raise ValueError(
                f"need a positive cell and a sigma of 0 or more, both finite, not {self.cell}, {self.sigma}"
            )

    def kernel(self, control: float) -> Kernel:
        """Return the distribution of a displacement, with what was cut off or spread too far."""
        return gaussian_kernel(self._cells(control), (self.sigma / self.cell) ** 2, tail=self.tail)

    def predict(self, belief: ArrayLike, control: float) -> FloatArray:
        """Move a belief by `control` units; small steps spread it (`kernel(control).excess_variance`)."""
        kernel = self.kernel(control)
        return convolve(check_belief(belief), kernel.weights, kernel.first, edge=self.edge, axis=self.axis)

    def predict_carried(self, belief: ArrayLike, control: float, carry: float) -> tuple[FloatArray, float]:
        """Move a belief by whole cells and carry the fraction over.

        Parameters
        ----------
        belief : array_like
            Its cell i stands for the coordinate of the grid's cell i plus `carry`.
        control, carry : float
            In units; the carry is 0 at first, then what the last call returned.

        Returns
        -------
        belief : FloatArray
            Moved and spread; no variance is added for the sake of the fraction.
        carry : float
            Within half a cell.
        """
        steps, left = whole_steps(self._cells(control), carry / self.cell)
        kernel = gaussian_kernel(0.0, (self.sigma / self.cell) ** 2, tail=self.tail)
        moved = convolve(
            check_belief(belief), kernel.weights, kernel.first + steps, edge=self.edge, axis=self.axis
        )
        return np.asarray(moved), left * self.cell

    def _cells(self, control: float) -> float:
        if not math.isfinite(control):
            raise ValueError(f"a displacement must be finite, not {control}")
        return float(control) / self.cell
