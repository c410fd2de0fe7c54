"""A recorded run looked at as a whole: smoothing (forward-backward) and the most likely path (Viterbi).

States are raveled. `log_likelihoods[t]` belongs to the state at time t, `transitions[t]` leads from time t to
t + 1; rows are states before. Matrices are dense, or sparse by `scipy.sparse`;
`ciberrato.bayes.motion.transition_matrix` writes any motion model out as one. The forward pass is the Bayes
filter of Probabilistic Robotics, table 2.1; the rest is the theory of hidden Markov models (Rabiner, A
Tutorial on Hidden Markov Models, Proceedings of the IEEE 77, 1989, sections III.A to III.C).

Steps are scaled, many at a time, as long as no state that is possible gets too small for a double; from there
on they are made in logarithms, so that results are right however far readings separate the states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import belief_array, refuse_log_likelihood, transition_array
from ciberrato.bayes.logbelief import LogBelief, log_total, masses_of, moved
from ciberrato.bayes.recovery import ImpossibleReadingError
from ciberrato.reprs import short_repr

# Steps that are normalized together, and the sum below which each is normalized by itself.
_BLOCK = 32
_SAFE_TOTAL = 1e-200
# Nats below the best beyond which a likelihood is not worked out; sums of products above the bound have all
# digits, even if some of the products have underflowed.
_FAR, _SAFE_SUM = -700.0, 1e-290


class Forward(NamedTuple):
    """The filter over a run.

    Attributes
    ----------
    predicted, filtered : FloatArray, shape (times, states)
        Beliefs before and after each reading; natural logarithms of them if those were asked for.
    log_evidence : FloatArray, shape (times,)
        Natural logarithm of each reading's probability given the ones before; mass that a transition lost
        counts against it.
    """

    predicted: FloatArray
    filtered: FloatArray
    log_evidence: FloatArray

    def __repr__(self) -> str:
        return short_repr(self)


class Smoothed(NamedTuple):
    """Beliefs given the whole run.

    Attributes
    ----------
    smoothed : FloatArray, shape (times, states)
        Given all readings, those after included; logarithms if those were asked for.
    forward : Forward
        Given the readings up to each time.
    """

    smoothed: FloatArray
    forward: Forward

    def __repr__(self) -> str:
        return short_repr(self)


def forward(
    prior: ArrayLike | LogBelief, log_likelihoods: ArrayLike, transitions: Any, *, log: bool = False
) -> Forward:
    """Run the filter.

    Parameters
    ----------
    prior : array_like or LogBelief, shape (states,)
        Belief at time 0 before its reading; is normalized.
    log_likelihoods : array_like, shape (times, states)
        -inf where impossible.
    transitions : matrix or sequence of matrices
        One for all steps, or times - 1 of them; (states, states), entries 0 or more, row sums at most 1.
    log : bool
        Return the beliefs as natural logarithms, which also distinguish states below the smallest double.

    Returns
    -------
    Forward

    Raises
    ------
    ImpossibleReadingError
        If no state explains a reading; the message says which.
    ValueError
        If shapes do not fit, or a prior, likelihood or transition is none.
    """
    log_prior, scores, best, steps = _checked(prior, log_likelihoods, transitions)
    if log:
        return _forward_by_logs(log_prior, scores, steps)
    return _Scaled(log_prior, scores, best, steps).forward


def forward_backward(
    prior: ArrayLike | LogBelief, log_likelihoods: ArrayLike, transitions: Any, *, log: bool = False
) -> Smoothed:
    """Compute each time's belief given all readings; parameters and errors as of `forward`."""
    log_prior, scores, best, steps = _checked(prior, log_likelihoods, transitions)
    if not log:
        scaled = _Scaled(log_prior, scores, best, steps)
        if scaled.whole:
            return Smoothed(_backward_by_ratios(scaled.forward, steps), scaled.forward)
    first = _forward_by_logs(log_prior, scores, steps)
    smoothed = np.empty_like(scores)
    # Logarithms of the later readings' probability, up to a factor for each time.
    later = np.zeros(scores.shape[1])
    for time in range(len(scores) - 1, -1, -1):
        joint = first.filtered[time] + later
        smoothed[time] = joint - log_total(joint)
        if time:
            later = moved(steps[time - 1].__matmul__, later + scores[time])
            later -= log_total(later)
    if log:
        return Smoothed(smoothed, first)
    return Smoothed(masses_of(smoothed), scaled.forward)


