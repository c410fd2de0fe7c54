"""The two-sample tests of noise: ours agrees with the recordings, and they notice what does not."""

from __future__ import annotations

import csv
import gzip
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.conformance import noise
from tests.recordings import GOLDEN, LABS, OWN, needs


@pytest.mark.parametrize(
    "golden",
    [
        pytest.param(OWN, id="own"),
        pytest.param(GOLDEN, id="all", marks=[pytest.mark.slow, needs("CIBERRATO_GOLDEN")]),
    ],
)
def test_sensors_and_motors_draw_as_the_real_ones_do(golden: Path) -> None:
    rows = list(noise.rows(golden, LABS))
    assert sum(row.cases for row in rows) >= 5900
    assert [(row.check, row.note) for row in rows if not row.passed] == []


def test_the_test_of_discrete_samples_is_calibrated_and_notices_a_small_shift() -> None:
    rng = np.random.default_rng(3)

    def probability(shift: float) -> float:
        samples = [np.round(rng.normal(mean, 0.1, 4000), 1) for mean in (0.0, shift)]
        return noise.homogeneity(*(Counter(sample.tolist()) for sample in samples))[0]

    alike = np.array([probability(0.0) for _ in range(200)])
    assert np.quantile(alike, 0.5) == pytest.approx(0.5, abs=0.12)
    assert (alike < 0.05).mean() == pytest.approx(0.05, abs=0.05)
    assert all(probability(0.016) < 0.001 for _ in range(20)), "a sixth of the standard deviation"


def test_a_wrong_motor_noise_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "noise").mkdir()
    path = OWN / "noise/m2_motor_direct_seed12345.csv.gz"
    with gzip.open(path, "rt", newline="") as file:
        rows = list(csv.DictReader(file))
    before, changed = 0.0, 0.0
    for row in rows[1:]:
        factor = float(row["left_out"]) / ((0.1 + before) / 2)
        before = float(row["left_out"])
        changed = (0.1 + changed) / 2 * (1 + 1.2 * (factor - 1))
        row["left_out"] = repr(changed)
    with gzip.open(tmp_path / "noise" / path.name, "wt", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    _, left, right = noise.rows(tmp_path, None)
    assert (left.passed, right.passed) == (False, True)
