"""A lab that is another one than the simulator's is told; the right one is not doubted."""

from __future__ import annotations

import types

import numpy as np
import pytest

from ciberrato.localization.evidence.map_fit import DOUBT, USUAL, MapFit
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.live.statistics import LiveStatistics
from ciberrato.localization.tables.pose_tables import build_tables
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
PARAMETERS = Parameters(sim_time=0)


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


OTHER = Lab(
    name="other",
    width=8.0,
    height=6.0,
    walls=(box(5.9, 0.0, 6.1, 3.0), box(1.5, 1.5, 2.8, 2.2), box(2.0, 3.9, 4.1, 4.1)),
)


@pytest.mark.parametrize("is_right", [True, False])
def test_the_sum_of_misfits_tells_the_labs_apart(small_lab, coarse_tables, fine_tables, is_right):
    from agent.drives import make_drive

    lab = small_lab if is_right else OTHER
    tables = (coarse_tables, fine_tables) if is_right else (build_tables(OTHER, ANGLES, 2.0 / 9.0), None)
    found = staged_filter(lab, *tables, PARAMETERS)
    grid = StartGrid(positions=(GridPosition(x=1.0, y=4.2, direction_deg=77.0),))
    simulation = Simulation(small_lab, grid, PARAMETERS, seed=3)
    robot = simulation.register(RobotRegistration(name="m", sensor_angles=tuple(enumerate(ANGLES))))
    drive = make_drive("explore", lab, PARAMETERS, ANGLES)
    measures, command = simulation.launch()[robot], None
    for _ in range(250):
        found.observe(measures, command)
        command = drive.decide(measures, found).command
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    assert found.map_fit.readings > 50
    if is_right:
        assert found.map_fit.since is None
        assert found.map_fit.worst < DOUBT / 2.0
    else:
        assert found.map_fit.since is not None
        assert found.map_fit.since < 250


def test_the_misfit_is_what_the_belief_leaves_of_the_best_likelihood(small_lab, coarse_tables):
    found = staged_filter(small_lab, coarse_tables, None, PARAMETERS, start="1,4.2,90")
    stage = found.stage
    bins, squares, weights = stage.belief.listed()
    step = types.SimpleNamespace(infrared=(0.5, None, 1.3, None))
    logs = []
    for sensor, reading in ((0, 0.5), (2, 1.3)):
        codes = coarse_tables.view(sensor, stage.belief.heading_offset)
        table = stage._codes.log_likelihood(reading)
        logs.append(
            -np.log(
                sum(w * np.exp(table[codes[b, s]]) for b, s, w in zip(bins, squares, weights, strict=True))
            )
        )
    assert stage.misfit(step) == pytest.approx(np.mean(logs), rel=1e-5)
    assert stage.misfit(types.SimpleNamespace(infrared=(None,) * 4)) is None


def test_misfits_below_the_usual_are_no_credit():
    fit = MapFit()
    for time in range(100):
        fit.observe(0.0, 1.0, time)
    assert fit.level == 0.0
    needed = int(DOUBT / (3.0 - USUAL)) + 1
    for time in range(needed):
        assert fit.since is None
        fit.observe(3.0, 1.0, 100 + time)
    assert fit.since == 99 + needed
    before = fit.level
    fit.observe(50.0, 0.0, 999)  # a robot that stands says nothing new
    assert fit.level == before


def test_late_answers_are_counted_as_the_user_would():
    statistics = LiveStatistics()
    statistics.answers += [10.0, 49.0, 51.0, 6000.0]
    statistics.waited = 7
    worker = types.SimpleNamespace(seconds={"coarse": 1.0}, megabytes=0.0)
    _, answers = statistics.lines(worker, cycle_time=50, lost=3, unanswered=118)
    assert "2 of 4 later than a cycle of 50 ms" in answers
    assert "118 Measures unanswered, 3 lost" in answers
    assert "no belief yet in 7 cycles" in answers
