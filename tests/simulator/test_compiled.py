"""Cycles in machine code against those in Python: the same to the last bit, messages and all."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ciberrato.errors import UsageError
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.assembly import build_server
from simulator_stub.options import parse_arguments
from simulator_stub.simulation import Simulation

pytest.importorskip("numba")

QUIET = {
    "compass_noise": 0.0,
    "obstacle_noise": 0.0,
    "motors_noise": 0.0,
    "line_sensor_true_probability": 1.0,
}
STATE = (
    *("x", "y", "heading", "wanted", "left_output", "right_output", "touches_wall", "touches_robot"),
    *("collided_before", "collisions", "state", "score", "visited", "arrival_time", "returning_time"),
)


def twins(lab: Lab, robots: int, changes: dict[str, Any], spacing: float = 1.1) -> list[Simulation]:
    """The same simulation in Python and in machine code; robots so near that they meet."""
    places = [
        GridPosition(x=3.0 + spacing * number, y=3.0, direction_deg=37.0 * number) for number in range(robots)
    ]
    made = []
    for compiled in (False, True):
        parameters = replace(Parameters(sim_time=0), **changes)
        simulation = Simulation(
            lab, StartGrid(positions=tuple(places)), parameters, seed=8, compiled=compiled
        )
        for number in range(robots):
            simulation.register(RobotRegistration(sensor_angles=((1, 20.0 * number),)))
        simulation.launch()
        made.append(simulation)
    return made


def drive(made: list[Simulation], cycles: int, rng: np.random.Generator, tenths: bool = False) -> list[int]:
    """Drive both alike, comparing everything; returns how many cycles were undecided, and decided."""
    decided = [0, 0]
    compiled = made[1]._compiled
    assert compiled is not None
    run = compiled.run

    def counted(*arguments: Any) -> bool:
        outcome = run(*arguments)
        decided[outcome] += 1
        return outcome

    compiled.run = counted  # type: ignore[method-assign]
    robots = len(made[0].robots)
    for cycle in range(cycles):
        wanted = {}
        for robot in range(1, robots + 1):
            left, right = rng.uniform(-0.1, 0.18, 2).tolist()
            if tenths:
                left = right = 0.1
            say = "here" if rng.random() < 0.1 else None
            ends = True if robot == 2 and cycle == cycles // 2 else None
            visiting = bool(rng.random() < 0.2)
            wanted[robot] = Actions(
                left_motor=left, right_motor=right, say=say, end_led=ends, visiting_led=visiting
            )
        outcomes = [simulation.step(wanted) for simulation in made]
        assert outcomes[0] == outcomes[1], cycle
        states = [
            [[getattr(robot, name) for name in STATE] for robot in simulation.robots] for simulation in made
        ]
        assert states[0] == states[1], cycle
        if cycle == cycles // 3:
            for simulation in made:
                simulation.place(1, 5.0, 3.0, 1.0)
                simulation.stop()
        if cycle == cycles // 3 + 2:
            for simulation in made:
                simulation.start()
        if cycle == 2 * cycles // 3 and robots > 2:
            for simulation in made:
                simulation.remove(3)
    del compiled.run
    return decided


@pytest.mark.parametrize("lab", ["maze", "standard", "diagonals", "rooms"])
@pytest.mark.parametrize("robots", [1, 5])
def test_noisy_robots_that_meet(lab: str, robots: int) -> None:
    made = twins(read_lab(find_lab(lab)), robots, {})
    undecided, decided = drive(made, 200, np.random.default_rng(robots))
    assert decided > 50 * undecided, "nearly all cycles are computed in machine code"
    assert any(robot.collisions for robot in made[0].robots)


@pytest.mark.parametrize(
    ("lab", "changes"),
    [
        ("maze", {}),
        ("diagonals", {"line_sensor_true_probability": 0.7, "compass_noise": 90.0}),
        ("standard", QUIET),
        ("standard", {"obstacle_noise": 60_000.0}),
    ],
    ids=["maze", "wrong lines", "quiet", "long readings"],
)
def test_messages_are_the_same_to_the_byte(lab: str, changes: dict[str, Any]) -> None:
    """Machine code writes a message with its readings, unless it has unusually long numbers, or speech."""
    made = twins(read_lab(find_lab(lab)), 2, changes)
    rng = np.random.default_rng(12)
    lines, written = set(), 0
    for cycle in range(250):
        if cycle == 100:
            for simulation in made:
                simulation.time = 2**40
        wanted = []
        for _ in range(2):
            left, right, *lights = rng.uniform(-0.1, 0.18, 5).tolist()
            end, returning, visiting = (light > 0.17 or None for light in lights)
            say = "& <so>" if rng.random() < 0.1 else None
            if end and cycle < 200:
                end = None
            wanted.append(
                Actions(
                    left_motor=left,
                    right_motor=right,
                    end_led=end,
                    returning_led=returning,
                    visiting_led=visiting,
                    say=say,
                )
            )
        sent = []
        for simulation in made:
            simulation.begin_cycle()
            for robot, actions in enumerate(wanted, start=1):
                simulation.act(robot, actions)
            sent.append(simulation.advance_encoded())
            simulation.end_cycle()
        assert sent[0] == sent[1], cycle
        lines |= {data.partition(b"LineSensor")[2][8:15] for data in sent[0].values()}
        compiled = made[1]._compiled
        assert compiled is not None
        written += made[1]._written and compiled._sizes[0] > 0
    assert len(lines) > 2 or changes is QUIET
    assert written > 150 or "obstacle_noise" in changes
    if changes.get("obstacle_noise"):
        assert 0 < written < 250


def test_lines_of_a_very_large_floor_are_looked_for_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simulator_stub.world.floor_tables.MOST_SQUARES", 1)
    made = twins(read_lab(find_lab("maze")), 2, {})
    _, decided = drive(made, 60, np.random.default_rng(2))
    assert decided > 30


@pytest.mark.parametrize(
    "changes", [QUIET, {"obstacle_noise": 0.0}, {"motors_noise": 0.0, "compass_noise": 0}]
)
def test_without_noise_where_readings_hang_on_rounding(changes: dict[str, Any]) -> None:
    made = twins(read_lab(find_lab("maze")), 3, changes, spacing=2.0)
    drive(made, 150, np.random.default_rng(4), tenths=True)


@pytest.mark.parametrize(
    "changes", [{"obstacle_latency": 2}, {"gps": True}, {"collision_latency": 1}, {"beacon_sensor": True}]
)
def test_robots_with_other_sensors_are_left_to_python(changes: dict[str, Any]) -> None:
    _, decided = drive(twins(read_lab(find_lab("maze")), 2, changes), 40, np.random.default_rng(6))
    assert decided == 0


def test_a_copy_goes_on_as_its_original_would() -> None:
    made = twins(read_lab(find_lab("maze")), 2, {})
    rng = np.random.default_rng(7)
    drive(made, 60, rng)
    copies = [copy.deepcopy(simulation) for simulation in made]
    drive(copies, 60, np.random.default_rng(8))
    assert made[0].time == made[1].time == copies[0].time - 58, "the originals stayed where they were"
    drive(made, 60, np.random.default_rng(8))
    assert np.array_equal(made[1].poses(), copies[1].poses())


def test_a_restart_and_a_reset_begin_anew() -> None:
    made = twins(read_lab(find_lab("maze")), 2, {})
    rng = np.random.default_rng(9)
    drive(made, 30, rng)
    for simulation in made:
        simulation.restart()
    drive(made, 30, rng)
    for simulation in made:
        simulation.reset()
        simulation.register(RobotRegistration())
        simulation.launch()
    drive(made, 30, rng)


def test_the_option_makes_the_simulation_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    server = build_server(
        parse_arguments(["--compiled", "--port", "0"]), print_line=lambda line: None, notify=lambda line: None
    )
    server.close()
    assert server.simulation.world.compiled
    monkeypatch.setattr("ciberrato.machine_code.available", lambda: False)
    with pytest.raises(UsageError, match=r"--compiled: needs numba: pip install 'ciberrato\[fast\]'"):
        build_server(parse_arguments(["--compiled"]), print_line=print, notify=print)
