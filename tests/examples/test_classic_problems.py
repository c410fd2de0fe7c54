"""The classic problems' numbers, each against a computation of its own."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from ciberrato.files.lab import default_lab
from ciberrato.infrared.model import cell_readings
from examples import PROBLEMS, ciberrato_grid, cli, hallway, lecture, museum, pose_grid, road

ROOT = Path(__file__).parents[2]


def test_grid_beliefs_equal_the_enumeration_of_all_start_cells():
    run = ciberrato_grid.solve(seed=5)
    ideal = cell_readings(default_lab(), (0.0, 90.0, -90.0, 180.0))
    assert run.beliefs.shape == (13, 7, 14)
    np.testing.assert_allclose(run.beliefs[0], 1 / 98)
    for steps in range(1, 13):
        joint = np.zeros((7, 14))  # by the present cell
        for row, column in np.ndindex(7, 14):
            here = column + steps - 1
            if here < 14:
                errors = [run.readings[k] - ideal[row, column + k] for k in range(steps)]
                joint[row, here] = math.exp(-sum((e**2).sum() for e in errors) / 0.2)
        np.testing.assert_allclose(run.beliefs[steps], joint / joint.sum(), atol=1e-12)


def test_grid_run_ends_certain_of_the_true_cell():
    run = ciberrato_grid.solve(seed=1)
    assert run.true_cells[0] == (3, 2)
    assert run.true_cells[-1] == (3, 13)
    assert run.beliefs[-1][3, 13] > 0.999
    assert np.array_equal(run.readings, np.round(run.readings, 1))


def test_lecture_numbers():
    solution = lecture.solve()
    assert lecture.PRIOR.sum() == pytest.approx(1.0)
    assert sum(lecture.KERNEL.values()) == pytest.approx(1.0)
    assert {k: round(v, 9) for k, v in solution.terms.items()} == {
        (3, 3): 0.09, (2, 3): 0.005, (3, 2): 0.036, (3, 4): 0.01,
    }  # fmt: skip
    assert solution.predicted[1, 2] == pytest.approx(0.141)
    assert solution.predicted.sum() == pytest.approx(1.0)
    assert solution.evidence == pytest.approx(0.04)
    assert solution.posterior[1, 2] == pytest.approx(0.04 * 0.141 / 0.04)
    column = solution.predicted[1].sum()
    assert solution.posterior_if_nearer[1, 2] == pytest.approx(
        0.04 * 0.141 / (0.04 * column + 0.01 * (1 - column))
    )


def road_by_loops(data, steps):
    """Predict and correct with nested loops over the cells."""
    belief = [1 / 100] * 100
    for step in range(steps):
        after = [0.0] * 100
        norm = sum(math.exp(-0.5 * k * k) for k in range(-8, 9))
        for i in range(100):
            for j in range(100):
                if abs(j - i - 1) <= 8:
                    after[j] += belief[i] * math.exp(-0.5 * (j - i - 1) ** 2) / norm
        for j in range(100):
            expected = sorted(m - (j + 0.5) for m in data.landmarks if 0 <= m - (j + 0.5) <= 30)
            read = sorted(data.observations[step])
            p = 1.0
            for z, e in zip(read, expected, strict=False):
                p *= 0.95 * stats.norm.pdf(z, e, 1.0)
            p *= 0.05 ** max(0, len(expected) - len(read)) * 0.001 ** max(0, len(read) - len(expected))
            after[j] *= p
        belief = [p / sum(after) for p in after]
    return np.array(belief)


def test_road_beliefs_equal_nested_loops_and_find_the_car():
    data = road.read(road.DATA)
    assert {9.0, 15.0, 25.0, 31.0, 59.0, 77.0} <= set(data.landmarks)
    result = road.localize(data)
    # The library cuts its kernel off where 1e-9 is left.
    np.testing.assert_allclose(result.corrected[5], road_by_loops(data, 6), atol=1e-6)
    truth = np.array([float(row["x"]) for row in road._rows(road.DATA / "road_truth.csv")])
    places = road.SPACE.axes[0].centres
    near = np.abs(places - truth[:, np.newaxis]) <= 2.5
    assert ((result.corrected * near).sum(axis=1)[3:] > 0.8).all()


def test_road_data_are_those_of_the_simulation(tmp_path):
    road.simulate(tmp_path, 1)
    for name in ("road_map.csv", "road_controls.csv", "road_observations.csv", "road_truth.csv"):
        assert (tmp_path / name).read_text() == (road.DATA / name).read_text()


def test_hallway_filter_equals_matrices_and_products():
    path = hallway.drive(3)
    good = hallway.solve(path)
    belief = np.full(170, 1 / 170)
    centres = (np.arange(170) + 0.5) * 5
    for step in range(80):
        matrix = np.zeros((170, 170))
        for i in range(170):
            for turn in (-1, 0, 1):
                matrix[i] += stats.norm.pdf(centres + 850 * turn, centres[i] + path.odometry[step], 5.0)
            matrix[i] /= matrix[i].sum()
        belief = belief @ matrix
        if path.door[step] >= 0:
            away = np.min([np.abs((centres - d + 425) % 850 - 425) for d in hallway.DOORS], axis=0)
            belief = belief * (1e-3 + 0.999 * np.exp(-0.5 * (away / 22.5) ** 2))
            belief /= belief.sum()
        np.testing.assert_allclose(good.corrected[step], belief, atol=2e-7)


def test_hallway_all_doors_are_passed_each_round():
    path = hallway.drive(1)
    rounds = 500 * 20 / 850
    for door in range(3):
        assert (path.door == door).sum() in (math.floor(rounds), math.ceil(rounds))


def test_the_correct_hallway_filter_beats_the_literal_one():
    wins, good_mean, bad_mean = 0, 0.0, 0.0
    for seed in range(8):
        path = hallway.drive(seed)
        good = hallway.error(hallway.solve(path).corrected, path.truth)[100:].mean()
        bad = hallway.error(hallway.solve_literally(path).corrected, path.truth)[100:].mean()
        wins += good < bad
        good_mean, bad_mean = good_mean + good / 8, bad_mean + bad / 8
    assert wins >= 7
    assert good_mean < 30.0 < bad_mean


def test_pose_grid_belief_follows_the_robot_where_the_odometry_does_not():
    errors, drift, told = [], [], []
    for seed in range(4):
        track = pose_grid.simulate(seed)
        result = pose_grid.localize(track)
        for belief, true in zip(result.beliefs, track.truth, strict=True):
            mean = pose_grid.moments(belief, pose_grid.SPACE).mean
            errors.append(math.hypot(*(mean[:2] - true[:2])))
            told.append(belief[tuple(pose_grid.SPACE.index(true))])
        drift.append(math.hypot(*(track.odometry[-1, :2] - track.truth[-1, :2])))
    assert len(track.truth) >= 16
    assert np.mean(errors) < 0.15
    assert np.mean(drift) > 1.0
    assert min(told) > 1e-3  # never sure of something wrong


def test_pose_grid_ranges_within_a_cell_equal_those_computed_pose_by_pose():
    mean, spread = pose_grid.expected_ranges()
    rng = np.random.default_rng(1)
    steps = (np.arange(5) + 0.5) / 5 - 0.5
    for _ in range(5):
        index = tuple(int(rng.integers(n)) for n in pose_grid.SPACE.shape)
        x, y, heading = pose_grid.SPACE.pose(index)
        ranges = [
            pose_grid.WALLS.cast(
                x + 0.3048 * a, y + 0.3048 * b, heading + math.radians(20) * c + pose_grid.BEAMS, 6.0
            )
            for a in steps
            for b in steps
            for c in steps
        ]
        np.testing.assert_allclose(mean[index], np.mean(ranges, axis=0), atol=1e-9)
        np.testing.assert_allclose(spread[index], np.std(ranges, axis=0), atol=1e-7)


@pytest.mark.slow
def test_museum_ends_sure_of_the_true_pose_after_being_torn_between_ten_rooms():
    hall = museum.build(cell=0.4, headings=90)
    tour = museum.visit(hall, 1)
    assert len(tour.truth) >= 21
    tour = tour._replace(truth=tour.truth[:24], scans=tour.scans[:24])
    stops = museum.localize(hall, tour)
    assert stops[0].mass_near_truth < 0.2
    assert np.mean([stop.mass_near_truth for stop in stops[-5:]]) > 0.5
    assert math.hypot(*(stops[-1].best_pose[:2] - tour.truth[-1, :2])) < 0.6


def test_museum_is_large_enough():
    grid = museum.hall(0.2)
    assert grid.occupied.size * 180 >= 5_000_000
    assert museum.WIDTH >= 40.0
    assert museum.DEPTH >= 30.0


@pytest.mark.parametrize("name", ["grid", "lecture", "road", "hallway", "poses"])
def test_each_problem_runs_and_writes_its_figures(name, tmp_path, capsys):
    assert cli.main([name, "--output", str(tmp_path), "--seed", "2"]) == 0
    written = [
        Path(line.split(" ", 1)[1])
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("wrote ")
    ]
    assert written
    for path in written:
        assert path.parent == tmp_path
        assert path.stat().st_size > 10_000
        if path.suffix == ".png":
            assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_road_beliefs_are_written_as_text(tmp_path):
    road.run(tmp_path, 1)
    lines = (tmp_path / "road_beliefs.txt").read_text().splitlines()
    assert lines[0] == "step 0 predicted"
    assert len(lines) == 2 * 2 * 40
    for line in lines[1::2]:
        values = [float(v) for v in line.split(" ")]
        assert len(values) == 100
        assert sum(values) == pytest.approx(1.0, abs=1e-3)


def test_the_module_lists_the_problems_and_refuses_others():
    listed = subprocess.run(
        [sys.executable, "-m", "examples"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert [line.split()[0] for line in listed.stdout.splitlines()] == list(PROBLEMS)
    wrong = subprocess.run(
        [sys.executable, "-m", "examples", "maze"], cwd=ROOT, capture_output=True, text=True
    )
    assert wrong.returncode == 2
    assert "grid, lecture, road" in wrong.stderr
    assert "Traceback" not in wrong.stderr
