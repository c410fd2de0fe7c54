r"""A kernel for every command: where the robot may arrive, relative to where it was.

.. math:: p(x' | u, x) = K_u(x' - x)

Probabilistic Robotics, table 4.1 line 3 with a motion model that is the same everywhere.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.convolution import Edge, convolve_all


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandKernel:
    """Displacements and their probabilities.

    Attributes
    ----------
    weights : array_like
        As many axes as the belief; 0 or more, sum to 1.
    first : tuple of int
        Displacement in cells that weights[0, ..., 0] stands for.
    """

    weights: FloatArray
    first: tuple[int, ...]

    def __post_init__(self) -> None:
        weights = np.array(self.weights, dtype=float)
        if weights.ndim != len(self.first):
            raise ValueError(f"a kernel of {weights.ndim} axes needs as many first displacements")
        if not (weights >= 0.0).all() or abs(weights.sum() - 1.0) > 1e-9:
            raise ValueError(f"kernel weights must be 0 or more and sum to 1, not {weights.sum()}")
        weights.setflags(write=False)
        object.__setattr__(self, "weights", weights)

    @classmethod
    def from_displacements(cls, probability: Mapping[tuple[int, ...], float]) -> CommandKernel:
        """Make a kernel from {displacement: probability}."""
        places = np.array(list(probability))
        first = places.min(axis=0)
        weights = np.zeros(places.max(axis=0) - first + 1)
        for place, value in probability.items():
            weights[tuple(np.subtract(place, first))] = value
        return cls(weights=weights, first=tuple(int(i) for i in first))


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelMotion:
    """One kernel for each command.

    Attributes
    ----------
    kernels : mapping of command to CommandKernel
        Any hashable commands.
    edges : tuple of {"wrap", "stay", "lose"}
        One for each axis of the belief.
    """

    kernels: Mapping[Any, CommandKernel]
    edges: tuple[Edge, ...]

    def predict(self, belief: ArrayLike, control: Hashable) -> FloatArray:
        """Move a belief by the kernel of a command; ValueError if there is none."""
        if control not in self.kernels:
            raise ValueError(
                f"no kernel for command {control!r}; there are {', '.join(map(repr, self.kernels))}"
            )
        kernel = self.kernels[control]
        return convolve_all(belief, kernel.weights, kernel.first, edges=self.edges)
