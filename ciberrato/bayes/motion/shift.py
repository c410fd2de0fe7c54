r"""Moving a known number of whole cells.

.. math:: p(x' | s, x) = [\,x' = x + s\,]

with edges that wrap (a circle), stop the mass (bounded) or absorb it. Probabilistic Robotics, section 2.4.2
with a deterministic motion model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.convolution import EDGES, Edge, fold
from ciberrato.bayes.motion.inputs import check_belief, whole_numbers
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """A shift along all axes.

    Attributes
    ----------
    edges : tuple of {"wrap", "stay", "lose"}
        One for each axis of the belief.
    """

    __repr__ = short_repr

    edges: tuple[Edge, ...]

    def __post_init__(self) -> None:
        for edge in self.edges:
            if edge not in EDGES:
                raise ValueError(f"unknown edge {edge!r}; choose one of {', '.join(EDGES)}")

    def predict(self, belief: ArrayLike, control: ArrayLike) -> FloatArray:
        """Shift a belief by `control` cells, a whole number for each axis, or the only one."""
        steps = whole_numbers(control, "a step")
        result = check_belief(belief)
        if not result.ndim == len(steps) == len(self.edges):
            raise ValueError(
                f"a belief of {result.ndim} axes needs as many steps and edges, not {len(steps)} and "
                f"{len(self.edges)}"
            )
        for axis, (step, edge) in enumerate(zip(steps, self.edges, strict=True)):
            if edge == "wrap":
                result = np.roll(result, step % result.shape[axis], axis=axis)
            else:
                result = fold(result, step, result.shape[axis], edge, axis)
        return np.array(result)
