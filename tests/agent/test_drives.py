"""Whole drives through noise: every cell found, nothing run into. Prints the figures (pytest -s)."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from agent.offline.expected_readings import pose_error
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import read_parameters
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import cell_openings
from ciberrato.labs import find_lab, find_parameters
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

DEFAULT = Parameters()


def errors(runs: list[Any]) -> np.ndarray:
    """True pose less that of the cell's centre at each cell entered: along, lateral, heading in degrees."""
    return np.array(
        [
            (along - 2.0 * step, lateral, math.degrees(heading))
            for run in runs
            for step, (along, lateral, heading) in enumerate(run.truth)
            if step > 0
        ]
    )


def figures(name: str, runs: list[Any]) -> None:
    means, deviations = errors(runs).mean(axis=0), errors(runs).std(axis=0)
    text = ", ".join(f"{m:+.3f} ± {d:.3f}" for m, d in zip(means, deviations, strict=True))
    print(f"\n{name}: {sum(run.steps for run in runs)} steps; along, lateral, heading/deg: {text}")


@pytest.mark.slow
@pytest.mark.parametrize(("motors_noise", "seeds"), [(1.5, 200), (5.0, 60)])
@pytest.mark.parametrize(
    ("name", "start", "steps"), [("corridors", (1, 7, 0), 14), ("standard", (5, 7, 0), 12)]
)
def test_every_cell_is_found_over_many_seeds(
    drive: Any, name: str, start: tuple[float, float, float], steps: int, motors_noise: float, seeds: int
) -> None:
    parameters = replace(DEFAULT, motors_noise=motors_noise)
    runs = drive(read_lab(find_lab(name)), [start] * seeds, parameters, seed=11)
    figures(f"{name}, motors {motors_noise} %", runs)
    assert [run.steps for run in runs] == [steps] * seeds
    assert all(run.collisions == 0 for run in runs)
    assert (np.abs(errors(runs)[:, 0]) < 0.5).all()
    measured = errors(runs).std(axis=0)
    along, lateral, heading = pose_error(parameters)
    for expected, got in zip((along, lateral, math.degrees(heading)), measured, strict=True):
        assert expected == pytest.approx(got, rel=0.35)


@pytest.mark.slow
def test_harsh_parameters(drive: Any, standard: Lab) -> None:
    parameters = read_parameters(find_parameters("harsh"))
    runs = drive(standard, [(5, 7, 0)] * 60, parameters, seed=12)
    figures("standard, harsh", runs)
    assert [run.steps for run in runs] == [12] * 60
    assert sum(run.collisions > 0 for run in runs) <= 1


@pytest.mark.parametrize("cruise", [0.04, 0.07, 0.15])
def test_any_cruising_speed_lands_on_the_centres(drive: Any, corridors: Lab, cruise: float) -> None:
    parameters = replace(DEFAULT, motors_noise=0.0)
    (run,) = drive(corridors, [(13, 7, 0)], parameters, cruise=cruise)
    assert run.steps == 8
    along, lateral, heading = np.abs(errors([run])).max(axis=0)
    assert along < 0.006
    assert lateral == heading == 0.0


def test_without_motor_noise_the_command_is_the_cruising_speed(drive: Any, corridors: Lab) -> None:
    (run,) = drive(corridors, [(13, 7, 0)], replace(DEFAULT, motors_noise=0.0))
    assert {cycle.command for cycle in run.cycles if 0 < cycle.time < 121} == {(0.1, 0.1)}
    assert run.times[:7] == [0, 21, 41, 61, 81, 101, 121]


@pytest.mark.parametrize("name", ["maze", "corridors", "twins", "rooms"])
def test_it_stops_where_the_walls_are(drive: Any, name: str) -> None:
    """From every third cell: as many cells as the lab's openings say, slanted walls included."""
    lab = read_lab(find_lab(name))
    walls, (east, _) = WallMap.from_lab(lab), cell_openings(lab)
    starts = [
        (2 * column + 1, 2 * row + 1, 0)
        for row in range(lab.rows)
        for column in range(lab.columns)
        if (row + column) % 3 == 0
        and walls.distance(2 * column + 1, 2 * row + 1) > 0.6
        and not walls.point_in_polygons(2 * column + 1, 2 * row + 1)
    ]
    assert len(starts) > 20
    for (x, y, _), run in zip(starts, drive(lab, starts, DEFAULT, seed=2), strict=True):
        row = east[y // 2, x // 2 :]
        assert run.steps == 1 + (int(np.argmin(row)) if not row.all() else len(row)), (x, y)


@pytest.mark.parametrize("parameters", ["default", "harsh"])
def test_it_turns_to_the_right_first(drive: Any, standard: Lab, parameters: str) -> None:
    directions = [90, 180, -90, 270, 45, -30, 179]
    runs = drive(
        standard,
        [(15, 7, direction) for direction in directions],
        read_parameters(find_parameters(parameters)),
    )
    assert [run.steps for run in runs] == [7] * len(directions)
    limit = 4.0 if parameters == "default" else 12.0
    assert max(abs(math.degrees(run.truth[0][2])) for run in runs) < limit


@pytest.mark.parametrize(
    "changes",
    [
        {"obstacle_latency": 2, "compass_latency": 4},
        {"compass_sensor": False},
        {"obstacle_requestable": True, "compass_requestable": True, "requests_per_cycle": 2},
        {"obstacle_requestable": True, "compass_requestable": True, "requests_per_cycle": 5},
        {"collision_requestable": True, "requests_per_cycle": 0},
    ],
)
def test_poorer_sensors_do_not_lose_it(drive: Any, standard: Lab, changes: dict[str, Any]) -> None:
    runs = drive(standard, [(9, 7, 0)] * 8, replace(DEFAULT, **changes), seed=6)
    assert [run.steps for run in runs] == [10] * 8
    assert all(run.collisions == 0 for run in runs)


def test_a_pause_changes_nothing(drive: Any, standard: Lab) -> None:
    parameters = replace(DEFAULT, motors_noise=0.0)
    (straight,) = drive(standard, [(15, 7, 0)], parameters)
    (paused,) = drive(standard, [(15, 7, 0)], parameters, pauses=range(50, 80))
    assert paused.times == straight.times
