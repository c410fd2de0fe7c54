from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, reading_log_likelihood, sensor_distances
from ciberrato.localization.belief.estimate import estimate
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.records import FilterStep, Motion
from ciberrato.localization.refinement.particles import ParticleCloud
from ciberrato.physics.kinematics import filter_power
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.batch import BatchSimulation
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
RADIANS = tuple(math.radians(angle) for angle in ANGLES)
PARAMETERS = Parameters(obstacle_noise=0.1, motors_noise=1.5, compass_sensor=False)


def step(*motions: Motion, infrared=(None,) * 4, exponent=0.4) -> FilterStep:
    return FilterStep(
        motions=motions, infrared=infrared, compass=None, ground=None, exponent=exponent, time=0
    )


def cloud_at(lab: Lab, tables, pose, *, seed=0, width=0.31, parameters=PARAMETERS) -> ParticleCloud:
    """Return a cloud spread evenly about a pose."""
    belief = PoseBelief(tables.lattice)
    bins, squares = np.meshgrid(np.arange(72), np.arange(tables.lattice.size), indexing="ij")
    belief.set_states(bins.ravel(), squares.ravel())
    cloud = ParticleCloud(WallMap.from_lab(lab), RADIANS, parameters, np.random.default_rng(seed))
    cloud.begin(belief, pose, (width, width, 0.31))
    return cloud


def test_one_look_gives_the_posterior_that_a_sum_over_a_dense_lattice_gives(small_lab, fine_tables):
    pose = (7.0, 1.0, 0.3)
    walls = WallMap.from_lab(small_lab)
    readings = tuple(
        np.round(ideal_reading(sensor_distances(walls, pose[0], pose[1], pose[2] + np.array(RADIANS))), 1)
    )
    means, deviations = [], []
    for seed in range(30):
        cloud = cloud_at(small_lab, fine_tables, pose, seed=seed)
        cloud.follow(step(infrared=readings), 1.0)
        mean, deviation = cloud.mean()
        means.append(mean)
        deviations.append(deviation)

    # The same by brute force: square-root likelihood, widened by spacing, on a lattice of 0.02 x 1 degree.
    # The cloud began with the seven nodes and the seven bins, 0 to 30 degrees, within reach.
    axis = np.arange(-0.34, 0.341, 0.02)
    turns = np.deg2rad(np.arange(-2.0, 32.5, 1.0))
    x, y, turn = (grid.ravel() for grid in np.meshgrid(pose[0] + axis, pose[1] + axis, turns))
    log = np.zeros(x.size)
    for angle, reading in zip(RADIANS, readings, strict=True):
        distance = sensor_distances(walls, x, y, turn + angle)
        slope = 1.0 / np.maximum(distance, 0.05) ** 2
        sigma = np.sqrt(0.1**2 + (0.02 * slope) ** 2 + (math.radians(1.0) * slope * distance) ** 2)
        mass = np.exp(reading_log_likelihood(reading, ideal_reading(distance), sigma))
        log += 0.5 * np.log(0.98 * mass + 0.02 * 0.1 / (1.0 + reading) ** 2)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    expected = np.array([x @ weight, y @ weight, turn @ weight])
    spread = np.sqrt([(v - m) ** 2 @ weight for v, m in zip((x, y, turn), expected, strict=True)])
    assert np.abs(np.mean(means, axis=0) - expected).max() < 0.02
    np.testing.assert_allclose(np.mean(deviations, axis=0), spread, rtol=0.15)


