r"""Any motion model at all, as a matrix over the raveled states.

.. math:: \text{matrix}[x, x'] = p(x' | u, x)

Rows are states before, columns states after (row-major order of the belief array). Dense, or sparse by
`scipy.sparse`. Probabilistic Robotics, table 4.1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.motion.inputs import check_belief, look_up
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class TransitionMatrix:
    """A matrix for every command.

    Attributes
    ----------
    matrices : mapping of command to matrix
        Any hashable commands; lists and arrays mean the tuple of their elements. Numpy arrays or scipy sparse
        matrices, (states, states), entries 0 or more, row sums at most 1 (what is missing is lost).
    """

    __repr__ = short_repr

    matrices: Mapping[Any, Any]

    def __post_init__(self) -> None:
        for command, matrix in self.matrices.items():
            if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
                raise ValueError(f"the matrix for {command!r} is not square: its shape is {matrix.shape}")
            sums = np.asarray(matrix.sum(axis=1)).ravel()
            if not matrix.min() >= 0.0 or not (sums <= 1.0 + 1e-9).all():
                raise ValueError(
                    f"the matrix for {command!r} has an entry that is negative or nan, or a row above 1"
                )

    def predict(self, belief: ArrayLike, control: Any) -> FloatArray:
        """Move a belief of any shape by the matrix of a command."""
        belief = check_belief(belief)
        matrix = look_up(self.matrices, control, "matrix")
        if matrix.shape[0] != belief.size:
            raise ValueError(f"a belief of {belief.size} states does not fit a matrix of {matrix.shape}")
        # Transposed from the left, which scipy's sparse matrices and numpy's dense ones both understand.
        return np.asarray(matrix.T @ belief.ravel()).reshape(belief.shape)


def transition_matrix(
    predict: Callable[[FloatArray, Any], FloatArray],
    shape: Sequence[int],
    control: Any,
    *,
    sparse: bool = False,
) -> Any:
    """Write any motion model out as a matrix, by moving a point mass from every state in turn.

    Parameters
    ----------
    predict : callable
        A motion model's `predict`.
    shape : sequence of int
        Shape of the beliefs that it takes.
    control : object
        The command.
    sparse : bool
        Give a `scipy.sparse.csr_array` instead of a dense array.

    Returns
    -------
    FloatArray or scipy.sparse.csr_array, shape (states, states)
    """
    size = int(np.prod(shape))
    rows = []
    for state in range(size):
        point = np.zeros(size)
        point[state] = 1.0
        row = predict(point.reshape(shape), control).ravel()
        if sparse:
            from scipy.sparse import csr_array

            row = csr_array(row[np.newaxis, :])
        rows.append(row)
    if sparse:
        from scipy.sparse import vstack

        return vstack(rows, format="csr")
    return np.stack(rows)
