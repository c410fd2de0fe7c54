"""A motion model that carries fractions of cells, for a filter.

`MarkovFilter(prior, Carried(model).predict)` moves small steps without spreading the belief.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.motion.passes import PoseCarry
from ciberrato.bayes.spaces import StateSpace


class _CarryingModel(Protocol):
    @property
    def space(self) -> StateSpace: ...

    def predict_carried(
        self, belief: ArrayLike, control: Any, carry: PoseCarry
    ) -> tuple[FloatArray, PoseCarry]: ...


class Carried:
    """Keep the carry of a model over poses from one prediction to the next; one object for one filter.

    Parameters
    ----------
    model : object
        With `space` and `predict_carried`, as `TurnDriveTurn`, `GaussianOdometry`, `VelocityMotion` and
        `OmnidirectionalOdometry`.

    Attributes
    ----------
    carry : PoseCarry
        Part of the belief that its array does not hold at present.
    """

    def __init__(self, model: _CarryingModel) -> None:
        self._model = model
        self.carry = PoseCarry.none(model.space)

    def predict(self, belief: ArrayLike, control: Any) -> FloatArray:
        """Move a belief, the one that this object moved last, maybe corrected since."""
        belief, self.carry = self._model.predict_carried(belief, control, self.carry)
        return belief

    def centres(self) -> FloatArray:
        """Return the poses that the cells stand for now, (*shape, 3): where sensor models are evaluated.

        They are less than half a cell from the cells' own centres; headings may leave the axis by as much.
        """
        poses = self._model.space.centres()
        poses[..., :2] += self.carry.offset
        poses[..., 2] += self.carry.turn
        return poses

    def mean(self, belief: ArrayLike) -> FloatArray:
        """Return the mean pose, (3,), of a belief with mass; the heading's is circular, in [-pi, pi]."""
        weights = np.asarray(belief, dtype=float).ravel()
        poses = self.centres().reshape(-1, 3)
        place = weights @ poses[:, :2] / weights.sum()
        heading = np.angle(weights @ np.exp(1j * poses[:, 2]))
        return np.array([place[0], place[1], float(heading)])
