from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from agent.drives import make_drive
from ciberrato.localization.cell_beliefs import cell_beliefs
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
DEFAULT = Parameters(sim_time=0)


class Run:
    """A robot in the small lab, a filter, and a drive."""

    def __init__(self, lab, pose_filter, start, parameters=DEFAULT, seed=1, drive="explore", goal=None):
        grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
        self.simulation = Simulation(lab, grid, parameters, seed)
        registration = RobotRegistration(name="g", sensor_angles=tuple(enumerate(ANGLES)))
        self.robot = self.simulation.register(registration)
        self.filter = pose_filter
        self.drive = make_drive(drive, lab, parameters, ANGLES, goal=goal)
        self.measures = self.simulation.launch()[self.robot]
        self.command = None
        self.history = []
        self.decision = None

    def step(self):
        self.history.append((self.measures, self.command))
        self.filter.observe(self.measures, self.command)
        self.decision = self.drive.decide(self.measures, self.filter)
        self.command = self.decision.command
        actions = Actions(left_motor=self.command[0], right_motor=self.command[1])
        pose = self.simulation.poses()[0]
        self.measures = self.simulation.step({self.robot: actions})[self.robot]
        return pose

    def errors(self, pose):
        found = self.filter.estimate()
        place = math.hypot(found.x - pose[0], found.y - pose[1])
        return place, abs(math.degrees(math.remainder(found.heading - pose[2], 2.0 * math.pi)))


@pytest.fixture
def staged(small_lab, coarse_tables, fine_tables):
    return staged_filter(small_lab, coarse_tables, fine_tables, DEFAULT)


@pytest.mark.parametrize("compass", [True, False])
@pytest.mark.parametrize("noise", ["default", "harsh"])
def test_the_pose_is_found_from_anywhere_and_kept(small_lab, coarse_tables, fine_tables, compass, noise):
    parameters = dataclasses.replace(DEFAULT, compass_sensor=compass)
    if noise == "harsh":
        parameters = dataclasses.replace(parameters, obstacle_noise=0.4, motors_noise=5.0, compass_noise=8.0)
    for seed, start in enumerate([(1.0, 4.2, 77.0), (6.8, 1.2, -130.0)]):
        pose_filter = staged_filter(small_lab, coarse_tables, fine_tables, parameters)
        run = Run(small_lab, pose_filter, start, parameters, seed)
        known = None
        for cycle in range(200):
            pose = run.step()
            place, turn = run.errors(pose)
            if run.filter.estimate().certain:
                known = cycle if known is None else known
                assert place < 0.5
                assert turn < 10.0
        assert known is not None
        assert known < 120
        assert place < (0.15 if noise == "default" else 0.35)
        assert run.simulation.robots[0].collisions == 0 or noise == "harsh"


def test_a_kidnapped_robot_is_missed_and_found_again(small_lab, staged):
    run = Run(small_lab, staged, (1.0, 4.2, 77.0))
    for _ in range(100):
        run.step()
    assert staged.estimate().certain
    assert staged.restarts == []
    run.simulation.place(run.robot, 7.0, 4.9, math.radians(200.0))
    for _ in range(150):
        pose = run.step()
    assert len(staged.restarts) == 1
    assert staged.restarts[0] <= 120
    assert staged.estimate().certain
    assert run.errors(pose)[0] < 0.2


def test_late_readings_are_taken_where_they_were_made(small_lab, fine_tables):
    late = dataclasses.replace(DEFAULT, obstacle_latency=3, compass_latency=1)
    run = Run(small_lab, GridFilter(small_lab, fine_tables, late), (1.0, 4.2, 77.0), late)
    errors = []
    for cycle in range(160):
        pose = run.step()
        if cycle > 110:
            errors.append(run.errors(pose)[0])
    assert run.filter.estimate().certain
    assert np.median(errors) < 0.1  # three cycles are 0.3 units


def test_a_missing_compass_and_missing_readings_are_no_evidence(small_lab, coarse_tables):
    pose_filter = GridFilter(small_lab, coarse_tables, DEFAULT)
    before = pose_filter.belief.dense.copy()
    pose_filter.observe(Measures(time=0), None)
    assert np.array_equal(pose_filter.belief.dense, before)


