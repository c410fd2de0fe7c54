"""The tables of the ground-truth worker: against recorded distances, against single poses, and its thread."""

import csv
import gzip
import io
import math
import threading
from dataclasses import replace

import numpy as np
import pytest

import agent.offline.expected_readings
from agent.offline.expected_readings import (
    ExpectedReadingsWorker,
    compute_expected_readings,
    pose_error,
    pose_error_nodes,
)
from ciberrato.errors import LabError
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, nearest_in_cone, sensor_distances
from ciberrato.labs import find_lab
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from tests.recordings import OWN

ANGLES = (0.0, 90.0, -90.0, 180.0)


def recorded_readings(lab_name: str) -> dict[tuple[float, float, float], float]:
    data = gzip.decompress((OWN / "ir/own_cell_centres.csv.gz").read_bytes())
    return {
        (float(row["x"]), float(row["y"]), float(row["sensor_angle_deg"])): float(row["distance"])
        for row in csv.DictReader(io.StringIO(data.decode()))
        if row["lab"].endswith(lab_name) and float(row["dir_deg"]) == 0.0
    }


@pytest.mark.parametrize("name", ["standard", "corridors", "maze"])
def test_readings_are_those_of_the_real_sensor(name: str) -> None:
    recorded = recorded_readings(f"{name}_lab.xml")
    truth = compute_expected_readings(read_lab(find_lab(name)), ANGLES)
    rows, columns, _ = truth.readings.shape
    assert (rows, columns) == (7, 14)
    for row in range(rows):
        for column in range(columns):
            for sensor, angle in enumerate(ANGLES):
                distance = recorded[2.0 * column + 1.0, 2.0 * row + 1.0, angle]
                expected = 1.0 / distance if distance > 0.01 else 100.0
                assert truth.readings[row, column, sensor] == pytest.approx(expected, rel=1e-12)


def test_nothing_is_fixed_to_one_size() -> None:
    truth = compute_expected_readings(read_lab(find_lab("wide")), ANGLES, Parameters())
    assert truth.readings.shape == (14, 28, 4)
    assert truth.east.shape == (14, 27)
    assert truth.north.shape == (13, 28)
    assert truth.free.shape == (14, 28)
    assert truth.spread is not None
    assert truth.spread.shape == (27, 14, 28, 4)


def test_the_second_model_is_the_nearest_point_of_the_cone(standard: Lab) -> None:
    sensor, cone = (compute_expected_readings(standard, ANGLES, model=model) for model in ("sensor", "cone"))
    walls = WallMap.from_lab(standard)
    expected = ideal_reading(nearest_in_cone(walls, 9.0, 3.0, np.radians(ANGLES)))
    np.testing.assert_array_equal(cone.readings[1, 4], expected)
    assert (cone.readings >= sensor.readings - 1e-12).all()


def test_spread_holds_the_readings_at_displaced_poses(standard: Lab) -> None:
    truth = compute_expected_readings(standard, ANGLES, Parameters(motors_noise=3.0))
    assert truth.spread is not None
    walls = WallMap.from_lab(standard)
    for node in (0, 5, 13, 26):
        ahead, left, turn = truth.offsets[node]
        for row, column in ((0, 0), (3, 2), (6, 13)):
            x, y = 2.0 * column + 1.0 + ahead, 2.0 * row + 1.0 + left
            expected = ideal_reading(sensor_distances(walls, x, y, np.radians(ANGLES) + turn))
            np.testing.assert_allclose(truth.spread[node, row, column], expected, rtol=1e-12)
    centre = np.flatnonzero((truth.offsets == 0.0).all(axis=1))
    np.testing.assert_allclose(truth.spread[centre[0]], truth.readings, rtol=1e-12)


def test_the_nodes_have_the_moments_of_the_errors() -> None:
    deviations = (0.03, 0.02, 0.05)
    offsets, weights = pose_error_nodes(deviations)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights > 0.0).all()
    np.testing.assert_allclose(weights @ offsets, 0.0, atol=1e-15)
    covariance = (offsets * weights[:, None]).T @ offsets
    np.testing.assert_allclose(covariance, np.diag(deviations) ** 2, atol=1e-15)
    np.testing.assert_allclose(weights @ offsets**4, 3.0 * np.array(deviations) ** 4, rtol=1e-9)


def test_without_motor_noise_there_is_no_spread(standard: Lab) -> None:
    for parameters in (None, Parameters(motors_noise=0.0)):
        truth = compute_expected_readings(standard, ANGLES, parameters)
        assert truth.spread is None
        assert truth.offsets.tolist() == [[0.0, 0.0, 0.0]]
        assert truth.weights.tolist() == [1.0]


def test_more_noise_makes_more_error() -> None:
    quiet, loud = pose_error(Parameters()), pose_error(Parameters(motors_noise=5.0))
    assert all(small < large for small, large in zip(quiet, loud, strict=True))
    deaf = pose_error(replace(Parameters(), compass_sensor=False))
    assert deaf[2] > quiet[2]
    assert all(
        math.isfinite(value) for value in pose_error(Parameters(compass_noise=0.0, obstacle_noise=0.0))
    )


def test_the_worker_hands_over_the_tables(standard: Lab) -> None:
    worker = ExpectedReadingsWorker(standard, ANGLES)
    worker.start()
    worker.announce(Parameters())
    expected = compute_expected_readings(standard, ANGLES, Parameters())
    truth = worker.result()
    np.testing.assert_array_equal(truth.readings, expected.readings)
    np.testing.assert_array_equal(truth.spread, expected.spread)
    assert worker.result() is truth


def test_nobody_waits_for_the_worker_but_who_asks_for_the_result(
    standard: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = threading.Event()
    compute = agent.offline.expected_readings.compute_expected_readings

    def slow(*arguments: object, **options: object) -> object:
        go_on.wait()
        return compute(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(agent.offline.expected_readings, "compute_expected_readings", slow)
    worker = ExpectedReadingsWorker(standard, ANGLES)
    worker.start()
    worker.announce(Parameters())
    assert worker.error is None
    go_on.set()
    assert worker.result().readings.shape == (7, 14, 4)


@pytest.mark.parametrize(
    ("problem", "complaint"),
    [
        (LabError("no room", source="x"), "x: no room"),
        (MemoryError(), "not enough memory"),
        (ZeroDivisionError("!"), "!"),
    ],
)
def test_what_stops_the_worker_is_told(
    standard: Lab, monkeypatch: pytest.MonkeyPatch, problem: Exception, complaint: str
) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise problem

    monkeypatch.setattr(agent.offline.expected_readings, "compute_expected_readings", fail)
    worker = ExpectedReadingsWorker(standard, ANGLES)
    worker.start()
    with pytest.raises((LabError, ZeroDivisionError), match=complaint):
        worker.result()
    assert worker.error is not None


def test_an_abandoned_worker_ends_without_working(standard: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    called = []
    monkeypatch.setattr(
        agent.offline.expected_readings, "compute_expected_readings", lambda *a, **k: called.append(1)
    )
    worker = ExpectedReadingsWorker(standard, ANGLES)
    worker.start()
    worker.abandon()
    worker.abandon()
    assert called == []
    assert not any(thread.name == "expected readings" for thread in threading.enumerate())
