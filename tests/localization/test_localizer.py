"""Both presets against the enumeration of every start cell, written with plain loops and math only."""

import math

import numpy as np
import pytest

from agent.offline.expected_readings import ExpectedReadings
from agent.offline.localizer import localize
from benchmarks.enumeration import enumerate_starts, rounded_probability

SIGMA = 0.1


def table(generator, *, rows=3, columns=5, errors=1, closed=0.3, free=None):
    readings = generator.uniform(0.1, 3, (rows, columns, 4))
    weights = generator.uniform(0.2, 1, errors)
    spread = None
    if errors > 1:
        spread = readings + generator.normal(0, 0.3, (errors, rows, columns, 4))
    return ExpectedReadings(
        readings=readings,
        east=generator.random((rows, columns - 1)) > closed,
        north=np.ones((rows - 1, columns), dtype=bool),
        free=np.ones((rows, columns), dtype=bool) if free is None else free,
        offsets=np.zeros((errors, 3)),
        weights=weights / weights.sum(),
        spread=spread,
    )


def drive(generator, truth, steps):
    """Rounded noisy readings along an open stretch."""
    rows, columns = truth.free.shape
    starts = [
        (row, column)
        for row in range(rows)
        for column in range(columns - steps + 1)
        if truth.free[row, column] and truth.east[row, column : column + steps - 1].all()
    ]
    row, column = starts[generator.integers(len(starts))]
    ideal = truth.readings[row, column : column + steps]
    return np.floor(10 * (ideal + generator.normal(0, SIGMA, ideal.shape)) + 0.5) / 10


@pytest.mark.parametrize("preset", ["seed", "calibrated"])
@pytest.mark.parametrize("errors", [1, 4])
@pytest.mark.parametrize("seed", range(6))
def test_the_beliefs_equal_those_of_the_enumeration_of_all_start_cells(preset, errors, seed):
    generator = np.random.default_rng(seed)
    truth = table(generator, errors=errors, closed=0.2)
    readings = drive(generator, truth, 3).tolist()
    readings[1][2] = None  # a sensor that did not answer
    found = localize(readings, truth, preset=preset, obstacle_noise=SIGMA)
    assert found.recoveries == ()
    expected = enumerate_starts(readings, truth, preset=preset, sigma=SIGMA)
    np.testing.assert_allclose(found.beliefs[1:], expected, rtol=1e-9, atol=1e-15)


def test_the_evidence_is_the_probability_of_the_readings():
    generator = np.random.default_rng(4)
    truth = table(generator, closed=0.0)
    readings = drive(generator, truth, 3).tolist()
    rows, columns = truth.free.shape
    total = sum(
        math.prod(
            rounded_probability(value, truth.readings[row, start + k, i], SIGMA)
            for k, reading in enumerate(readings)
            for i, value in enumerate(reading)
        )
        for row in range(rows)
        for start in range(columns - 2)
    ) / (rows * columns)
    found = localize(readings, truth, obstacle_noise=SIGMA)
    assert found.log_evidence.sum() == pytest.approx(math.log(total), rel=1e-9)


def test_the_prior_is_uniform_over_the_cells_where_a_robot_fits():
    free = np.array([[True, False], [True, True]])
    truth = table(np.random.default_rng(0), rows=2, columns=2, free=free)
    np.testing.assert_allclose(localize([], truth).beliefs, [[[1 / 3, 0], [1 / 3, 1 / 3]]])
    np.testing.assert_allclose(localize([], truth, preset="seed").beliefs, np.full((1, 2, 2), 0.25))


@pytest.mark.parametrize("preset", ["seed", "calibrated"])
def test_more_steps_than_columns_restart_from_the_reading_alone(preset):
    truth = table(np.random.default_rng(1), rows=2, columns=3, closed=0.0)
    readings = [truth.readings[0, 1].round(1)] * 5
    found = localize(readings, truth, preset=preset)
    assert found.recoveries == (3,)  # the fourth reading: nothing is left to the right of three columns
    assert np.isfinite(found.beliefs).all()
    np.testing.assert_allclose(found.beliefs.sum(axis=(1, 2)), 1)
    assert found.beliefs[4][0, 1] > 0.5


def test_calibrated_does_not_pass_walls_and_seed_does():
    readings = np.full((1, 3, 4), 0.5)
    truth = table(np.random.default_rng(0), rows=1, columns=3)
    truth = ExpectedReadings(
        readings=readings,
        east=np.array([[False, True]]),
        north=np.ones((0, 3), dtype=bool),
        free=np.ones((1, 3), dtype=bool),
        offsets=truth.offsets,
        weights=truth.weights,
    )
    two = [[0.5] * 4] * 2
    np.testing.assert_allclose(localize(two, truth).beliefs[-1], [[0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(localize(two, truth, preset="seed").beliefs[-1], [[0, 0.5, 0.5]], atol=1e-12)


def test_a_reading_far_from_every_cell_is_still_weighed():
    truth = table(np.random.default_rng(2), rows=2, columns=3)
    found = localize([[40.0, 40.0, 40.0, 40.0]], truth)  # some 400 standard deviations off
    assert np.isfinite(found.beliefs).all()
    assert found.recoveries == ()
    nearest = np.unravel_index((((40 - truth.readings) ** 2).sum(axis=-1)).argmin(), (2, 3))
    assert found.beliefs[-1][nearest] > 0.99


def test_wrong_shapes_and_presets_are_errors():
    truth = table(np.random.default_rng(0))
    with pytest.raises(ValueError, match="3 readings a step for 4 sensors"):
        localize([[1.0, 2.0, 3.0]], truth)
    with pytest.raises(ValueError, match="unknown preset 'best'"):
        localize([], truth, preset="best")