def test_starts_at_centres_are_centres_with_four_headings(small_lab, coarse_tables):
    belief = GridFilter(small_lab, coarse_tables, DEFAULT, start="centres").belief
    assert belief.states == 4 * 11  # one of the twelve centres is inside the block
    assert set(belief.bin.tolist()) == {0, 18, 36, 54}


def test_the_ground_sensor_tells_targets_apart(small_lab, coarse_tables):
    from ciberrato.world.lab import Target

    lab = dataclasses.replace(small_lab, targets=(Target(x=1.0, y=1.0, radius=1.5),))
    pose_filter = GridFilter(lab, coarse_tables, DEFAULT)
    for inside, expected in ((0, True), (-1, False)):
        pose_filter.belief.set_uniform()
        for _ in range(20):
            pose_filter.stage.ground.weigh(pose_filter.belief, inside, 0.5)
        lattice = coarse_tables.lattice
        near = np.hypot(lattice.x - 1.0, lattice.y - 1.0) < 0.9
        share = pose_filter.belief.square_weights()[near].sum()
        assert (share > 0.9) if expected else (share < 0.01)


def test_equal_places_keep_equal_weights_to_the_last_bit():
    from ciberrato.files.lab import read_lab
    from ciberrato.labs import find_lab
    from ciberrato.localization.tables.pose_tables import build_tables

    lab = read_lab(find_lab("twins"))
    tables = build_tables(lab, ANGLES, 2.0 / 9.0, steps=1)
    parameters = dataclasses.replace(DEFAULT, compass_sensor=False)
    pose_filter = GridFilter(lab, tables, parameters)
    run = Run(lab, pose_filter, (5.0, 5.0, 0.0), parameters)
    for _ in range(60):
        run.step()
        assert not pose_filter.estimate().certain
    weights = pose_filter.belief.square_weights()
    lattice = tables.lattice
    rows = [np.flatnonzero(np.abs(lattice.y - y) < 1.0 + 1e-9) for y in (5.0, 9.0)]
    assert weights[rows[0]].sum() > 0.1
    assert weights[rows[0]] == pytest.approx(weights[rows[1]], rel=1e-3)


def test_goto_arrives_and_sets_its_leds(small_lab, staged):
    run = Run(small_lab, staged, (1.0, 4.2, 77.0), drive="goto", goal=(7.0, 5.0))
    decisions = []
    for _ in range(400):
        pose = run.step()
        decisions.append(run.decision)
        if run.decision.finished:
            break
    assert run.decision.finished == "arrived"
    assert run.decision.end_led
    assert any(decision.visiting_led for decision in decisions)
    assert math.hypot(pose[0] - 7.0, pose[1] - 5.0) < 0.3
    assert run.simulation.robots[0].collisions == 0


def test_active_stops_when_it_knows(small_lab, staged):
    run = Run(small_lab, staged, (6.8, 1.2, -130.0), drive="active")
    for _ in range(150):
        pose = run.step()
    assert run.decision.finished == "localized"
    assert run.command == (0.0, 0.0)
    assert run.errors(pose)[0] < 0.2