def _backward_by_ratios(first: Forward, steps: Sequence[Any]) -> FloatArray:
    smoothed = np.empty_like(first.filtered)
    smoothed[-1] = first.filtered[-1]
    for time in range(len(smoothed) - 2, -1, -1):
        # Ratio of what is known with and without the later readings; 0 / 0 where nothing leads.
        ratio = np.divide(
            smoothed[time + 1],
            first.predicted[time + 1],
            out=np.zeros_like(smoothed[time]),
            where=first.predicted[time + 1] > 0.0,
        )
        smoothed[time] = first.filtered[time] * (steps[time] @ ratio)
        smoothed[time] /= smoothed[time].sum()
    return smoothed


def _forward_by_logs(log_prior: FloatArray, scores: FloatArray, steps: Sequence[Any]) -> Forward:
    predicted, filtered, evidence = np.empty_like(scores), np.empty_like(scores), np.empty(len(scores))
    for time in range(len(scores)):
        predicted[time] = moved(steps[time - 1].T.__matmul__, filtered[time - 1]) if time else log_prior
        filtered[time], evidence[time] = _corrected(predicted[time], scores[time], time)
    return Forward(predicted, filtered, evidence)


def _corrected(predicted: FloatArray, scores: FloatArray, time: int) -> tuple[FloatArray, float]:
    joint = predicted + scores
    total = log_total(joint)
    if total == -math.inf:
        raise ImpossibleReadingError(
            f"reading {time} is impossible in every state that the ones before leave"
        )
    return joint - total, total


class _Scaled:
    """The forward pass in doubles, steps scaled together; in logarithms where that would lose a state.

    Attributes
    ----------
    forward : Forward
        The result; zero where a state is too unlikely for a double.
    whole : bool
        Whether there is no such state, at any time.
    """

    def __init__(
        self, log_prior: FloatArray, scores: FloatArray, best: FloatArray, steps: Sequence[Any]
    ) -> None:
        self._scores, self._steps, self._best = scores, steps, best.copy()
        with np.errstate(invalid="ignore"):
            below = scores - best[:, np.newaxis]
        self._far: BoolArray = np.zeros(len(scores), dtype=bool)
        if below.min() >= _FAR:
            self._likelihoods = np.exp(below, out=below)
        else:  # nan as well: a reading that is impossible everywhere
            possible = scores > -np.inf
            self._far = np.asarray(((below < _FAR) & possible).any(axis=1))
            self._likelihoods = np.exp(np.maximum(below, _FAR), out=below)
            self._likelihoods[~possible] = 0.0
        self._predicted, self._filtered = np.empty_like(scores), np.empty_like(scores)
        self._evidence = np.empty(len(scores))
        self._predicted[0] = masses_of(log_prior)
        self._least: dict[int, float] = {}
        # The last belief, if doubles cannot hold it; before the first reading the prior.
        self._logs: FloatArray | None = log_prior if _beyond_doubles(log_prior) else None
        self.whole = self._logs is None
        for start in range(0, len(scores), _BLOCK):
            block = slice(start, min(start + _BLOCK, len(scores)))
            if self._logs is not None or self._far[block].any() or not self._block(block):
                for time in range(block.start, block.stop):
                    self._step(time)
        self.forward = Forward(self._predicted, self._filtered, np.log(self._evidence) + self._best)

    def _block(self, block: slice) -> bool:
        """Filter some steps and normalize them together; False if that takes more than doubles."""
        first, stop = block.start, block.stop
        predicted, filtered = self._predicted, self._filtered
        befores, afters = list(predicted[block]), list(filtered[block])
        before, multiply, steps = filtered[first - 1] if first else None, np.multiply, self._steps
        try:
            with np.errstate(under="raise"):
                weights = list(self._likelihoods[block])
                for k, (ahead, after, weight) in enumerate(
                    zip(befores, afters, weights, strict=True), first - 1
                ):
                    if before is not None:
                        _move(before, steps[k], ahead)
                    multiply(ahead, weight, out=after)
                    before = after
        except FloatingPointError:
            return False
        totals = filtered[block].sum(axis=1)
        # Likelihoods are at most 1, so the sums only fall.
        if not totals[-1] > _SAFE_TOTAL or not self._sums_are_whole(max(first, 1), stop):
            return False
        filtered[block] /= totals[:, np.newaxis]
        predicted[first + 1 : stop] /= totals[:-1, np.newaxis]
        self._evidence[block] = totals
        self._evidence[first + 1 : stop] /= totals[:-1]
        return True

    def _sums_are_whole(self, first: int, stop: int) -> bool:
        """Return whether predictions have all their digits, and are zero only where nothing leads."""
        if first >= stop or self._predicted[first:stop].min() >= _SAFE_SUM:
            return True
        before = self._filtered[first - 1 : stop - 1]
        entry = min(self._least_entry(step) for step in self._steps[first - 1 : stop - 1])
        return bool(before.min(initial=1.0, where=before > 0.0) * entry >= _SAFE_SUM)

    def _least_entry(self, step: Any) -> float:
        if id(step) not in self._least:
            entries = step if isinstance(step, np.ndarray) else step.data
            self._least[id(step)] = float(entries.min(initial=1.0, where=entries > 0.0))
        return self._least[id(step)]

    def _step(self, time: int) -> None:
        """Filter one step, in logarithms if need be."""
        before, after = self._predicted[time], self._filtered[time]
        if self._logs is None:
            if time:
                _move(self._filtered[time - 1], self._steps[time - 1], before)
            if not self._far[time] and self._scaled_step(time, before, after):
                return
        if time == 0:
            ahead = self._logs
            if ahead is None:
                with np.errstate(divide="ignore"):
                    ahead = np.log(before)
        else:
            logs = self._logs
            if logs is None:
                with np.errstate(divide="ignore"):
                    logs = np.log(self._filtered[time - 1])
            ahead = moved(self._steps[time - 1].T.__matmul__, logs)
        joint, self._best[time] = _corrected(ahead, self._scores[time], time)
        self._evidence[time] = 1.0
        before[:], after[:] = masses_of(ahead), masses_of(joint)
        self._logs = joint if _beyond_doubles(joint) else None
        self.whole &= self._logs is None and not _beyond_doubles(ahead)

    def _scaled_step(self, time: int, before: FloatArray, after: FloatArray) -> bool:
        try:
            with np.errstate(under="raise"):
                np.multiply(before, self._likelihoods[time], out=after)
        except FloatingPointError:
            return False
        total = float(after.sum())
        if not total > _SAFE_TOTAL or (time and not self._sums_are_whole(time, time + 1)):
            return False
        after *= 1.0 / total
        self._evidence[time] = total
        return True


