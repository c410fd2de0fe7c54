"""States hundreds to ten thousand nats apart: against exact fractions, and the same sums in logarithms."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.special import logsumexp

from ciberrato.bayes import (
    ImpossibleReadingError,
    LogBelief,
    MarkovFilter,
    predict,
    update,
    update_by_likelihood,
)
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.bayes.smoothing import forward, forward_backward, most_likely_path

LEAST = Fraction(2) ** -1022  # the smallest double with all its digits
LOG_2 = math.log(2.0)
# Likelihoods are powers of two down to 10^4 nats below one another, or nothing at all.
exponent = st.one_of(st.none(), st.integers(-14_427, 0), st.integers(-1100, -900), st.integers(-60, 0))


def log(value):
    """Logarithm of a fraction of any size."""
    if value == 0:
        return -math.inf
    return math.log(value.numerator) - math.log(value.denominator)


def power(k):
    return Fraction(0) if k is None else Fraction(2) ** k


def logs_of(exponents):
    return np.array([-np.inf if k is None else k * LOG_2 for k in exponents])


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(-1000, 0), exponent), min_size=1, max_size=8))
def test_an_update_keeps_all_that_doubles_keep_and_counts_the_rest(states):
    prior = [m * Fraction(2) ** b for m, b, _ in states]
    joint = [p * power(k) for p, (_, _, k) in zip(prior, states, strict=True)]
    belief, scores = np.array([float(p) for p in prior]), logs_of([k for _, _, k in states])
    if sum(joint) == 0:
        with pytest.raises(ImpossibleReadingError):
            update(belief, scores)
        return
    exact = [j / sum(joint) for j in joint]
    ours = update(belief, scores)
    kept = [p if p > LEAST * (1 + Fraction(1, 10**9)) else Fraction(0) for p in exact]
    np.testing.assert_allclose(ours.posterior, [float(p) for p in kept], rtol=1e-9, atol=2.3e-308)
    # At the bound itself rounding decides.
    at_least = sum(0 < p < LEAST * (1 - Fraction(1, 10**9)) for p in exact)
    at_most = sum(0 < p < LEAST * (1 + Fraction(1, 10**9)) for p in exact)
    assert at_least <= ours.lost <= at_most
    assert ours.log_evidence == pytest.approx(log(sum(joint)), rel=1e-12, abs=1e-9)
    small = (ours.posterior > 0) & (ours.posterior < np.finfo(float).tiny)
    assert not small.any()


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(-1070, 0)), min_size=1, max_size=8), st.data())
def test_likelihoods_themselves_are_as_exact(states, data):
    exponents = data.draw(st.lists(st.integers(-1000, 0), min_size=len(states), max_size=len(states)))
    belief = np.array([float(m * Fraction(2) ** b) for m, b in states])
    likelihood = np.array([2.0**k for k in exponents])
    joint = [Fraction(b) * Fraction(v) for b, v in zip(belief, likelihood, strict=True)]
    if sum(joint) == 0:
        return
    ours = update_by_likelihood(belief, likelihood)
    exact = [j / sum(joint) for j in joint]
    np.testing.assert_allclose(ours.posterior, [float(p) for p in exact], rtol=1e-9, atol=2.3e-308)
    assert ours.lost <= sum(0 < p < LEAST * (1 + Fraction(1, 10**9)) for p in exact)
    assert ours.log_evidence == pytest.approx(log(sum(joint)), rel=1e-12, abs=1e-9)


problems = st.integers(1, 3).flatmap(
    lambda states: st.tuples(
        st.just(states),
        # Transitions: a numerator of 16 for each entry, rows may lose mass.
        st.lists(st.integers(0, 5), min_size=states * states, max_size=states * states),
        st.lists(st.lists(exponent, min_size=states, max_size=states), min_size=1, max_size=5),
    )
)


def written_out(states, numerators, rows):
    """Transition, and the joint probability of each path, in fractions."""
    matrix = [[Fraction(numerators[i * states + j], 16) for j in range(states)] for i in range(states)]
    joint = {}
    for path in np.ndindex(*(states,) * len(rows)):
        p = Fraction(1, states) * power(rows[0][path[0]])
        for t in range(1, len(rows)):
            p *= matrix[path[t - 1]][path[t]] * power(rows[t][path[t]])
        joint[path] = p
    return matrix, joint


@settings(max_examples=200, deadline=None)
@given(problems, st.booleans())
def test_filter_smoother_and_viterbi_equal_fractions_up_to_10000_nats_apart(problem, as_sparse):
    states, _, rows = problem
    exact, joint = written_out(*problem)
    matrix = np.array(exact, dtype=float).reshape(states, states)
    steps = sparse.csr_array(matrix) if as_sparse else matrix
    scores, prior = np.array([logs_of(row) for row in rows]), np.full(states, 1 / states)
    total = sum(joint.values())
    if total == 0:
        for function in (forward, forward_backward, most_likely_path):
            with pytest.raises(ImpossibleReadingError):
                function(prior, scores, steps)
        with pytest.raises(ImpossibleReadingError):
            forward_backward(prior, scores, steps, log=True)
        return
    logs, masses = (forward_backward(prior, scores, steps, log=log_) for log_ in (True, False))
    for t in range(len(rows)):
        sums = [sum(p for path, p in joint.items() if path[t] == s) for s in range(states)]
        expected = np.array([log(p) - log(total) for p in sums])
        np.testing.assert_allclose(logs.smoothed[t], expected, rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(masses.smoothed[t], np.exp(expected), atol=1e-12)
    assert logs.forward.log_evidence.sum() == pytest.approx(log(total), rel=1e-12, abs=1e-9)
    np.testing.assert_allclose(masses.forward.log_evidence, logs.forward.log_evidence, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(masses.forward.filtered, np.exp(logs.forward.filtered), atol=1e-12)
    np.testing.assert_allclose(masses.forward.predicted, np.exp(logs.forward.predicted), atol=1e-12)
    path, log_joint = most_likely_path(prior, scores, steps)
    assert log_joint == pytest.approx(log(max(joint.values())), rel=1e-12, abs=1e-9)
    assert log(joint[tuple(int(s) for s in path)]) == pytest.approx(log_joint, rel=1e-12, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(problems)
def test_a_filter_in_logarithms_equals_fractions_after_every_step(problem):
    states, _, rows = problem
    exact, _ = written_out(*problem)
    matrix = np.array(exact, dtype=float).reshape(states, states)
    belief = [Fraction(1, states)] * states
    ours = MarkovFilter(np.full(states, 1.0), lambda b, u: b @ matrix, log=True, on_impossible="keep")
    for t, row in enumerate(rows):
        if t:
            belief = [sum(belief[i] * exact[i][j] for i in range(states)) for j in range(states)]
            ours.predict(None)
        belief = [b * power(k) for b, k in zip(belief, row, strict=True)]
        if sum(belief) == 0:
            return
        ours.update(logs_of(row))
        expected = np.array([log(b) - log(sum(belief)) for b in belief])
        np.testing.assert_allclose(ours.log_belief, expected, rtol=1e-11, atol=1e-9)
        assert ours.log_evidence == pytest.approx(log(sum(belief)), rel=1e-11, abs=1e-9)
    assert ours.lost == 0


def test_readings_that_contradict_each_other_by_1800_nats_are_weighed():
    right = np.logaddexp(-1000.0, -800.0) + math.log(0.5)
    for log_ in (False, True):
        ours = MarkovFilter([0.5, 0.5], lambda b, u: b, log=log_)
        assert ours.update([0.0, -800.0]).tolist() == [1.0, 0.0]
        np.testing.assert_allclose(ours.update([-1000.0, 0.0]), [math.exp(-200.0), 1.0], rtol=1e-9)
        assert ours.log_evidence == pytest.approx(right, rel=1e-12)
        assert ours.lost == 0


def test_what_a_prediction_takes_from_a_filter_in_doubles_is_counted_and_kept_in_logarithms():
    doubles, logs = (MarkovFilter([0.5, 0.25, 0.25], lambda b, u: b, log=log_) for log_ in (False, True))
    for ours in (doubles, logs):
        ours.update([0.0, -800.0, -np.inf])
        ours.predict(None)
        ours.update([-1000.0, 0.0, 0.0])
    assert doubles.lost == 1
    assert doubles.belief.tolist() == [1.0, 0.0, 0.0]
    assert logs.lost == 0
    np.testing.assert_allclose(logs.belief, [2 * math.exp(-200.0), 1.0, 0.0], rtol=1e-9)


def test_a_filters_belief_may_be_set_and_is_checked():
    for log_ in (False, True):
        ours = MarkovFilter([0.5, 0.5], lambda b, u: b, log=log_)
        ours.update([0.0, -800.0])
        ours.belief = np.array([1.0, 3.0])
        np.testing.assert_allclose(ours.belief, [0.25, 0.75])
        np.testing.assert_allclose(ours.log_belief, np.log([0.25, 0.75]))
        with pytest.raises(ValueError, match="cell 1 is nan"):
            ours.belief = np.array([1.0, np.nan])


@pytest.mark.parametrize("policy", ["keep", "uniform", "likelihood"])
def test_policies_are_the_same_in_logarithms(policy):
    prior, scores = [0.3, 0.7, 0.0, 0.0], np.array([-np.inf, -np.inf, -1000.0, -3000.0])
    doubles, logs = (
        MarkovFilter(prior, lambda b, u: b, on_impossible=policy, log=log_) for log_ in (False, True)
    )
    np.testing.assert_allclose(logs.update(scores), doubles.update(scores), rtol=1e-12)
    assert logs.recoveries == doubles.recoveries == 1
    if policy == "likelihood":
        np.testing.assert_allclose(logs.log_belief[2:], [0.0, -2000.0])
    lost = MarkovFilter([1.0, 0.0], lambda b, u: b * 0.0, on_impossible=policy, log=True)
    lost.predict(None)
    assert lost.log_belief.tolist() == [-np.inf, -np.inf]
    expected = [0.25, 0.75] if policy == "likelihood" else [0.5, 0.5]
    np.testing.assert_allclose(lost.update(np.log([0.2, 0.6])), expected)


def test_motion_models_move_logarithms_as_matrices_do():
    rng = np.random.default_rng(3)
    logs = -9000.0 * rng.random((4, 30))
    for model, control in (
        (BlockedShift(openings=Openings.free(4, 30), arrival={-1: 0.1, 0: 0.8, 1: 0.1}), ("east", 2)),
        (GaussianShift(cell=1.0, sigma=1.3, edge="stay"), 0.4),
    ):
        rows = np.array([model.predict(e.reshape(4, 30), control).ravel() for e in np.eye(120)])
        moved, log_kept = LogBelief(logs).predict(model.predict, control)
        with np.errstate(divide="ignore"):
            expected = logsumexp(LogBelief(logs).logs.reshape(-1, 1) + np.log(rows), axis=0)
        np.testing.assert_allclose(moved.logs.ravel() + log_kept, expected, rtol=1e-12, atol=1e-9)
        assert log_kept == pytest.approx(0.0, abs=1e-9)


def test_a_person_in_the_way_of_18_beams_does_not_lose_the_robot_for_good():
    # Steps of one round a ring of 40, 18 beams of sigma 0.05 m; one scan in five is that of another place.
    rng = np.random.default_rng(1)
    means, sensor = rng.uniform(0.3, 3.0, (40, 18)), GaussianSensor(sigma=0.05)
    matrix = 0.1 * np.eye(40) + 0.9 * np.roll(np.eye(40), 1, axis=1)
    places = np.cumsum(rng.random(60) < 0.9) % 40
    seen = np.where(np.arange(60) % 5 == 3, (places + 17) % 40, places)
    scores = np.array(
        [sensor.log_likelihood(np.abs(means[s] + 0.05 * rng.standard_normal(18)), means) for s in seen]
    )
    assert np.ptp(scores[3]) > 4000
    with np.errstate(divide="ignore"):
        steps = np.log(matrix)
    ahead = [np.full(40, -math.log(40)) + scores[0]]
    for row in scores[1:]:
        ahead.append(logsumexp(ahead[-1][:, np.newaxis] + steps, axis=0) + row)
    behind = [np.zeros(40)]
    for row in scores[:0:-1]:
        behind.append(logsumexp(steps + (row + behind[-1]), axis=1))
    expected = np.array(ahead) + np.array(behind[::-1])
    expected -= logsumexp(expected, axis=1, keepdims=True)
    result = forward_backward(np.full(40, 1 / 40), scores, matrix)
    np.testing.assert_allclose(result.smoothed, np.exp(expected), atol=1e-9)
    ours = MarkovFilter(np.full(40, 1.0), lambda b, u: b @ matrix, log=True)
    ours.update(scores[0])
    for row in scores[1:]:
        ours.predict(None)
        ours.update(row)
    assert ours.log_evidence == pytest.approx(logsumexp(ahead[-1]), rel=1e-12)
    assert ours.belief.argmax() == places[-1]


def test_a_prior_in_logarithms_is_taken_as_it_is():
    prior = LogBelief([0.0, -2000.0])
    scores = np.array([[-3000.0, 0.0], [0.0, 0.0]])
    for log_ in (False, True):
        result = forward_backward(prior, scores, np.eye(2), log=log_).smoothed
        np.testing.assert_allclose(np.exp(result) if log_ else result, [[0.0, 1.0]] * 2, atol=1e-12)
    assert most_likely_path(prior, scores, np.eye(2))[1] == pytest.approx(-2000.0)
    for log_ in (False, True):
        ours = MarkovFilter(prior, lambda b, u: b, log=log_)
        np.testing.assert_allclose(ours.update(scores[0]), [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("logs", [[np.nan, 0.0], [np.inf, 0.0], [-np.inf, -np.inf], []])
def test_what_is_no_belief_in_logarithms_is_refused(logs):
    with pytest.raises(ValueError, match="below infinity"):
        LogBelief(logs)
    with pytest.raises(ValueError, match=r"log likelihood has shape|below infinity"):
        LogBelief([0.0, 0.0]).update(np.array([np.nan, 0.0]) if len(logs) == 2 else [0.0])


def test_a_motion_model_that_returns_nan_or_less_than_nothing_is_named():
    for wrong in (np.nan, -0.1, np.inf):
        for function in (
            lambda w: predict(lambda b, u: b * w, [0.5, 0.5], None),
            lambda w: LogBelief([0.0, 0.0]).predict(lambda b, u: b * w, None),
        ):
            with pytest.raises(ValueError, match="motion model's result"):
                function(wrong)
    for function in (
        lambda: predict(lambda b, u: b[:1], [0.5, 0.5], None),
        lambda: LogBelief([0.0, 0.0]).predict(lambda b, u: b[:1], None),
    ):
        with pytest.raises(ValueError, match="motion model's result has shape"):
            function()