def test_smoothing_knows_the_start_that_filtering_could_not(small_lab, fine_tables, staged):
    run = Run(small_lab, staged, (1.0, 4.2, 77.0))
    cells = []
    for _ in range(90):
        pose = run.step()
        cell = (int(pose[1] // 2), int(pose[0] // 2))
        if not cells or cells[-1] != cell:
            cells.append(cell)
    filtered = cell_beliefs(small_lab, fine_tables, DEFAULT, run.history)
    smoothed = cell_beliefs(small_lab, fine_tables, DEFAULT, run.history, smooth=True)
    for blocks in (filtered, smoothed):
        assert blocks.shape[1:] == (3, 4)
        assert blocks.sum(axis=(1, 2)) == pytest.approx(1.0)
    start = cells[0]
    assert filtered[1][start] < 0.9
    assert smoothed[1][start] > 0.99
    found = [np.unravel_index(block.argmax(), block.shape) for block in smoothed[1:]]
    # A robot that has just crossed a border may as well be on its other side, by a hundredth of a unit.
    assert all(cell in cells[max(k - 1, 0) : k + 1] for k, cell in enumerate(found))
    assert sum(cell == true for cell, true in zip(found, cells, strict=True)) >= len(cells) - 1


def star(count: int) -> Lab:
    """Return a triangle, with a block before as many of its sides."""
    walls = []
    for part in range(3):
        a, b = (2.0 * math.pi * (part + k) / 3.0 + 0.3 for k in (0, 1))
        corners = [
            (9.0 + r * math.cos(t), 9.0 + r * math.sin(t)) for r, t in ((8, a), (8, b), (8.3, b), (8.3, a))
        ]
        walls.append(Wall(corners=tuple(corners)))
        if part < count:
            t = a + 0.4
            middle = (9.0 + 2.0 * math.cos(t), 9.0 + 2.0 * math.sin(t))
            corners = [
                (middle[0] + 0.4 * math.cos(t + q), middle[1] + 0.4 * math.sin(t + q)) for q in (0, 2, 4)
            ]
            walls.append(Wall(corners=tuple(corners)))
    return Lab(width=18.0, height=18.0, walls=tuple(walls))


def test_images_of_the_belief_are_poses_to_be_told_apart():
    from ciberrato.localization.tables.pose_tables import COARSE, build_tables

    lab = star(3)
    pose_filter = GridFilter(lab, build_tables(lab, ANGLES, COARSE), DEFAULT)
    lattice = pose_filter.tables.lattice
    squares = np.flatnonzero(np.hypot(lattice.x - 9.0, lattice.y - 6.0) < 0.3)
    pose_filter.belief.set_states(np.full(len(squares), 8), squares)
    (only,) = pose_filter.modes()
    found = pose_filter.separable()
    assert [mode.probability for mode in found] == pytest.approx([1.0 / 3.0] * 3)
    headings = sorted(math.degrees(mode.heading - only.heading) % 360.0 for mode in found)
    assert headings == pytest.approx([0.0, 120.0, 240.0], abs=1e-6)
    radii = [math.hypot(mode.x - 9.0, mode.y - 9.0) for mode in found]
    assert radii == pytest.approx([radii[0]] * 3)
    assert len(pose_filter.separable(most=2)) == 2


def test_a_claim_in_a_lab_that_looks_the_same_turned_round_is_shared_with_its_images():
    from ciberrato.geometry.walls import WallMap
    from ciberrato.infrared.model import ideal_reading, sensor_distances
    from ciberrato.localization.belief.lattice import build_lattice
    from ciberrato.localization.evidence.symmetry import SymmetryCheck, find_turns

    angles = tuple(math.radians(angle) for angle in ANGLES)
    shares = []
    for count, compass in ((3, None), (3, 40.0), (2, None)):
        lab = star(count)
        walls = WallMap.from_lab(lab)
        places = build_lattice(lab, 2.0 / 9.0).representative
        check = SymmetryCheck(lab, find_turns(lab, walls, places, 2.0 / 9.0), angles, 0.1, 2.0)
        if count == 3:
            assert sorted(round(math.degrees(turn.angle)) for turn in check.turns) == [120, 240]
        for step in range(30):
            pose = (8.6 + 0.02 * step, 9.3 - 0.01 * step, math.radians(40.0))
            distances = sensor_distances(walls, pose[0], pose[1], pose[2] + np.array(angles))
            readings = tuple(np.round(ideal_reading(distances), 1).tolist())
            check.observe(pose, 0.06, readings, compass, -1)
        shares.append(check.share())
    assert shares[0] == pytest.approx(1.0 / 3.0, abs=0.02)
    assert shares[1] > 0.99
    assert shares[2] == pytest.approx(0.5, abs=0.02)  # one image is refuted by its missing block


def test_a_filter_that_is_lost_and_not_certain_of_anything_recovers(small_lab, staged):
    run = Run(small_lab, staged, (3.0, 1.0, 0.0))
    for _ in range(40):
        run.step()
    # Four headings in a corner where the robot is not, and readings that rule out none for good.
    far = np.flatnonzero(np.hypot(staged.tables.lattice.x - 1.0, staged.tables.lattice.y - 5.0) < 0.3)
    staged.belief.set_states(np.repeat(np.arange(0, 72, 18), len(far)), np.tile(far, 4))
    staged.stage.settings = staged.fine.settings = dataclasses.replace(staged.fine.settings, alarm=1e9)
    for _ in range(400):
        pose = run.step()
    assert staged.restarts
    assert staged.estimate().certain
    place, turn = run.errors(pose)
    assert place < 0.2
    assert turn < 5.0
