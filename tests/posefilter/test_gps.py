"""The GPS's heading, jumps and offset, on ways that the simulator's robot has really driven."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.gps import GpsOffset, GpsSense, GpsTracker
from ciberrato.localization.evidence.gps_position import PlaceDensity, weigh_place
from ciberrato.localization.evidence.symmetry import Turn
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.records import Motion
from ciberrato.physics.kinematics import filter_power
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

HARSH = Parameters(
    sim_time=0,
    obstacle_noise=0.4,
    motors_noise=5.0,
    gps=True,
    gps_linear_noise=0.5,
    compass_sensor=False,
)
FIELD = Lab(name="field", width=2000.0, height=2000.0)


def drive(parameters, seed, cycles):
    """Yield (motion as commanded, GPS reading, true pose) of a robot in the open: straights and turns."""
    generator = np.random.default_rng(seed)
    grid = StartGrid(
        positions=(GridPosition(x=1000.0, y=1000.0, direction_deg=generator.uniform(-180, 180)),)
    )
    simulation = Simulation(FIELD, grid, parameters, seed=seed)
    robot = simulation.register(RobotRegistration(name="g"))
    measures = simulation.launch()[robot]
    wheels, command, left = (0.0, 0.0), (0.1, 0.1), 0
    yield None, measures.gps, simulation.poses()[0]
    for _ in range(cycles):
        if left == 0:
            straight = command[0] != command[1] or generator.random() < 0.5
            side = generator.choice([-0.1, 0.1])
            command = (0.1, 0.1) if straight else (-side, side)
            left = int(generator.integers(10, 50) if straight else generator.integers(4, 16))
        left -= 1
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
        wheels = filter_power(command[0], wheels[0]), filter_power(command[1], wheels[1])
        yield Motion(*wheels, collision=measures.collision), measures.gps, simulation.poses()[0]


def mean_and_deviation(tracker):
    """Circular mean of the tracker's heading and the deviation from it."""
    headings, weights = tracker.headings(), tracker.weights()
    mean = float(np.angle((weights * np.exp(1j * headings)).sum()))
    off = np.remainder(headings - mean + np.pi, 2.0 * np.pi) - np.pi
    return mean, math.sqrt(float((weights * off**2).sum()))


@pytest.mark.parametrize(("noise", "motors", "known"), [(0.5, 5.0, 6.0), (0.5, 1.5, 3.5), (0.1, 1.5, 2.5)])
def test_the_heading_is_within_its_deviation_as_often_as_it_says(noise, motors, known):
    parameters = dataclasses.replace(HARSH, gps_linear_noise=noise, motors_noise=motors)
    scores, deviations = [], []
    for seed in range(40):
        tracker = GpsTracker(noise, motors)
        for cycle, (motion, reading, pose) in enumerate(drive(parameters, seed, 120)):
            if motion is not None:
                tracker.move(motion)
            tracker.observe(reading)
            if cycle in (20, 45, 80, 120):
                mean, deviation = mean_and_deviation(tracker)
                scores.append(math.remainder(mean - pose[2], 2.0 * math.pi) / deviation)
        deviations.append(math.degrees(deviation))
    assert 0.6 < np.sqrt(np.mean(np.square(scores))) < 1.25
    assert np.mean(np.abs(scores) > 2.0) < 0.1  # normal: 0.046
    assert np.median(deviations) < known


def test_the_way_by_gps_gives_the_heading_that_a_fit_of_straight_lines_gives():
    # A straight way without motor noise: the direction of the line through the readings, by least squares.
    parameters = dataclasses.replace(HARSH, motors_noise=0.0)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        heading = rng.uniform(-3.0, 3.0)
        tracker = GpsTracker(parameters.gps_linear_noise, 0.0)
        way = 0.1 * np.arange(150)
        readings = np.outer(way, [math.cos(heading), math.sin(heading)]) + rng.normal(0.0, 0.5, (150, 2))
        for number, reading in enumerate(readings):
            if number:
                tracker.move(Motion(0.1, 0.1, collision=False))
            tracker.observe(tuple(reading))
        mean, deviation = mean_and_deviation(tracker)
        centred = (way - way.mean()) @ (readings - readings.mean(axis=0))
        fitted = math.atan2(centred[1], centred[0])
        assert math.remainder(mean - fitted, 2.0 * math.pi) == pytest.approx(0.0, abs=0.02)
        expected = 0.5 / math.sqrt(((way - way.mean()) ** 2).sum())
        assert 0.9 * expected < deviation < math.hypot(expected, math.radians(1.25))  # bins of 2.5 degrees


def test_a_robot_that_stands_learns_nothing_of_its_heading():
    tracker = GpsTracker(0.5, 5.0)
    rng = np.random.default_rng(3)
    for _ in range(300):
        likelihood, _ = tracker.observe(tuple(rng.normal(40.0, 0.5, 2)))
        assert likelihood == pytest.approx(1.0)
    assert tracker.weights() == pytest.approx(1.0 / len(tracker.weights()))


