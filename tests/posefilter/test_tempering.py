"""Exponents of the readings, against an exact posterior: a small hidden Markov model, enumerated."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from ciberrato.localization.filtering.tempering import Tempering
from ciberrato.localization.records import FilterSettings

SETTINGS = FilterSettings()
SQUARE, NOISE = 0.4, 0.1
PLACES, READINGS, RUNS = 6, 12, 800
OFFSETS = (np.arange(61) + 0.5) / 61 * SQUARE - SQUARE / 2.0


def stage(settings=SETTINGS):
    lattice = SimpleNamespace(resolution=0.1)
    belief = SimpleNamespace(bin_width=math.radians(5.0))
    return SimpleNamespace(settings=settings, tables=SimpleNamespace(lattice=lattice), belief=belief)


def exponents(count, settings=SETTINGS):
    tempering = Tempering()
    return np.array([tempering.exponent(0.1, 0.0, stage(settings)) for _ in range(count)])


@pytest.fixture(scope="module")
def posteriors():
    """Return the log likelihoods of each square, exact ones of all readings so far, and the true squares.

    A robot stands somewhere in one of six squares. Its place in the square, unknown, is the same in all
    readings: each is that of a wall whose distance from the square's middle is known. The squares look much
    alike.
    """
    generator = np.random.default_rng(3)
    walls = generator.uniform(0.8, 2.0, (RUNS, READINGS, 1))
    distances = walls + generator.uniform(-0.3, 0.3, (RUNS, 1, PLACES))
    distances += 0.06 * generator.standard_normal((RUNS, READINGS, PLACES))
    true = generator.integers(PLACES, size=RUNS)
    offset = generator.uniform(-SQUARE / 2.0, SQUARE / 2.0, RUNS)
    seen = distances[np.arange(RUNS), :, true] + offset[:, np.newaxis]
    readings = 1.0 / seen + NOISE * generator.standard_normal(seen.shape)
    ideal = 1.0 / (distances[..., np.newaxis] + OFFSETS)
    each = -0.5 * ((readings[..., np.newaxis, np.newaxis] - ideal) / NOISE) ** 2
    squares = np.log(np.exp(each).mean(axis=-1))
    joint = np.cumsum(each, axis=1)
    peak = joint.max(axis=(-2, -1), keepdims=True)
    exact = np.log(np.exp(joint - peak).mean(axis=-1) + 1e-300) + peak[..., 0]
    return squares, exact, true


def belief(log_weights):
    weights = np.exp(log_weights - log_weights.max(axis=-1, keepdims=True))
    return weights / weights.sum(axis=-1, keepdims=True)


def tempered(squares, powers):
    return belief(np.cumsum(squares * powers[:, np.newaxis], axis=1))


def log_loss(said, true):
    """Return the mean of -log p of the true square, by reading."""
    return -np.log(said[np.arange(RUNS), :, true] + 1e-300).mean(axis=0)


def test_the_first_reading_counts_in_full_because_its_likelihood_is_exact(posteriors):
    squares, exact, _ = posteriors
    powers = exponents(READINGS)
    assert powers[0] == SETTINGS.first_exponent == 1.0
    assert tempered(squares, powers)[:, 0] == pytest.approx(belief(exact)[:, 0], abs=1e-12)


def test_the_product_claims_too_much_and_a_constant_exponent_too_little(posteriors):
    squares, exact, true = posteriors
    constant = np.full(READINGS, SETTINGS.exponent)
    cases = {
        "exact": belief(exact),
        "product": tempered(squares, np.ones(READINGS)),
        "constant": tempered(squares, constant),
    }
    excess = {}
    for name, said in cases.items():
        best = said.max(axis=-1)
        right = said.argmax(axis=-1) == true[:, np.newaxis]
        excess[name] = (best - right).mean(axis=0) / np.sqrt((best * (1.0 - best)).mean(axis=0) / RUNS)
    assert (np.abs(excess["exact"]) < 3.0).all()
    assert excess["product"][-1] > 6.0
    assert excess["constant"][:4].mean() < -3.0


def test_the_falling_exponents_lose_less_than_either(posteriors):
    squares, exact, true = posteriors
    best = log_loss(belief(exact), true)
    falling = log_loss(tempered(squares, exponents(READINGS)), true) - best
    constant = log_loss(tempered(squares, np.full(READINGS, SETTINGS.exponent)), true) - best
    product = log_loss(tempered(squares, np.ones(READINGS)), true) - best
    assert falling[0] == pytest.approx(0.0, abs=1e-9)
    assert (falling[:2] < constant[:2]).all()
    assert (falling[1:] < product[1:]).all()


def test_the_exponents_fall_to_the_lasting_one_and_begin_anew_with_the_belief():
    powers = exponents(80)
    assert (np.diff(powers) < 0.0).all()
    fallen = (powers - SETTINGS.exponent) / (1.0 - SETTINGS.exponent)
    assert np.log(fallen) == pytest.approx(-np.arange(80) / SETTINGS.settling)
    tempering = Tempering()
    for _ in range(30):
        tempering.exponent(0.1, 0.0, stage())
    tempering.begin_anew()
    assert tempering.exponent(0.1, 0.0, stage()) == 1.0


def test_no_reading_counts_in_full_while_the_motion_is_in_doubt():
    tempering = Tempering()
    tempering.doubt()
    assert [tempering.exponent(0.1, 0.0, stage()) for _ in range(3)] == [SETTINGS.exponent] * 3
    tempering.begin_anew()
    assert tempering.exponent(0.1, 0.0, stage()) == 1.0


def test_a_robot_at_rest_has_one_reading_and_little_more():
    tempering = Tempering()
    powers = [tempering.exponent(0.0, 0.0, stage()) for _ in range(25)]
    assert powers[0] == 1.0
    assert powers[1:20] == pytest.approx([SETTINGS.least_exponent / number for number in range(2, 21)])
    assert powers[20:] == [0.0] * 5
