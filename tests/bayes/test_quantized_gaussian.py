"""Rounded Gaussian readings: against scipy, quadrature, and samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, special, stats

from ciberrato.bayes.sensors.normal import LOG_SQRT_TWO_PI, log_interval, log_upper_tail
from ciberrato.bayes.sensors.quantized_gaussian import QuantizedGaussian


def test_tail_equals_scipys_over_the_whole_range():
    x = np.concatenate([np.linspace(-40, 40, 4001), np.logspace(1.7, 150, 200)])
    ours, theirs = log_upper_tail(x), special.log_ndtr(-x)
    np.testing.assert_allclose(ours[x >= 0], theirs[x >= 0], rtol=1e-14)
    np.testing.assert_allclose(ours[x < 0], theirs[x < 0], atol=1e-15)
    assert log_upper_tail(np.inf) == -np.inf
    assert log_upper_tail(-np.inf) == pytest.approx(0.0, abs=1e-300)


@pytest.mark.parametrize("middle", [0.0, 0.3, -2.0, 9.0, -37.0, 120.0])
@pytest.mark.parametrize("width", [1e-6, 1e-3, 0.02, 0.3, 2.0, 15.0])
def test_interval_equals_quadrature_about_its_greatest_density(middle, width):
    low, high = middle - width / 2, middle + width / 2
    top = min(max(0.0, low), high)  # scale by the density there, so that quadrature sees numbers near 1
    points = [p for p in (low + 30 / max(1.0, abs(top)), high - 30 / max(1.0, abs(top))) if low < p < high]
    integral, _ = integrate.quad(
        lambda x: math.exp((top - x) * (top + x) / 2),
        low,
        high,
        epsrel=1e-12,
        epsabs=0.0,
        limit=500,
        points=points or None,
    )
    expected = math.log(integral) - top * top / 2 - LOG_SQRT_TWO_PI
    assert float(log_interval(low, high)) == pytest.approx(expected, rel=1e-11, abs=1e-11)


def test_interval_ends_and_order():
    assert log_interval(-np.inf, np.inf) == pytest.approx(0.0, abs=1e-15)
    assert log_interval(0.0, np.inf) == pytest.approx(math.log(0.5))
    assert log_interval(1.0, 1.0) == -np.inf
    assert log_interval(2.0, 1.0) == -np.inf


@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.5])
def test_probabilities_over_all_readings_sum_to_one(sigma):
    readings = np.round(np.arange(-60, 120) * 0.1, 1)
    model = QuantizedGaussian(sigma=sigma, step=0.1, signed=True)
    for mean in (0.0, 1.0 / 3.0, 2.05, 4.9499):
        assert np.exp(model.beam_log_likelihood(readings, mean)).sum() == pytest.approx(1.0, abs=1e-13)


def test_samples_of_the_generating_process_have_these_frequencies():
    rng = np.random.default_rng(3)
    samples = np.floor((1.234 + 0.1 * rng.standard_normal(200_000)) / 0.1 + 0.5).astype(int)
    seen, counts = np.unique(samples, return_counts=True)
    model = QuantizedGaussian(sigma=0.1, step=0.1)
    chances = np.exp(model.beam_log_likelihood(seen * 0.1, 1.234))
    often = counts >= 10
    assert chances[often].sum() > 0.9999
    statistic = ((counts - 200_000 * chances) ** 2 / (200_000 * chances))[often].sum()
    assert stats.chi2.sf(statistic, often.sum() - 1) > 1e-3


def test_far_tails_are_ordered_and_finite():
    means = np.array([0.5, 5.0, 50.0, 100.0])
    result = QuantizedGaussian(sigma=0.1, step=0.1).beam_log_likelihood(0.0, means)
    assert np.isfinite(result).all()
    assert (np.diff(result) < 0).all()
    # One beam 1,000 sigma off: the tail's leading term is -(999.5)^2 / 2.
    assert result[-1] == pytest.approx(-(999.5**2) / 2 - math.log(999.5) - LOG_SQRT_TWO_PI, rel=1e-9)


def test_without_noise_only_the_rounded_mean_is_possible():
    model = QuantizedGaussian(sigma=0.0, step=0.1)
    assert model.beam_log_likelihood(1.2, [1.16, 1.1499, 1.24, 1.26]).tolist() == [0.0, -np.inf, 0.0, -np.inf]


def test_outliers_bound_the_damage_of_one_beam():
    model = QuantizedGaussian(sigma=0.1, step=0.1, outlier=0.01, outlier_readings=1000)
    assert float(model.beam_log_likelihood(90.0, 0.5)) == pytest.approx(math.log(1e-5))
    near = QuantizedGaussian(sigma=0.1, step=0.1).beam_log_likelihood(0.5, 0.5)
    assert float(model.beam_log_likelihood(0.5, 0.5)) == pytest.approx(math.log(0.99 * math.exp(near) + 1e-5))


def test_beams_add_and_missing_ones_say_nothing():
    model = QuantizedGaussian(sigma=0.1, step=0.1)
    means = np.array([[0.5, 1.0, 2.0], [0.7, 1.1, 2.2]])
    full = model.beam_log_likelihood([0.5, 1.1, 2.0], means)
    np.testing.assert_allclose(model.log_likelihood([0.5, 1.1, np.nan], means), full[:, :2].sum(axis=1))
    means[1, 2] = np.nan
    with pytest.raises(ValueError, match=r"map is nan at \(1, 2\)"):
        model.log_likelihood([0.5, 1.1, 2.0], means)


@pytest.mark.parametrize(
    "wrong",
    [{"sigma": -0.1, "step": 0.1}, {"sigma": 0.1, "step": 0.0}, {"sigma": 0.1, "step": 0.1, "outlier": 1.0}],
)
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        QuantizedGaussian(**wrong)
