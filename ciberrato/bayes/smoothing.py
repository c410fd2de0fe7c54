"""A recorded run looked at as a whole: smoothing (forward-backward) and the most likely path (Viterbi).

States are raveled. `log_likelihoods[t]` belongs to the state at time t, `transitions[t]` leads from time t to
t + 1; rows are states before. Matrices are dense, or sparse by `scipy.sparse`;
`ciberrato.bayes.motion.transition_matrix` writes any motion model out as one. The forward pass is the Bayes
filter of Probabilistic Robotics, table 2.1; the rest is the theory of hidden Markov models (Rabiner, A
Tutorial on Hidden Markov Models, Proceedings of the IEEE 77, 1989, sections III.A to III.C).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray, IntArray
from ciberrato.bayes.recovery import ImpossibleReadingError

# Steps that are normalized together, and the sum below which each is normalized by itself.
_BLOCK = 32
_SAFE_TOTAL = 1e-200


class Forward(NamedTuple):
    """The filter over a run.

    Attributes
    ----------
    predicted, filtered : FloatArray, shape (times, states)
        Beliefs before and after each reading.
    log_evidence : FloatArray, shape (times,)
        Natural logarithm of each reading's probability given the ones before; mass that a transition lost
        counts against it.
    """

    predicted: FloatArray
    filtered: FloatArray
    log_evidence: FloatArray


class Smoothed(NamedTuple):
    """Beliefs given the whole run.

    Attributes
    ----------
    smoothed : FloatArray, shape (times, states)
        Given all readings, those after included.
    forward : Forward
        Given the readings up to each time.
    """

    smoothed: FloatArray
    forward: Forward


def forward(prior: ArrayLike, log_likelihoods: ArrayLike, transitions: Any) -> Forward:
    """Run the filter.

    Parameters
    ----------
    prior : array_like, shape (states,)
        Belief at time 0 before its reading.
    log_likelihoods : array_like, shape (times, states)
        -inf where impossible.
    transitions : matrix or sequence of matrices
        One for all steps, or times - 1 of them; (states, states).

    Returns
    -------
    Forward

    Raises
    ------
    ImpossibleReadingError
        If no state explains a reading; the message says which.
    ValueError
        If shapes do not fit.
    """
    prior, scores, steps = _checked(prior, log_likelihoods, transitions)
    best = scores.max(axis=1, initial=-np.inf)
    with np.errstate(invalid="ignore"):
        likelihoods = np.exp(np.maximum(scores - best[:, np.newaxis], -745.0))
    likelihoods[~(scores > -np.inf)] = 0.0
    predicted, filtered = np.empty_like(scores), np.empty_like(scores)
    evidence = np.empty(len(scores))
    predicted[0] = prior / prior.sum()
    for start in range(0, len(scores), _BLOCK):
        block = slice(start, min(start + _BLOCK, len(scores)))
        if not _forward_block(block, predicted, filtered, likelihoods, steps, evidence):
            for time in range(block.start, block.stop):
                _forward_step(time, predicted, filtered, likelihoods, steps, evidence, scores, best)
    return Forward(predicted, filtered, np.log(evidence) + best)


def _move(belief: FloatArray, step: Any, out: FloatArray) -> None:
    if isinstance(step, np.ndarray):
        np.dot(belief, step, out=out)
    else:
        out[:] = step.T @ belief


def _forward_block(
    block: slice,
    predicted: FloatArray,
    filtered: FloatArray,
    likelihoods: FloatArray,
    steps: Sequence[Any],
    evidence: FloatArray,
) -> bool:
    """Filter some steps and normalize them together; False if that is too much for the range of numbers."""
    first, stop = block.start, block.stop
    befores, afters, weights = list(predicted[block]), list(filtered[block]), list(likelihoods[block])
    before, multiply = filtered[first - 1] if first else None, np.multiply
    for k, (ahead, after, weight) in enumerate(zip(befores, afters, weights, strict=True), first - 1):
        if before is not None:
            _move(before, steps[k], ahead)
        multiply(ahead, weight, out=after)
        before = after
    totals = filtered[block].sum(axis=1)
    # Likelihoods are 1 at the most, so the sums only fall.
    if not totals[-1] > _SAFE_TOTAL:
        return False
    filtered[block] /= totals[:, np.newaxis]
    predicted[first + 1 : stop] /= totals[:-1, np.newaxis]
    evidence[block] = totals
    evidence[first + 1 : stop] /= totals[:-1]
    return True


def _forward_step(
    time: int,
    predicted: FloatArray,
    filtered: FloatArray,
    likelihoods: FloatArray,
    steps: Sequence[Any],
    evidence: FloatArray,
    scores: FloatArray,
    best: FloatArray,
) -> None:
    """Filter one step, by logarithms if need be."""
    before, after = predicted[time], filtered[time]
    if time:
        _move(filtered[time - 1], steps[time - 1], before)
    np.multiply(before, likelihoods[time], out=after)
    total = after.sum()
    if total > _SAFE_TOTAL:
        after *= 1.0 / total
    else:
        after[:], total, best[time] = _by_logarithms(before, scores[time], time)
    evidence[time] = total


def _by_logarithms(before: FloatArray, scores: FloatArray, time: int) -> tuple[FloatArray, float, float]:
    with np.errstate(divide="ignore"):
        joint = np.log(before) + scores
    offset = float(joint.max())
    if offset == -np.inf:
        raise ImpossibleReadingError(
            f"reading {time} is impossible in every state that the ones before leave"
        )
    after = np.exp(joint - offset)
    total = float(after.sum())
    return after / total, total, offset


def forward_backward(prior: ArrayLike, log_likelihoods: ArrayLike, transitions: Any) -> Smoothed:
    """Give each time's belief given all readings; parameters and errors as of `forward`."""
    first = forward(prior, log_likelihoods, transitions)
    _, scores, steps = _checked(prior, log_likelihoods, transitions)
    smoothed = np.empty_like(first.filtered)
    smoothed[-1] = first.filtered[-1]
    for time in range(len(scores) - 2, -1, -1):
        # Ratio of what is known with and without the later readings; 0 / 0 where nothing leads.
        ratio = np.divide(
            smoothed[time + 1],
            first.predicted[time + 1],
            out=np.zeros_like(smoothed[time]),
            where=first.predicted[time + 1] > 0.0,
        )
        smoothed[time] = first.filtered[time] * (steps[time] @ ratio)
        smoothed[time] /= smoothed[time].sum()
    return Smoothed(smoothed, first)


