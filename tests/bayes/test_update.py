"""Bayes' rule in the log domain, against exact rational arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ciberrato.bayes import ImpossibleReadingError, MarkovFilter, predict, update, update_by_likelihood

masses = st.lists(st.integers(0, 50), min_size=1, max_size=12).filter(lambda m: sum(m) > 0)


@given(masses, st.data())
def test_posterior_and_evidence_equal_bayes_rule_in_fractions(prior, data):
    # Likelihoods are powers of two, so that both sides are exact up to one rounding.
    exponents = data.draw(st.lists(st.integers(-60, 0), min_size=len(prior), max_size=len(prior)))
    belief = [Fraction(m, sum(prior)) for m in prior]
    joint = [b * Fraction(2) ** e for b, e in zip(belief, exponents, strict=True)]
    posterior, log_evidence = update([float(b) for b in belief], np.array(exponents) * math.log(2))
    np.testing.assert_allclose(posterior, [float(j / sum(joint)) for j in joint], rtol=1e-11)
    assert log_evidence == pytest.approx(math.log(sum(joint)), abs=1e-11)


def test_likelihoods_far_below_the_smallest_float_keep_their_ratios():
    posterior, log_evidence = update([0.5, 0.25, 0.25], [-10_000.0, -10_000.0 + math.log(2.0), -20_000.0])
    np.testing.assert_allclose(posterior, [0.5, 0.5, 0.0], rtol=1e-12)
    assert log_evidence == pytest.approx(-10_000.0)


def test_a_cell_with_hardly_any_mass_wins_when_only_it_explains_the_reading():
    # The products underflow unless the logarithm of the belief is taken into account.
    posterior, log_evidence = update([1.0, 1e-300], [-800.0, -50.0])
    ratio = math.exp(-800.0 + 50.0 + 300 * math.log(10))
    np.testing.assert_allclose(posterior, [ratio / (1 + ratio), 1 / (1 + ratio)], rtol=1e-12)
    assert log_evidence == pytest.approx(-50.0 - 300 * math.log(10) + math.log1p(ratio), rel=1e-13)


def test_denormal_beliefs_do_not_lose_the_evidence():
    posterior, log_evidence = update([1.0, 1e-310], [-np.inf, 0.0])
    assert posterior.tolist() == [0.0, 1.0]
    assert log_evidence == pytest.approx(-310 * math.log(10), rel=1e-9)


def test_an_impossible_state_gets_exactly_nothing():
    posterior, _ = update([0.5, 0.5, 0.0], [-np.inf, -3.0, 0.0])
    assert posterior.tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("policy", "expected"),
    [("keep", [0.5, 0.5, 0.0, 0.0]), ("uniform", [0.25] * 4), ("likelihood", [0.0, 0.0, 0.2, 0.8])],
)
def test_each_policy_for_an_impossible_reading(policy, expected):
    log_likelihood = np.array([-np.inf, -np.inf, -1000.0, -1000.0 + math.log(4.0)])
    posterior, log_evidence = update([1.0, 1.0, 0.0, 0.0], log_likelihood, on_impossible=policy)
    np.testing.assert_allclose(posterior, expected, rtol=1e-12)
    assert log_evidence == -math.inf


@pytest.mark.parametrize("policy", ["keep", "uniform", "likelihood"])
def test_policies_give_a_belief_even_when_nothing_is_left(policy):
    posterior, _ = update([0.0, 0.0], [-np.inf, -np.inf], on_impossible=policy)
    assert posterior.tolist() == [0.5, 0.5]


def test_the_default_policy_raises():
    with pytest.raises(ImpossibleReadingError):
        update([1.0, 0.0], [-np.inf, 0.0])


@pytest.mark.parametrize(
    ("belief", "log_likelihood"),
    [
        ([0.5, 0.5], [0.0]),
        ([0.5, -0.5], [0.0, 0.0]),
        ([np.nan, 1.0], [0.0, 0.0]),
        ([1.0, 0.0], [np.nan, 0.0]),
        ([1.0], [np.inf]),
    ],
)
def test_what_is_no_belief_or_likelihood_is_refused(belief, log_likelihood):
    with pytest.raises(ValueError, match=r"belief|likelihood"):
        update(belief, log_likelihood)


def test_an_unknown_policy_is_refused_before_it_is_needed():
    with pytest.raises(ValueError, match="keep, uniform"):
        update([1.0], [0.0], on_impossible="hope")


def test_out_may_be_any_of_the_arrays():
    rng = np.random.default_rng(1)
    for which in range(3):
        belief, log_likelihood = rng.dirichlet(np.ones(50)), rng.normal(scale=300, size=50)
        expected = update(belief, log_likelihood)
        out = (belief, log_likelihood, np.empty(50))[which]
        posterior, log_evidence = update(belief, log_likelihood, out=out)
        assert posterior is out
        np.testing.assert_array_equal(posterior, expected.posterior)
        assert log_evidence == expected.log_evidence


def test_evidence_of_a_sequence_equals_the_joint_enumerated():
    rng = np.random.default_rng(2)
    transition = rng.dirichlet(np.ones(3), size=3)
    likelihoods = rng.random((4, 3))
    prior = rng.dirichlet(np.ones(3))
    total = 0.0
    for path in np.ndindex(3, 3, 3, 3):
        p = prior[path[0]] * likelihoods[0, path[0]]
        for t in range(1, 4):
            p *= transition[path[t - 1], path[t]] * likelihoods[t, path[t]]
        total += p
    belief_filter = MarkovFilter(7.0 * prior, lambda belief, control: belief @ control)
    belief_filter.update(np.log(likelihoods[0]))
    for row in likelihoods[1:]:
        belief_filter.predict(transition)
        belief_filter.update(np.log(row))
    assert belief_filter.log_evidence == pytest.approx(math.log(total), rel=1e-12)


def test_mass_lost_in_a_prediction_is_reported_and_counts_in_the_evidence():
    belief, log_kept = predict(lambda b, k: b * k, [0.5, 0.5], np.array([0.5, 0.0]))
    assert belief.tolist() == [1.0, 0.0]
    assert log_kept == pytest.approx(math.log(0.25))
    belief_filter = MarkovFilter([0.5, 0.5], lambda b, k: b * k)
    belief_filter.predict(np.array([0.5, 0.0]))
    belief_filter.update(np.log([0.1, 0.9]))
    assert belief_filter.log_evidence == pytest.approx(math.log(0.25 * 0.1))


def test_a_filter_whose_mass_is_all_lost_recovers_at_the_next_reading():
    belief_filter = MarkovFilter([1.0, 0.0], lambda b, k: b * 0.0, on_impossible="likelihood")
    belief_filter.predict(None)
    belief = belief_filter.update(np.log([0.2, 0.6]))
    np.testing.assert_allclose(belief, [0.25, 0.75])
    assert belief_filter.recoveries == 1


@given(masses, st.data())
def test_likelihoods_themselves_give_the_same_as_their_logarithms(prior, data):
    likelihood = np.array(data.draw(st.lists(st.floats(0.0, 9.0), min_size=len(prior), max_size=len(prior))))
    belief = np.array(prior, dtype=float) / sum(prior)
    with np.errstate(divide="ignore"):
        expected = update(belief, np.log(likelihood), on_impossible="uniform")
    ours = update_by_likelihood(belief, likelihood, on_impossible="uniform")
    np.testing.assert_allclose(ours.posterior, expected.posterior, rtol=1e-9, atol=1e-300)
    assert ours.log_evidence == pytest.approx(expected.log_evidence, rel=1e-9, abs=1e-12)


def test_likelihoods_that_are_none_are_refused():
    for belief, likelihood in (
        ([1.0], [-1.0]),
        ([0.5, 0.5], [np.nan, 1.0]),
        ([1.0], [np.inf]),
        ([1.0], [1.0, 2.0]),
        ([-0.5, 0.5, 1.0], [-0.1, 0.5, 0.6]),
    ):
        with pytest.raises(ValueError, match=r"belief|likelihood"):
            update_by_likelihood(belief, likelihood)


def test_products_that_underflow_are_taken_by_logarithms_in_place_too():
    belief = np.array([1.0, 1e-300])
    assert update_by_likelihood(belief, [0.0, 1e-200], out=belief).posterior is belief
    assert belief.tolist() == [0.0, 1.0]
