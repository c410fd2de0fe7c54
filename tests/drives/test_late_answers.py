"""Answers that come late, and messages that are overtaken, do not make a robot turn in place for ever."""

from __future__ import annotations

import types
from collections.abc import Callable

import numpy as np
import pytest

from agent.drives.base import Decision
from agent.drives.exchange import Exchange
from agent.drives.registry import make_drive
from agent.drives.throttle import Throttle
from agent.run.live_controller import LiveController
from ciberrato.files.run_records import RunHeader
from ciberrato.localization.pose_filter import PoseFilter
from ciberrato.localization.tables.pose_tables import PoseTables, build_tables
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
PARAMETERS = Parameters(sim_time=0)
CYCLES = 220


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


@pytest.fixture(scope="module")
def lab() -> Lab:
    """A corridor that turns twice: 12 x 6 units."""
    return Lab(
        name="turns", width=12.0, height=6.0, walls=(box(0.0, 1.95, 10.0, 2.05), box(2.0, 3.95, 12.0, 4.05))
    )


@pytest.fixture(scope="module")
def tables(lab: Lab) -> PoseTables:
    return build_tables(lab, ANGLES, 2.0 / 9.0)


def explore(
    lab: Lab, tables: PoseTables, service: Callable[[int], float]
) -> tuple[np.ndarray, list[bool], int]:
    """Drive with an agent that takes so many cycles for each answer; the clock is that of the simulation.

    Returns
    -------
    poses, whether the pose was known, number of cycles in collision
    """
    worker = types.SimpleNamespace(coarse=tables, fine=None, error=None, wait=lambda timeout: True)
    localizer = PoseFilter(lab, PARAMETERS, ANGLES, tables=worker, budget=1e9)  # type: ignore[arg-type]
    header = RunHeader(lab_name="", lab_sha256="", parameters=PARAMETERS, sensor_angles=ANGLES)
    controller = LiveController(header, localizer, make_drive("explore", lab, PARAMETERS, ANGLES))
    grid = StartGrid(positions=(GridPosition(x=1.0, y=1.0, direction_deg=30.0),))
    simulation = Simulation(lab, grid, PARAMETERS, seed=2)
    robot = simulation.register(RobotRegistration(name="late", sensor_angles=tuple(enumerate(ANGLES))))
    assert robot is not None
    waiting: list[tuple[float, Measures]] = [(0.0, simulation.launch()[robot])]
    under_way: list[tuple[float, Actions]] = []
    busy, poses, known, collisions = 0.0, [], [], 0
    for cycle in range(1, CYCLES + 1):
        while waiting and max(busy, waiting[0][0]) < cycle:
            now = max(busy, waiting[0][0])
            due = [entry for entry in waiting if entry[0] <= now]
            waiting = waiting[len(due) :]
            for number, (arrived, measures) in enumerate(due, start=1):
                _, actions = controller.observe(measures, newest=number == len(due), arrived=arrived)
            assert actions is not None
            busy = now + service(cycle)
            controller.sent(busy)
            under_way.append((busy, actions))
        acting = [actions for left, actions in under_way if left < cycle]
        under_way = [entry for entry in under_way if entry[0] >= cycle]
        measures = simulation.step({robot: acting[-1]} if acting else {})[robot]
        waiting.append((float(cycle), measures))
        poses.append(simulation.poses()[0].copy())
        known.append(localizer.estimate().certain)
        collisions += bool(measures.collision)
    return np.array(poses), known, collisions


def longest_stay(poses: np.ndarray, known: list[bool]) -> int:
    """Cycles within 0.3 units while the pose was known, at most."""
    longest = first = 0
    for number, pose in enumerate(poses):
        while np.hypot(*(pose[:2] - poses[first, :2])) > 0.3:
            first += 1
        if known[number]:
            longest = max(longest, number - first)
    return longest


@pytest.mark.parametrize(("cycles", "bound"), [(0.2, 30), (1.1, 45), (2.5, 90), (3.5, 110)])
def test_late_answers_end_in_no_endless_turn(lab: Lab, tables: PoseTables, cycles: float, bound: int) -> None:
    poses, known, collisions = explore(lab, tables, lambda cycle: cycles)
    assert sum(known) > CYCLES / 3
    assert longest_stay(poses, known) <= bound
    assert collisions == 0


def test_a_time_of_late_answers_passes(lab: Lab, tables: PoseTables) -> None:
    poses, known, collisions = explore(lab, tables, lambda cycle: 4.0 if 40 < cycle < 80 else 0.2)
    assert collisions == 0
    assert longest_stay(poses[100:], known[100:]) <= 30


def test_answers_in_time_are_left_alone() -> None:
    throttle = Throttle()
    decision = Decision(command=(-0.15, 0.15))
    assert all(throttle.slow(decision, time, 0) is decision for time in range(20))
    assert throttle.slow(decision, 22, 0).command == (-0.05, 0.05)  # two messages were overtaken
    after = [throttle.slow(decision, 23 + time, 0).command[1] for time in range(40)]
    assert after == sorted(after)
    assert after[0] < 0.07
    assert after[-1] == 0.15


def test_an_answer_that_left_after_a_message_came_is_still_under_way() -> None:
    exchange = Exchange(PARAMETERS)
    for left in (1.0, 2.0, 3.5):
        exchange.answer((0.1, 0.1))
        exchange.sent(left)
    assert [exchange.under_way(arrived) for arrived in (4.0, 3.0, 1.5, None)] == [0, 1, 2, 0]
