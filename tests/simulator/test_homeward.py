"""The way home in mode 0: recorded sessions of sixty robots, and what they show, rule by rule."""

from __future__ import annotations

import gzip
import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from benchmarks.conformance import homeward
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation
from simulator_stub.world.robot_state import RobotState
from tests.recordings import GOLDEN, OWN, needs

SHELF = Wall(height=4.0, corners=((9.0, 2.0), (9.2, 2.0), (9.2, 8.0), (9.0, 8.0)))
LAB = Lab(width=20.0, height=10.0, walls=(SHELF,), targets=(Target(x=10.0, y=5.0, radius=30.0),))


def test_the_recorded_session_gives_the_recorded_scores() -> None:
    (row,) = homeward.rows(OWN, None)
    assert row.passed, row.note
    assert row.cases == 43 * 60


@needs("CIBERRATO_GOLDEN")
def test_all_recorded_sessions_give_the_recorded_scores() -> None:
    assert GOLDEN is not None
    rows = list(homeward.rows(GOLDEN, None))
    assert [row for row in rows if not row.passed] == []
    assert sum(row.cases for row in rows) >= 2 * 43 * 60


def test_a_score_that_differs_is_found(tmp_path: Path) -> None:
    recorded = json.loads(gzip.decompress((OWN / "homeward/homeward_2.json.gz").read_bytes()))
    recorded["statuses"][-1][3] += 1
    (tmp_path / "homeward").mkdir()
    (tmp_path / "homeward/one.json.gz").write_bytes(gzip.compress(json.dumps(recorded).encode()))
    (row,) = homeward.rows(tmp_path, None)
    assert not row.passed
    assert row.note.startswith("1 unlike, first step 42, robot 60")


def returning(quiet: Parameters, *starts: GridPosition, drive: int = 8) -> Simulation:
    """Let robots drive for some cycles and visit the target that is everywhere; then signal the return."""
    simulation = Simulation(LAB, StartGrid(positions=starts), quiet)
    robots = [simulation.register(RobotRegistration()) for _ in starts]
    simulation.launch()
    ahead = Actions(left_motor=0.1, right_motor=0.1)
    for _ in range(drive):
        simulation.step({robot: ahead for robot in robots if robot is not None})
    for actions in (Actions(visiting_led=True), Actions(visiting_led=False, returning_led=True)):
        simulation.step({robot: actions for robot in robots if robot is not None})
    return simulation


def expected_share(way: float, begun: float) -> int:
    """Do the arithmetic with exact fractions: two roundings to single precision, one division."""
    single = Fraction(float(np.float32(way)))
    hundredfold = Fraction(float(np.float32(float(100 * single))))
    return math.floor(float(hundredfold / Fraction(begun)))


def test_the_first_cycle_of_the_return_shows_the_share_like_every_other(quiet: Parameters) -> None:
    shares = set()
    for place in range(20):
        start = GridPosition(x=12.0, y=1.0 + 0.37 * place)
        simulation = returning(quiet, start, drive=8 + place)
        robot = simulation.robots[0]
        begun = robot.x - start.x
        assert robot.state is RobotState.RETURNING
        assert robot.score == expected_share(begun, begun)
        shares.add(robot.score)
        for _ in range(5):
            simulation.step()
            assert robot.score == expected_share(robot.x - start.x, begun)
    assert shares == {99, 100}


def test_who_signals_again_is_shown_the_share_of_the_new_way(quiet: Parameters) -> None:
    simulation = returning(quiet, GridPosition(x=12.0, y=5.0))
    robot = simulation.robots[0]
    for _ in range(30):
        simulation.step()
    assert robot.score > 150
    before = robot.returning_time
    simulation.step({1: Actions(returning_led=True)})
    assert robot.score in (99, 100)
    assert robot.returning_time == before + 1, "the clock starts again with the next cycle"
    simulation.step()
    assert robot.returning_time == 1


def test_a_robot_that_returns_from_its_start_is_shown_nothing_however_far_it_goes(quiet: Parameters) -> None:
    simulation = returning(quiet, GridPosition(x=12.0, y=5.0), drive=0)
    robot = simulation.robots[0]
    assert robot.score == 0
    for _ in range(10):
        simulation.step({1: Actions(left_motor=0.1, right_motor=0.1)})
    assert robot.x > 12.5
    assert robot.score == 0


def test_a_robot_without_a_way_home_is_shown_nothing(quiet: Parameters) -> None:
    too_near = GridPosition(
        x=9.5, y=5.0, direction_deg=0.0
    )  # 0.3 from the wall: no disc of its size gets there
    simulation = returning(quiet, too_near)
    robot = simulation.robots[0]
    penalties = 2 * robot.collisions
    assert robot.state is RobotState.RETURNING
    assert robot.score == penalties
    simulation.step()
    assert robot.score == penalties


def test_who_finishes_without_returning_is_shown_the_share(quiet: Parameters) -> None:
    simulation = Simulation(LAB, StartGrid(positions=(GridPosition(x=12.0, y=5.0),)), quiet)
    simulation.register(RobotRegistration())
    simulation.launch()
    for _ in range(8):
        simulation.step({1: Actions(left_motor=0.1, right_motor=0.1)})
    simulation.step({1: Actions(visiting_led=True)})
    simulation.step({1: Actions(visiting_led=False, end_led=True)})
    robot = simulation.robots[0]
    way = robot.x - 12.0
    assert robot.score == 100 + expected_share(way, way)


@pytest.mark.parametrize("mode", range(8))
def test_collisions_of_a_robot_that_is_finished_do_not_count(mode: int, quiet: Parameters) -> None:
    start = GridPosition(x=8.2, y=5.0)
    parameters = replace(quiet, collision_wall_penalty=7)
    simulation = Simulation(LAB, StartGrid(positions=(start,)), parameters, scoring=mode)
    simulation.register(RobotRegistration())
    simulation.launch()
    simulation.step({1: Actions(end_led=True)})
    robot = simulation.robots[0]
    assert robot.state is RobotState.FINISHED
    score = robot.score
    simulation.place(1, 8.45, 5.0, 0.0)
    # Its motors go on, and where they want to take it is too near to the wall: the flag shows that.
    simulation.step({1: Actions(left_motor=0.15, right_motor=0.15)})
    assert robot.collides
    assert (robot.collisions, robot.score) == (0, score)