def most_likely_path(
    prior: ArrayLike, log_likelihoods: ArrayLike, transitions: Any
) -> tuple[IntArray, float]:
    """Give the single most likely sequence of states (Viterbi).

    Parameters as of `forward`.

    Returns
    -------
    path : IntArray, shape (times,)
        States; of equally likely ones the first.
    log_joint : float
        Logarithm of the joint probability of path and readings.

    Raises
    ------
    ImpossibleReadingError
        If no sequence explains the readings.
    """
    prior, scores, steps = _checked(prior, log_likelihoods, transitions)
    with np.errstate(divide="ignore"):
        best = np.log(prior / prior.sum()) + scores[0]
    pointers = np.zeros((len(scores), len(prior)), dtype=np.intp)
    logs: dict[int, Any] = {}
    for time in range(1, len(scores)):
        step = steps[time - 1]
        if id(step) not in logs:
            logs[id(step)] = _Columns(step)
        best, pointers[time] = logs[id(step)].best(best)
        best = best + scores[time]
    last = int(best.argmax())
    if best[last] == -np.inf:
        raise ImpossibleReadingError("no sequence of states explains all readings")
    path = np.empty(len(scores), dtype=np.intp)
    path[-1] = last
    for time in range(len(scores) - 1, 0, -1):
        path[time - 1] = pointers[time, path[time]]
    return path, float(best[last])


class _Columns:
    """A transition matrix in logarithms, by states after."""

    def __init__(self, matrix: Any) -> None:
        self._size = matrix.shape[0]
        self._dense: FloatArray | None = None
        if isinstance(matrix, np.ndarray):
            with np.errstate(divide="ignore"):
                self._dense = np.log(matrix.T)
            return
        columns = matrix.tocsc(copy=True)
        columns.eliminate_zeros()
        columns.sort_indices()
        self._log, self._source = np.log(columns.data), columns.indices
        self._filled = np.flatnonzero(np.diff(columns.indptr))
        self._starts = columns.indptr[:-1][self._filled]
        self._counts = np.diff(columns.indptr)[self._filled]

    def best(self, scores: FloatArray) -> tuple[FloatArray, IntArray]:
        """Give the best score over the states before, and which it is, for each state after."""
        if self._dense is not None:
            ways = self._dense + scores
            pointer = ways.argmax(axis=1)
            return ways[np.arange(self._size), pointer], pointer
        result, pointer = np.full(self._size, -np.inf), np.zeros(self._size, dtype=np.intp)
        if len(self._filled):
            ways = self._log + scores[self._source]
            greatest = np.maximum.reduceat(ways, self._starts)
            result[self._filled] = greatest
            # The first source that reaches the maximum of its column.
            reached = np.where(ways == np.repeat(greatest, self._counts), self._source, self._size)
            pointer[self._filled] = np.minimum.reduceat(reached, self._starts)
        return result, pointer


def _checked(
    prior: ArrayLike, log_likelihoods: ArrayLike, transitions: Any
) -> tuple[FloatArray, FloatArray, Sequence[Any]]:
    prior, scores = np.asarray(prior, dtype=float), np.asarray(log_likelihoods, dtype=float)
    if prior.ndim != 1 or scores.ndim != 2 or scores.shape[1] != len(prior) or not len(scores):
        raise ValueError(
            f"prior {prior.shape} and log likelihoods {scores.shape} do not fit (states,), (times, states)"
        )
    if (
        not (prior.min() >= 0.0 and 0.0 < prior.sum() < np.inf)
        or np.isnan(scores).any()
        or (scores == np.inf).any()
    ):
        raise ValueError(
            "a prior must have some mass and none negative, a log likelihood be below infinity and not nan"
        )
    steps = list(transitions) if isinstance(transitions, list | tuple) else [transitions] * (len(scores) - 1)
    if len(steps) != len(scores) - 1:
        raise ValueError(f"{len(scores)} times need {len(scores) - 1} transitions, not {len(steps)}")
    for step in steps[:1]:
        if step.shape != (len(prior), len(prior)):
            raise ValueError(f"a transition matrix has shape {step.shape}, the states are {len(prior)}")
    return prior, scores, steps