def _beyond_doubles(logs: FloatArray) -> bool:
    return bool(((logs < -708.0) & (logs > -np.inf)).any())


def _move(belief: FloatArray, step: Any, out: FloatArray) -> None:
    if isinstance(step, np.ndarray):
        np.dot(belief, step, out=out)
    else:
        out[:] = step.T @ belief


def most_likely_path(
    prior: ArrayLike | LogBelief, log_likelihoods: ArrayLike, transitions: Any
) -> tuple[IntArray, float]:
    """Find the single most likely sequence of states (Viterbi).

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
    log_prior, scores, _, steps = _checked(prior, log_likelihoods, transitions)
    best = log_prior + scores[0]
    pointers = np.zeros(scores.shape, dtype=np.intp)
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
        columns.sum_duplicates()
        columns.eliminate_zeros()
        columns.sort_indices()
        self._log, self._source = np.log(columns.data), columns.indices
        self._filled = np.flatnonzero(np.diff(columns.indptr))
        self._starts = columns.indptr[:-1][self._filled]
        self._counts = np.diff(columns.indptr)[self._filled]

    def best(self, scores: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the best score over the states before, and which it is, for each state after."""
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
    prior: ArrayLike | LogBelief, log_likelihoods: ArrayLike, transitions: Any
) -> tuple[FloatArray, FloatArray, FloatArray, Sequence[Any]]:
    """Return log prior, scores, the best score of each time, and a matrix for each step."""
    log_prior = (
        prior if isinstance(prior, LogBelief) else LogBelief.of(belief_array(prior, what="prior"))
    ).logs
    scores = np.asarray(log_likelihoods, dtype=float)
    if log_prior.ndim != 1 or scores.ndim != 2 or scores.shape[1] != len(log_prior) or not len(scores):
        raise ValueError(
            f"prior {log_prior.shape} and log likelihoods {scores.shape} do not fit (states,), "
            "(times, states)"
        )
    best = scores.max(axis=1)
    if not (best < np.inf).all():  # nan neither
        refuse_log_likelihood(scores)
    return log_prior, scores, best, _steps(transitions, len(log_prior), len(scores) - 1)


def _steps(transitions: Any, states: int, count: int) -> Sequence[Any]:
    several = isinstance(transitions, list | tuple) and (not transitions or np.ndim(transitions[0]) != 1)
    if not several and np.ndim(transitions) != 3:
        return [transition_array(transitions, states=states)] * count
    if len(transitions) != count:
        raise ValueError(f"{count + 1} times need {count} transitions, not {len(transitions)}")
    checked: dict[int, Any] = {}
    matrices = list(transitions)
    for time, matrix in enumerate(matrices):
        if id(matrix) not in checked:
            checked[id(matrix)] = transition_array(matrix, states=states, what=f"transition matrix {time}")
    return [checked[id(matrix)] for matrix in matrices]
