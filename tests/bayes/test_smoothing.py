"""Filter, smoother and Viterbi against the joint distribution written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from ciberrato.bayes import ImpossibleReadingError
from ciberrato.bayes.smoothing import forward, forward_backward, most_likely_path


def problem(seed, states, times, holes):
    rng = np.random.default_rng(seed)
    transitions = rng.dirichlet(np.ones(states), size=(times - 1, states))
    likelihoods = rng.random((times, states))
    if holes:
        transitions[rng.random(transitions.shape) < 0.3] = 0.0
        likelihoods[rng.random(likelihoods.shape) < 0.2] = 0.0
    return rng.dirichlet(np.ones(states)), likelihoods, transitions


def enumerate_joint(prior, likelihoods, transitions):
    times, states = likelihoods.shape
    joint = np.zeros((states,) * times)
    for path in np.ndindex(*joint.shape):
        p = prior[path[0]] * likelihoods[0, path[0]]
        for t in range(1, times):
            p *= transitions[t - 1, path[t - 1], path[t]] * likelihoods[t, path[t]]
        joint[path] = p
    return joint


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 9999), st.integers(1, 4), st.integers(1, 5), st.booleans(), st.booleans())
def test_everything_equals_the_enumeration_of_all_paths(seed, states, times, holes, as_sparse):
    prior, likelihoods, transitions = problem(seed, states, times, holes)
    joint = enumerate_joint(prior, likelihoods, transitions)
    with np.errstate(divide="ignore"):
        scores = np.log(likelihoods) - 2000.0  # as far down as a long scan takes it
    steps = [sparse.csr_array(t) if as_sparse else t for t in transitions]
    if joint.sum() == 0.0:
        for function in (forward, forward_backward, most_likely_path):
            with pytest.raises(ImpossibleReadingError):
                function(prior, scores, steps)
        return
    result = forward_backward(prior, scores, steps)
    assert result.forward.log_evidence.sum() + 2000.0 * times == pytest.approx(
        math.log(joint.sum()), abs=1e-8
    )
    for t in range(times):
        others = tuple(k for k in range(times) if k != t)
        np.testing.assert_allclose(result.smoothed[t], joint.sum(axis=others) / joint.sum(), atol=1e-10)
    so_far = enumerate_joint(prior, likelihoods[:2], transitions)
    if times >= 2:
        np.testing.assert_allclose(result.forward.filtered[1], so_far.sum(axis=0) / so_far.sum(), atol=1e-10)
    path, log_joint = most_likely_path(prior, scores, steps)
    assert log_joint + 2000.0 * times == pytest.approx(math.log(joint.max()), abs=1e-8)
    assert joint[tuple(path)] == pytest.approx(joint.max(), rel=1e-9)


def test_smoothing_knows_what_came_after():
    # Two corridors that look alike until the end: only the smoother can tell where the run began.
    transition = np.kron(np.eye(2), np.roll(np.eye(3), 1, axis=1))
    scores = np.zeros((3, 6))
    scores[2] = [-np.inf, -np.inf, -np.inf, -np.inf, -np.inf, 0.0]
    result = forward_backward(np.full(6, 1 / 6), scores, transition)
    np.testing.assert_allclose(result.forward.filtered[0], 1 / 6)
    np.testing.assert_allclose(result.smoothed[0], [0, 0, 0, 1, 0, 0])
    assert most_likely_path(np.full(6, 1 / 6), scores, transition)[0].tolist() == [3, 4, 5]


def test_shapes_that_do_not_fit_are_refused():
    prior, scores, transition = np.full(3, 1 / 3), np.zeros((4, 3)), np.eye(3)
    for wrong in (
        (prior[:2], scores, transition),
        (prior, scores, np.eye(2)),
        (prior, scores, [transition] * 2),
        (prior, scores + np.nan, transition),
        (-prior, scores, transition),
    ):
        with pytest.raises(ValueError):  # noqa: PT011  each has its own words
            forward(*wrong)
