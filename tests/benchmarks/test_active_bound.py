"""The oracle that bounds active localization, against the exact sensor model and real runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agent.drives import make_drive
from benchmarks.active_bound import Oracle
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, sensor_distances
from ciberrato.localization.belief.estimate import CLAIM_RADIUS, CLAIM_TURN
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.tables.pose_tables import BINS, COARSE, build_tables
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
START = (1.0, 1.0, 0.0)


def box(x0, y0, x1, y1):
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


LAB = Lab(
    name="small",
    width=8.0,
    height=6.0,
    walls=(box(1.9, 2.0, 2.1, 6.0), box(5.0, 3.4, 6.1, 4.2), box(3.9, 1.9, 6.0, 2.1)),
)


@pytest.fixture(scope="module")
def tables():
    return build_tables(LAB, ANGLES, COARSE)


def first_probability(tables, start, noise):
    """Return the expected probability of a pose after one reading, computed ray by ray."""
    lattice, walls = tables.lattice, WallMap.from_lab(LAB)
    roomy = np.flatnonzero(lattice.clearance >= 0.5 - COARSE / 2.0)
    turns = [start[2] + number * 2.0 * math.pi / BINS for number in range(BINS)]
    poses = [start, *((*lattice.representative[square], turn) for turn in turns for square in roomy)]
    x, y, heading = np.array(poses).T
    seen = ideal_reading(
        sensor_distances(
            walls, x[:, np.newaxis], y[:, np.newaxis], heading[:, np.newaxis] + np.deg2rad(ANGLES)
        )
    )
    weights = np.exp(-0.5 * ((seen - seen[0]) ** 2).sum(axis=1) / (noise**2 + 0.01 / 12.0))
    near = np.hypot(x - start[0], y - start[1]) <= CLAIM_RADIUS
    near &= np.abs(np.remainder(heading - start[2] + math.pi, 2.0 * math.pi) - math.pi) <= CLAIM_TURN
    return float(weights[near].sum() / weights.sum())


def test_what_the_first_reading_tells_is_that_of_the_exact_model(tables):
    exact = first_probability(tables, START, 0.1)
    assert 0.01 < exact < 0.6
    oracle = Oracle(tables, 0.1)
    assert oracle.soonest(START, 20.0, claim=0.8 * exact) == 0.0
    assert oracle.soonest(START, 20.0, claim=1.2 * exact) > 0.0


def test_what_looks_the_same_turned_round_cannot_be_told_apart():
    square = Lab(name="square", width=6.0, height=6.0, walls=())
    oracle = Oracle(build_tables(square, ANGLES, COARSE), 0.1)
    assert oracle.soonest(START, 60.0) == math.inf
    assert oracle.soonest(START, 60.0, claim=0.2) < 10.0


def test_more_noise_and_more_certainty_take_no_less_time(tables):
    times = [Oracle(tables, noise).soonest(START, 60.0) for noise in (0.05, 0.1, 0.4)]
    assert times == sorted(times)
    assert times[0] < times[-1]
    assert Oracle(tables, 0.4).soonest(START, 60.0, claim=0.5) < times[-1]


@pytest.mark.parametrize("start", [(1.0, 1.0, 0.0), (7.0, 5.0, 90.0), (3.0, 5.0, 180.0)])
def test_no_run_of_active_is_faster(tables, start):
    parameters = Parameters(sim_time=0, compass_sensor=False)
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    simulation = Simulation(LAB, grid, parameters, 3)
    robot = simulation.register(RobotRegistration(name="a", sensor_angles=tuple(enumerate(ANGLES))))
    pose_filter, drive = (
        GridFilter(LAB, tables, parameters),
        make_drive("active", LAB, parameters, ANGLES),
    )
    measures, command, time = simulation.launch()[robot], None, 0
    while time < 100:
        pose_filter.observe(measures, command)
        if pose_filter.estimate().certain:
            break
        command = drive.decide(measures, pose_filter).command
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
        time += 1
    assert time < 100
    bound = Oracle(tables, parameters.obstacle_noise).soonest((*start[:2], math.radians(start[2])), 100.0)
    assert bound <= time