def test_the_cloud_spreads_on_its_way_as_robots_in_the_simulator_do(fine_tables):
    wide = Lab(name="wide", width=40.0, height=40.0)
    parameters = dataclasses.replace(PARAMETERS, motors_noise=5.0, sim_time=0)
    robots = 600
    batch = BatchSimulation(
        wide,
        np.tile([10.0, 20.0, 0.0], (robots, 1)),
        parameters,
        sensor_angles=ANGLES,
        seeds=list(range(robots)),
    )
    batch.step()
    begin = batch.poses().copy()
    cloud = ParticleCloud(WallMap.from_lab(wide), RADIANS, parameters, np.random.default_rng(1))
    belief = PoseBelief(fine_tables.lattice)
    belief.set_states(np.array([0]), np.array([0]))
    cloud.begin(belief, (float(fine_tables.lattice.x[0]), float(fine_tables.lattice.y[0]), 0.0), (1, 1, 1))
    cloud._pose[:] = np.array([[10.0], [20.0], [0.0]])
    left = right = 0.0
    command = (0.1, 0.11)
    for _ in range(60):
        batch.step(np.tile(command, (robots, 1)))
        left, right = filter_power(command[0], left), filter_power(command[1], right)
        cloud.follow(step(Motion(left, right, False), exponent=0.0), 0.0)
    _, deviation = cloud.mean()
    true = (batch.poses() - begin).std(axis=0)
    np.testing.assert_allclose(deviation, true, rtol=0.15)


@pytest.fixture(scope="module")
def drive(small_lab, coarse_tables, fine_tables):
    """Return the poses, the estimates and the lattice's estimates of a drive around the small lab."""
    parameters = dataclasses.replace(PARAMETERS, sim_time=0)
    grid = StartGrid(positions=(GridPosition(x=3.0, y=1.0, direction_deg=0.0),))
    simulation = Simulation(small_lab, grid, parameters, seed=3)
    robot = simulation.register(RobotRegistration(name="a", sensor_angles=tuple(enumerate(ANGLES))))
    pose_filter = staged_filter(small_lab, coarse_tables, fine_tables, parameters, start="centres")
    measures = simulation.launch()[robot]
    command = None
    rows = []
    for cycle in range(260):
        pose_filter.observe(measures, command)
        rows.append((simulation.poses()[0].copy(), pose_filter.estimate(), estimate(pose_filter.belief)))
        # Straight on, and round the corner where the front is near.
        near = measures.infrared[0] > 1.4 or cycle % 60 > 50
        command = (-0.05, 0.05) if near else (0.1, 0.1)
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    return pose_filter, rows


def errors(rows, which):
    known = [row for row in rows if row[1].certain]
    return np.array([math.hypot(row[which].x - row[0][0], row[which].y - row[0][1]) for row in known])


def test_the_estimate_is_several_times_finer_than_that_of_the_lattice(drive):
    _, rows = drive
    particles, lattice = errors(rows, 1), errors(rows, 2)
    assert len(particles) > 100
    assert np.median(particles) < 0.6 * np.median(lattice)
    assert np.quantile(particles, 0.95) < 0.05


def test_probability_and_place_in_the_lab_stay_those_of_the_lattice(drive):
    _, rows = drive
    for _, found, coarse in rows:
        assert found.probability == coarse.probability
        assert math.hypot(found.x - coarse.x, found.y - coarse.y) <= 0.3


def test_a_restart_ends_the_cloud(small_lab, drive):
    pose_filter, _ = drive
    assert pose_filter.refinement.particles > 0
    pose_filter.restart(1000)
    assert pose_filter.refinement.particles == 0


def test_the_same_run_gives_the_same_estimates(small_lab, coarse_tables, fine_tables):
    def poses():
        simulation = Simulation(
            small_lab,
            StartGrid(positions=(GridPosition(x=3.0, y=1.0, direction_deg=0.0),)),
            PARAMETERS,
            seed=5,
        )
        robot = simulation.register(RobotRegistration(name="a", sensor_angles=tuple(enumerate(ANGLES))))
        pose_filter = staged_filter(small_lab, coarse_tables, fine_tables, PARAMETERS, start="centres")
        measures, command = simulation.launch()[robot], None
        for _ in range(60):
            pose_filter.observe(measures, command)
            command = (0.06, 0.08)
            measures = simulation.step({robot: Actions(left_motor=0.06, right_motor=0.08)})[robot]
        assert pose_filter.refinement.particles > 0
        return pose_filter.estimate()

    assert poses() == poses()