@pytest.mark.parametrize("cycles", [4000, pytest.param(50_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("motors", [1.5, 5.0])
def test_a_robot_that_nobody_moves_does_not_seem_to_jump(cycles, motors):
    parameters = dataclasses.replace(HARSH, motors_noise=motors)
    jumps = most = 0.0
    for seed in range(cycles // 2000):
        tracker = GpsTracker(0.5, motors)
        for motion, reading, _ in drive(parameters, 1000 + seed, 2000):
            if motion is not None:
                tracker.move(motion)
            jumps += tracker.observe(reading)[1]
            most = max(most, tracker.suspicion)
    assert jumps == 0
    assert most > 0.0  # it is looked for


@pytest.mark.parametrize("distance", [3.0, 10.0])
def test_a_jump_is_noticed_at_once(distance):
    late = []
    for seed in range(20):
        tracker = GpsTracker(0.5, 5.0)
        noticed = None
        for cycle, (motion, (x, y), _) in enumerate(drive(HARSH, seed, 110)):
            if motion is not None:
                tracker.move(motion)
            if tracker.observe((x + distance * (cycle >= 100), y))[1]:
                noticed = cycle
                break
        assert noticed is not None
        assert noticed >= 100
        late.append(noticed - 100)
    assert max(late) <= 3
    assert np.median(late) <= 1


def test_the_offset_is_learnt_and_forgotten_when_it_was_wrong():
    rng = np.random.default_rng(5)
    offset = GpsOffset(0.25)
    for _ in range(200):
        x, y = rng.uniform(0.0, 10.0, 2)
        offset.learn((x + 700.0 + rng.normal(0.0, 0.5), y + 30.0 + rng.normal(0.0, 0.5)), x, y)
    assert offset.is_known
    assert math.dist(offset.value, (700.0, 30.0)) < 3.0 * math.sqrt(offset.variance)
    assert offset.variance < 0.02
    for _ in range(60):  # the pose was wrong by two units; now it is right
        offset.learn((700.0 + rng.normal(0.0, 0.5), 32.0 + rng.normal(0.0, 0.5)), 0.0, 0.0)
    assert math.dist(offset.value, (700.0, 32.0)) < 0.5


def wander(lab, pose_filter, start, parameters, seed=1, angles=(0.0, 60.0, -60.0, 180.0)):
    """Yield the simulation after each message that the filter has taken in."""
    from agent.drives import make_drive

    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    simulation = Simulation(lab, grid, parameters, seed)
    robot = simulation.register(RobotRegistration(name="g", sensor_angles=tuple(enumerate(angles))))
    explore = make_drive("explore", lab, parameters, angles)
    measures, command = simulation.launch()[robot], None
    while True:
        pose_filter.observe(measures, command)
        yield simulation
        command = explore.decide(measures, pose_filter).command
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]


def far_from(simulation):
    """Give a free place on the other side of the lab."""
    return (7.0, 4.9) if simulation.poses()[0][0] < 3.5 else (1.0, 4.9)


def place_error(pose_filter, simulation):
    found, pose = pose_filter.estimate(), simulation.poses()[0]
    return math.hypot(found.x - pose[0], found.y - pose[1])


def test_after_a_jump_the_offset_tells_the_place(small_lab, coarse_tables, fine_tables):
    pose_filter = staged_filter(small_lab, coarse_tables, fine_tables, HARSH)
    run = wander(small_lab, pose_filter, (1.0, 4.2, 77.0), HARSH)
    for _ in range(150):
        simulation = next(run)
    assert pose_filter.estimate().likely
    assert pose_filter.restarts == []
    expected = np.array(simulation.gps_offset)
    assert np.abs(np.array(pose_filter.gps.offset.value) - expected).max() < 0.3
    x, y = far_from(simulation)
    simulation.place(1, x, y, math.radians(200.0))
    for _ in range(4):
        simulation = next(run)
        if pose_filter.restarts:
            break
    assert len(pose_filter.restarts) == 1
    lattice = pose_filter.tables.lattice
    assert pose_filter.belief.square_weights()[np.hypot(lattice.x - x, lattice.y - y) < 2.0].sum() > 0.9
    for _ in range(25):
        simulation = next(run)
    assert pose_filter.estimate().certain
    assert place_error(pose_filter, simulation) < 0.5


def test_the_place_after_a_jump_is_that_of_a_mean_of_the_readings(small_lab, coarse_tables):
    # A robot that stands, whose other sensors say nothing: what is left is the mean, with its deviation.
    belief, rng = PoseBelief(coarse_tables.lattice), np.random.default_rng(4)
    sense = GpsSense(0.5, 5.0)
    for _ in range(2000):
        reading = rng.normal(0.0, 0.5, 2)
        sense.offset.learn((reading[0] + 101.0, reading[1] + 53.0), 1.0, 3.0)
        sense.weigh(belief, (reading[0] + 101.0, reading[1] + 53.0))
    readings = rng.normal((105.5, 51.0), 0.5, (40, 2))
    assert sense.weigh(belief, tuple(readings[0])) is None
    belief.set_uniform()
    sense.begin_anew(belief)
    for reading in readings[1:]:
        sense.weigh(belief, tuple(reading))
    expected = readings.mean(axis=0) - sense.offset.value
    weights, lattice = belief.square_weights(), belief.lattice
    near = np.hypot(lattice.x - expected[0], lattice.y - expected[1]) < 1.0
    weights = np.where(near, weights, 0.0)
    assert weights.sum() > 0.97
    weights /= weights.sum()
    assert weights @ lattice.x == pytest.approx(expected[0], abs=0.05)
    assert weights @ lattice.y == pytest.approx(expected[1], abs=0.05)
    deviation = math.sqrt(0.25 / 40 + sense.offset.variance)
    assert math.sqrt(weights @ (lattice.x - expected[0]) ** 2) == pytest.approx(deviation, rel=0.15)


def test_lists_and_arrays_of_states_get_the_same_place(coarse_tables):
    rng = np.random.default_rng(6)
    dense = PoseBelief(coarse_tables.lattice)
    dense.offset[:] = rng.uniform(-0.1, 0.1, dense.offset.shape)
    mean = rng.uniform(2.0, 5.0, (72, 2))
    before, after = PlaceDensity(mean, 0.4), PlaceDensity(mean + 0.1, 0.3)
    sparse = PoseBelief(coarse_tables.lattice)
    sparse.set_states(*np.nonzero(dense.dense[:, :-1]))
    sparse.offset[:] = dense.offset
    for belief in (dense, sparse):
        weigh_place(belief, None, before)
        weigh_place(belief, before, after)
        belief.normalize()
    assert sparse.weight == pytest.approx(dense.dense[:, :-1].ravel(), rel=1e-3, abs=1e-9)


def test_a_wrong_offset_only_delays(small_lab, coarse_tables, fine_tables):
    pose_filter = staged_filter(small_lab, coarse_tables, fine_tables, HARSH)
    run = wander(small_lab, pose_filter, (1.0, 4.2, 77.0), HARSH, seed=2)
    for _ in range(120):
        simulation = next(run)
    x, y = pose_filter.gps.offset.value
    pose_filter.gps.offset.value = (x + 3.0, y)
    simulation.place(1, *far_from(simulation), math.radians(200.0))
    for _ in range(200):
        simulation = next(run)
    assert len(pose_filter.restarts) >= 1
    assert pose_filter.estimate().certain
    assert place_error(pose_filter, simulation) < 0.5


def test_a_belief_with_the_wrong_heading_is_given_up(small_lab, coarse_tables):
    rng = np.random.default_rng(1)
    for turned, expected in ((0, 0), (36, 1), (9, 1)):
        pose_filter = GridFilter(small_lab, coarse_tables, dataclasses.replace(HARSH, motors_noise=1.5))
        square = int(np.hypot(coarse_tables.lattice.x - 3.0, coarse_tables.lattice.y - 1.0).argmin())
        pose_filter.belief.set_states(np.array([turned]), np.array([square]))
        for cycle in range(46):
            noise = rng.normal(0.0, 0.5, 2)
            command = (0.1, 0.1) if cycle else None
            gps = (500.0 + 0.1 * cycle + noise[0], 20.0 + noise[1])
            pose_filter.observe(Measures(time=cycle, gps=gps, collision=False), command)
        assert len(pose_filter.restarts) == expected


def test_the_heading_by_gps_tells_the_images_of_a_symmetric_lab_apart(small_lab, coarse_tables):
    symmetric = dataclasses.replace(coarse_tables, _turns=[[Turn(4.0, 3.0, math.pi)]])
    shares = []
    for bins in ([0, 36], [0], [36]):
        pose_filter = GridFilter(small_lab, symmetric, HARSH)
        lone = np.array([0])
        pose_filter.belief.set_states(lone, lone)
        tracker = pose_filter.gps.tracker
        tracker.weights()[:] = 0.0
        tracker.weights()[[2 * row for row in bins]] = 1.0 / len(bins)
        shares.append(pose_filter.estimate().probability)
    assert shares == [pytest.approx(0.5), pytest.approx(1.0, abs=1e-6), pytest.approx(0.0, abs=1e-6)]


def test_without_a_gps_nothing_is_made_of_its_readings(small_lab, coarse_tables):
    deaf = GridFilter(small_lab, coarse_tables, dataclasses.replace(HARSH, gps=False))
    before = deaf.belief.dense.copy()
    deaf.observe(Measures(time=0, gps=(1.0, 2.0)), None)
    assert deaf.gps is None
    assert np.array_equal(deaf.belief.dense, before)
