r"""A kernel for every command: where the robot may arrive, relative to where it was.

.. math:: p(x' | u, x) = K_u(x' - x)

Probabilistic Robotics, table 4.1 line 3 with a motion model that is the same everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.convolution import Edge, convolve_all
from ciberrato.bayes.motion.inputs import check_belief, look_up, whole_numbers
from ciberrato.reprs import short_repr

_MOST_CELLS = 10_000_000


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

    __repr__ = short_repr

    weights: FloatArray
    first: tuple[int, ...]

    def __post_init__(self) -> None:
        weights = np.array(self.weights, dtype=float)
        first = whole_numbers(self.first, "a displacement")
        if weights.ndim != len(first):
            raise ValueError(f"a kernel of {weights.ndim} axes needs as many first displacements")
        if not (weights >= 0.0).all() or abs(weights.sum() - 1.0) > 1e-9:
            raise ValueError(f"kernel weights must be 0 or more and sum to 1, not {weights.sum()}")
        weights.setflags(write=False)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "first", first)

    @classmethod
    def from_displacements(cls, probability: Mapping[Any, float]) -> CommandKernel:
        """Create a kernel from {displacement: probability}; a displacement is a tuple of ints, or one int."""
        places = {whole_numbers(place, "a displacement"): p for place, p in probability.items()}
        if len({len(place) for place in places}) != 1 or len(places) < len(probability):
            raise ValueError("a kernel needs displacements, all different and of as many axes")
        first = tuple(min(along) for along in zip(*places, strict=True))
        last = tuple(max(along) for along in zip(*places, strict=True))
        shape = [b - a + 1 for a, b in zip(first, last, strict=True)]
        if math.prod(shape) > _MOST_CELLS:
            raise ValueError(f"displacements from {first} to {last} cells are too far apart for a kernel")
        weights = np.zeros(shape)
        for place, value in places.items():
            weights[tuple(i - a for i, a in zip(place, first, strict=True))] = value
        return cls(weights=weights, first=first)


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelMotion:
    """One kernel for each command.

    Attributes
    ----------
    kernels : mapping of command to CommandKernel
        Any hashable commands; lists and arrays mean the tuple of their elements.
    edges : tuple of {"wrap", "stay", "lose"}
        One for each axis of the belief.
    """

    __repr__ = short_repr

    kernels: Mapping[Any, CommandKernel]
    edges: tuple[Edge, ...]

    def predict(self, belief: ArrayLike, control: Any) -> FloatArray:
        """Move a belief by the kernel of a command; ValueError if there is none."""
        kernel = look_up(self.kernels, control, "kernel")
        return convolve_all(check_belief(belief), kernel.weights, kernel.first, edges=self.edges)
