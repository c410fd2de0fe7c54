"""Runs of the real simulator, driven again: full precision, without noise."""

from __future__ import annotations

import csv
import gzip
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.conformance.files import read_named_lab
from ciberrato.files.parameters import read_parameters
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation
from tests.recordings import FOLDERS, LABS, by_name


def scenarios() -> dict[str, tuple[Path, dict[str, Any]]]:
    """Folder and description of each recorded run whose lab is here; by name and lab."""
    return {
        f"{name}, {scenario['lab']}": (folder / "physics", scenario)
        for folder in FOLDERS
        for name, scenario in json.loads((folder / "physics/scenarios.json").read_text()).items()
        if (folder / f"physics/direct/{name}.csv.gz").exists()
        and read_named_lab(scenario["lab"], LABS) is not None
    }


def rows_by_time(path: Path) -> dict[int, list[dict[str, str]]]:
    rows: dict[int, list[dict[str, str]]] = {}
    with gzip.open(path, "rt") as file:
        for row in csv.DictReader(file):
            rows.setdefault(int(row["time"]), []).append(row)
    return rows


def commands(scenario: dict[str, Any]) -> Iterator[dict[int, Actions]]:
    for count, *powers in scenario["commands_n_then_left_right_per_robot"]:
        for _ in range(count):
            if powers == ["hold"]:
                yield {}
            else:
                yield {
                    number + 1: Actions(left_motor=powers[2 * number], right_motor=powers[2 * number + 1])
                    for number in range(len(powers) // 2)
                }


@pytest.mark.parametrize("name", by_name({name: folder for name, (folder, _) in scenarios().items()}))
def test_a_recorded_run_comes_out_again(name: str) -> None:
    folder, scenario = scenarios()[name]
    lab = read_named_lab(scenario["lab"], LABS)
    assert lab is not None
    parameters = replace(read_parameters(folder / "param_direct.xml"), sim_time=0)
    grid = StartGrid(
        positions=tuple(
            GridPosition(x=x, y=y, direction_deg=direction)
            for x, y, direction in scenario["start_poses_x_y_dirdeg"]
        )
    )
    simulation = Simulation(lab, grid, parameters)
    for _ in grid.positions:
        simulation.register(RobotRegistration())
    simulation.launch()
    rows = rows_by_time(folder / f"direct/{name.partition(',')[0]}.csv.gz")
    for actions in commands(scenario):
        measures = simulation.step(actions)
        for robot, row in zip(simulation.robots, rows[simulation.time], strict=True):
            assert (robot.left_output, robot.right_output) == (
                float(row["left_out"]),
                float(row["right_out"]),
            )
            pose = (robot.x, robot.y, robot.heading)
            assert pose == pytest.approx((float(row["x"]), float(row["y"]), float(row["dir_rad"])), abs=1e-9)
            assert (int(robot.touches_wall), int(robot.touches_robot), robot.collisions) == (
                int(row["collide_wall"]),
                int(row["collide_robot"]),
                int(row["collisions"]),
            )
            got = measures[robot.robot_id]
            assert got.compass == float(row["compass"])
            # The open lab stands in for labs of lines, which have other targets.
            assert got.ground == int(row["ground"]) or scenario["lab"] == "maps/open_lab.xml"
            assert got.collision == (row["collide_wall"] == "1" or row["collide_robot"] == "1")
            assert got.infrared == tuple(float(row[f"ir{number}"]) for number in range(4))
    assert simulation.time == max(rows)
