"""Readings of a recorded run against the right lab and another, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest

from agent.offline.expected_readings import compute_expected_readings
from agent.offline.map_fit import Fit, map_fit
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab, lab_with_hash
from ciberrato.world.parameters import Parameters

ANGLES = (0.0, 90.0, -90.0, 180.0)
QUIET = Parameters(motors_noise=0.0)


def readings_of(lab: str, row: int, columns: range, seed: int) -> list[tuple[float, ...]]:
    """Readings at the centres of some cells, drawn from the sensor's own description."""
    ideal = compute_expected_readings(read_lab(find_lab(lab)), ANGLES, QUIET).readings[row, list(columns)]
    noisy = ideal + np.random.default_rng(seed).normal(0.0, 0.1, ideal.shape)
    return [tuple(each) for each in (np.floor(10.0 * noisy + 0.5) / 10.0).tolist()]


@pytest.mark.parametrize("seed", range(5))
def test_the_right_lab_is_not_doubted_and_another_is(seed: int) -> None:
    steps = readings_of("standard", 3, range(2, 14), seed)
    scores = {}
    for lab in ("standard", "maze", "rooms"):
        expected = compute_expected_readings(read_lab(find_lab(lab)), ANGLES, QUIET)
        scores[lab] = map_fit(steps, expected, 0.1)
        assert scores[lab].steps == 12
    assert abs(scores["standard"].score) < 3.5
    assert not scores["standard"].is_doubtful
    assert scores["maze"].is_doubtful
    assert scores["rooms"].is_doubtful


def test_the_right_lab_surprises_no_more_than_expected() -> None:
    """By sampling exact readings: the model allows for strays, so that they surprise it rather less."""
    expected = compute_expected_readings(read_lab(find_lab("standard")), ANGLES, QUIET)
    scores = [
        map_fit(readings_of("standard", 3, range(2, 8), seed), expected, 0.1).score for seed in range(30)
    ]
    assert -1.5 < np.mean(scores) < 0.0
    assert 0.3 < np.std(scores) < 1.2
    assert max(scores) < 3.0


def test_long_runs_need_more_than_short_ones() -> None:
    assert Fit(5.0, 3).is_doubtful
    assert not Fit(4.4, 1).is_doubtful
    assert not Fit(6.5, 12).is_doubtful
    assert Fit(7.1, 40).is_doubtful
    assert not map_fit(
        [], compute_expected_readings(read_lab(find_lab("standard")), ANGLES, QUIET)
    ).is_doubtful


def test_a_lab_is_found_by_what_it_holds() -> None:
    import hashlib

    path = find_lab("maze")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert lab_with_hash(digest) == lab_with_hash(digest.upper()) == path
    assert lab_with_hash("0" * 64) is None
