"""Beacon readings: where a beacon shows, how likely a reading is, and what a filter makes of it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from agent.drives import make_drive
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.beacons import BeaconSense, beacon_table, visible
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.protocol import Actions, BeaconReading, RobotRegistration
from ciberrato.world.lab import Beacon
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
BEACON_ONLY = Parameters(sim_time=0, obstacle_noise=50.0, compass_sensor=False, beacon_sensor=True)


@pytest.fixture(scope="module")
def lit_lab(small_lab):
    """Return the small lab with a beacon that the walls hide, and one that shows above all of them."""
    return dataclasses.replace(
        small_lab, beacons=(Beacon(x=7.0, y=5.0, height=4.0), Beacon(x=1.0, y=1.0, height=4.5))
    )


def readings_at(lab, parameters, pose, count, seed=1):
    """Readings of a robot of the simulator that stands at a pose (degrees)."""
    grid = StartGrid(positions=(GridPosition(x=pose[0], y=pose[1], direction_deg=pose[2]),))
    simulation = Simulation(lab, grid, parameters, seed)
    robot = simulation.register(RobotRegistration(name="b"))
    yield simulation.launch()[robot].beacons
    for _ in range(count - 1):
        yield simulation.step({})[robot].beacons


def test_beacons_show_where_the_simulator_shows_them(lit_lab, coarse_tables):
    parameters = dataclasses.replace(BEACON_ONLY, beacon_noise=0.0)
    x, y = coarse_tables.lattice.representative[::23].T
    shown = np.array([visible(lit_lab, beacon, x, y) for beacon in lit_lab.beacons]).T
    assert 0.2 < shown[:, 0].mean() < 0.9
    assert shown[:, 1].all()
    for place in range(len(x)):
        (readings,) = readings_at(lit_lab, parameters, (x[place], y[place], 0.0), 1)
        assert [reading.bearing is not None for reading in readings] == shown[place].tolist()


def test_the_table_agrees_with_single_lines_of_sight(lit_lab, fine_tables):
    lattice = fine_tables.lattice
    table = beacon_table(lit_lab, lattice, 0)
    part = table.codes // 576 % 5 / 4.0
    exact = visible(lit_lab, lit_lab.beacons[0], *lattice.representative.T)
    assert np.mean(exact[part > 0.8]) > 0.99
    assert np.mean(exact[part < 0.2]) < 0.01
    assert np.mean((part > 0.1) & (part < 0.9)) < 0.15
    angle = np.arctan2(5.0 - lattice.representative[:, 1], 7.0 - lattice.representative[:, 0])
    off = np.remainder(table.codes % 576 * 1.25 - np.degrees(angle) + 180.0, 360.0) - 180.0
    away = np.hypot(5.0 - lattice.representative[:, 1], 7.0 - lattice.representative[:, 0]) > 0.01
    assert away.sum() >= lattice.size - 1
    assert np.abs(off[away]).max() <= 0.625 + 1e-9


@pytest.mark.parametrize("dense", [True, False])
@pytest.mark.parametrize("offset", [0.0, 0.031])
@pytest.mark.parametrize("bearing", [None, 30.0, -171.0])
def test_weights_are_what_a_sum_state_by_state_gives(lit_lab, coarse_tables, dense, offset, bearing):
    lattice, sense = coarse_tables.lattice, BeaconSense(lit_lab, 2.0, 1.2)
    belief = PoseBelief(lattice)
    if not dense:
        bins, squares = np.divmod(np.arange(0, 72 * lattice.size, 7), lattice.size)
        belief.set_states(bins, squares)
    belief.heading_offset = offset
    bins, squares, before = belief.listed()
    sense.weigh(belief, (BeaconReading(beacon=0, bearing=bearing),), 0.5)
    factor = belief.listed()[2] / before
    rng = np.random.default_rng(1)
    for state in rng.choice(len(bins), 300, replace=False):
        x, y = lattice.representative[squares[state]]
        distance = math.hypot(7.0 - x, 5.0 - y)
        angle = math.atan2(5.0 - y, 7.0 - x) - bins[state] * math.radians(5.0) - offset
        part = beacon_table(lit_lab, lattice, 0).codes[squares[state]] // 576 % 5 / 4.0
        part = min(max(part, 0.03), 0.97)
        bin_spread = math.radians(1.0) ** 2 / 12.0 + 2.0 * math.radians(5.0) ** 2 / 12.0
        least = math.radians(2.0) ** 2 + bin_spread
        spread = lattice.resolution / math.sqrt(6.0) / distance
        if bearing is None:
            outside = abs(math.remainder(angle, 2.0 * math.pi)) > 1.2 + 6.0 * (spread + 0.1)
            inside = abs(math.remainder(angle, 2.0 * math.pi)) < 1.2 - 6.0 * (spread + 0.1)
            if outside or inside:
                assert factor[state] ** 2 == pytest.approx(1.0 if outside else 1.0 - part, abs=0.05)
            continue
        # The spread is known up to the next class, at most twice as much.
        off = math.remainder(angle - math.radians(bearing), 2.0 * math.pi)
        found = factor[state] ** 2 / part
        bounds = []
        for deviation in (math.sqrt(least + spread**2), math.sqrt(least + max(2.5 * spread, 0.02) ** 2)):
            for error in (-0.012, 0.012):
                near = math.exp(-0.5 * ((abs(off) + error) / deviation) ** 2)
                bounds.append(max(math.sqrt(least) / deviation * near, 1e-3))
        if distance > 0.7:
            assert min(bounds) * 0.95 <= found <= max(bounds) * 1.05


def test_two_beacons_and_a_compass_give_the_place(lit_lab, coarse_tables):
    parameters = dataclasses.replace(BEACON_ONLY, compass_sensor=True)
    pose_filter = GridFilter(lit_lab, coarse_tables, parameters)
    belief, lattice = pose_filter.belief, coarse_tables.lattice
    sense = BeaconSense(lit_lab, 2.0, math.pi)
    belief.dense[np.arange(72) != 18] = 0.0
    for readings in readings_at(lit_lab, parameters, (4.0, 4.0, 90.0), 60):
        sense.weigh(belief, readings, 0.3)
        belief.normalize()
    weights = belief.square_weights()
    x, y = weights @ lattice.x, weights @ lattice.y
    assert math.hypot(x - 4.0, y - 4.0) < 0.3
    assert weights[np.hypot(lattice.x - 4.0, lattice.y - 4.0) < 0.7].sum() > 0.95


def test_a_hidden_beacon_is_evidence_too(lit_lab, coarse_tables):
    belief = PoseBelief(coarse_tables.lattice)
    elsewhere = BeaconSense(lit_lab, 2.0, math.pi).weigh(
        belief, (BeaconReading(beacon=0, bearing=None),), 1.0
    )
    assert belief.normalize() == pytest.approx(math.exp(elsewhere), rel=1e-3)
    shown = visible(lit_lab, lit_lab.beacons[0], *coarse_tables.lattice.representative.T)
    weights = belief.square_weights()
    assert weights[shown].sum() < 0.25
    assert shown.mean() > 0.3


def test_exact_scores_prefer_the_true_pose(lit_lab):
    sense = BeaconSense(lit_lab, 2.0, math.pi)
    poses = np.array([(4.0, 4.0, 1.0), (4.0, 4.0, 2.6), (6.5, 1.2, 1.0), (1.0, 5.0, 1.0)])
    angle = math.degrees(math.remainder(math.atan2(1.0, 3.0) - 1.0, 2.0 * math.pi))
    scores = sense.score(poses, (BeaconReading(beacon=0, bearing=round(angle)),))
    assert scores[0] > -0.1
    assert (scores[1:] < -3.0).all()
    hidden = sense.score(poses, (BeaconReading(beacon=0, bearing=None),))
    assert hidden.tolist() == [-2.0 * seen for seen in visible(lit_lab, lit_lab.beacons[0], *poses[:, :2].T)]


def follow(lab, tables, parameters, cycles):
    """Explore from a pose; return the cycles from which on it was known, and the last error."""
    coarse, fine = tables
    grid = StartGrid(positions=(GridPosition(x=6.8, y=1.2, direction_deg=-130.0),))
    simulation = Simulation(lab, grid, parameters, 4)
    robot = simulation.register(RobotRegistration(name="b", sensor_angles=tuple(enumerate(ANGLES))))
    pose_filter = staged_filter(lab, coarse, fine, parameters)
    explore = make_drive("explore", lab, parameters, ANGLES)
    measures, command = simulation.launch()[robot], None
    known, errors = None, []
    for cycle in range(cycles):
        pose_filter.observe(measures, command)
        found, pose = pose_filter.estimate(), simulation.poses()[0]
        if found.certain and known is None:
            known = cycle
        errors.append(math.hypot(found.x - pose[0], found.y - pose[1]))
        command = explore.decide(measures, pose_filter).command
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    return known, errors, pose_filter


def test_late_beacons_are_taken_where_they_were_seen(lit_lab, coarse_tables, fine_tables):
    late = dataclasses.replace(
        BEACON_ONLY, obstacle_noise=0.4, beacon_latency=5, collision_latency=2, ground_latency=1
    )
    known, errors, pose_filter = follow(lit_lab, (coarse_tables, fine_tables), late, 150)
    assert known is not None
    assert pose_filter.restarts == []
    assert np.median(errors[-60:]) < 0.2  # five cycles are 0.5 units


def test_beacons_make_up_for_poor_infrared(lit_lab, coarse_tables, fine_tables):
    parameters = dataclasses.replace(BEACON_ONLY, obstacle_noise=1.5)
    tables = (coarse_tables, fine_tables)
    known, errors, _ = follow(lit_lab, tables, parameters, 150)
    blind, _, _ = follow(lit_lab, tables, dataclasses.replace(parameters, beacon_sensor=False), 150)
    assert known is not None
    assert blind is None or blind > known
    assert max(errors[known : known + 40]) < 0.6
