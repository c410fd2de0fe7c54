"""How likely a reading is, against scipy, quadrature, simulated noise and the real simulator's noise."""

from __future__ import annotations

import csv
import gzip
import json
import math

import numpy as np
import pytest
from scipy import special, stats

from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, reading_log_likelihood, round_reading, sensor_distances
from tests.recordings import GOLDEN, LABS, needs


@pytest.mark.parametrize("sigma", [0.01, 0.03, 0.1, 0.4, 1.0, 5.0])
@pytest.mark.parametrize("ideal", [0.0, 0.05, 0.449999, 1.0 / 3.0, 2.5, 100.0])
def test_all_readings_together_are_certain(sigma, ideal):
    codes = np.arange(math.floor(10 * (ideal - 12 * sigma)) - 2, math.ceil(10 * (ideal + 12 * sigma)) + 3)
    assert np.exp(reading_log_likelihood(codes / 10, ideal, sigma)).sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.4, 2.0])
def test_equals_scipy_s_tail_differences(sigma, rng):
    ideal = rng.uniform(0.0, 3.0, 400)
    reading = round_reading(ideal + sigma * rng.uniform(-7.0, 7.0, 400))
    low, high = (reading - 0.05 - ideal) / sigma, (reading + 0.05 - ideal) / sigma
    # Q(low) - Q(high) on the side where both are small.
    low, high = np.where(low + high > 0, low, -high), np.where(low + high > 0, high, -low)
    expected = np.log(special.ndtr(-low) - special.ndtr(-high))
    np.testing.assert_allclose(reading_log_likelihood(reading, ideal, sigma), expected, rtol=1e-9, atol=1e-11)


def quadrature(reading: float, ideal: float, sigma: float) -> float:
    """Logarithm of the mass by Gauss and Legendre, relative to the density at the nearer end."""
    low, high = (reading - 0.05 - ideal) / sigma, (reading + 0.05 - ideal) / sigma
    if abs(high) < abs(low):
        low, high = -high, -low
    nodes, weights = np.polynomial.legendre.leggauss(40)
    pieces = np.linspace(0.0, min(high - low, 40.0 / max(low, 1.0)), 41)
    half = np.diff(pieces) / 2
    t = pieces[:-1, np.newaxis] + half[:, np.newaxis] * (nodes + 1.0)
    mass = (half[:, np.newaxis] * weights * np.exp(-low * t - t * t / 2)).sum()
    return math.log(mass) - low * low / 2 - math.log(2 * math.pi) / 2


@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.4, 30.0])
@pytest.mark.parametrize("reading", [-1.0, 0.0, 0.3, 5.0, 60.0, 100.0])
@pytest.mark.parametrize("ideal", [0.02, 0.4, 2.1, 100.0])
def test_equals_quadrature_however_far_out(reading, ideal, sigma):
    found = float(reading_log_likelihood(reading, ideal, sigma))
    assert found == pytest.approx(quadrature(reading, ideal, sigma), rel=1e-11, abs=1e-11)
    assert math.isfinite(found)


def test_far_readings_are_ranked_where_probabilities_underflow():
    levels = reading_log_likelihood(100.0, np.linspace(0.0, 90.0, 200), 0.1)
    assert np.isfinite(levels).all()
    assert (np.diff(levels) > 0.0).all()
    assert levels[0] < -400_000


def test_simulated_noise_and_rounding(rng):
    ideal, sigma, draws = 0.4372, 0.13, 200_000
    readings = round_reading(ideal + sigma * rng.standard_normal(draws))
    codes, counts = np.unique(np.rint(10 * readings).astype(int), return_counts=True)
    expected = draws * np.exp(reading_log_likelihood(codes / 10, ideal, sigma))
    often = expected > 10
    statistic = ((counts - expected)[often] ** 2 / expected[often]).sum()
    assert stats.chi2.sf(statistic, often.sum() - 1) > 1e-4


@pytest.mark.parametrize(("run", "sigma"), [("n2_near_walls", 0.5), ("n3_heading180", 0.1)])
@needs("CIBERRATO_GOLDEN", "CIBERRATO_LABS")
def test_the_real_simulator_s_noise(run, sigma):
    """Four thousand cycles at a standstill: counts of readings, sensor by sensor."""
    meta = json.loads((GOLDEN / f"noise/{run}.meta.json").read_text(encoding="utf-8"))
    assert meta["param"]["ObstacleNoise"] == sigma
    x, y, heading = meta["pose"]
    angles = np.array([0.0, 60.0, -60.0, 180.0])
    walls = WallMap.from_lab(read_lab(LABS / meta["lab"]))
    ideals = ideal_reading(sensor_distances(walls, x, y, np.deg2rad(heading + angles)))
    with gzip.open(GOLDEN / f"noise/{run}.csv.gz", "rt", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for sensor, ideal in enumerate(ideals):
        codes, counts = np.unique([round(10 * float(row[f"ir{sensor}"])) for row in rows], return_counts=True)
        probability = np.exp(reading_log_likelihood(codes / 10, ideal, sigma))
        expected = len(rows) * probability
        often = expected > 8
        statistic = ((counts - expected)[often] ** 2 / expected[often]).sum()
        assert stats.chi2.sf(statistic, often.sum() - 1) > 1e-4
        assert probability.sum() > 0.99


def test_without_noise_only_the_rounded_reading_is_possible():
    ideal = np.array([0.3499, 0.35, 0.4499, 0.45])
    np.testing.assert_array_equal(reading_log_likelihood(0.4, ideal, 0.0), [-np.inf, 0.0, 0.0, -np.inf])


def test_without_noise_every_recorded_reading_is_certain(golden):
    with gzip.open(golden / "ir/other_robots.csv.gz", "rt", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    reading = np.array([float(row["ir_value_noise0"]) for row in rows])
    ideal = np.array([float(row["ideal_with_other"]) for row in rows])
    np.testing.assert_array_equal(reading_log_likelihood(reading, ideal, 0.0), 0.0)


def test_arguments_broadcast():
    result = reading_log_likelihood([[0.1], [0.2]], np.zeros(3), np.array([0.0, 0.1, 0.2]))
    assert result.shape == (2, 3)
    assert reading_log_likelihood(0.1, 0.1, 0.1).shape == ()
