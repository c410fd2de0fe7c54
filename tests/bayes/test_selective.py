"""Selective updating against the filter over all states: what it leaves out, and that it finds back."""

import math

import numpy as np
import pytest

from ciberrato.bayes import ImpossibleReadingError, SelectiveFilter
from ciberrato.bayes.filtering import predict, update
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading
from ciberrato.bayes.motion.selected import heavy
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.spaces import pose_grid
from examples import museum

NOISE = OdometryNoise(rotation=0.08, translation=0.1, alpha1=0.02, alpha3=0.01)
BEAM = museum.BEAM.beam_log_likelihood


@pytest.fixture(scope="module")
def hall():
    return museum.build(cell=0.4, headings=60)


@pytest.fixture(scope="module")
def tour(hall):
    return museum.visit(hall, 1)


def roughly_known(hall, tour):
    """A start that is known to a metre and half a radian, and may be anywhere all the same."""
    off = hall.space.centres() - tour.truth[0]
    near = np.exp(-0.5 * (off[..., 0] ** 2 + off[..., 1] ** 2 + (off[..., 2] / 0.5) ** 2))
    belief = (near + 1e-6) * hall.free[:, :, np.newaxis]
    return belief / belief.sum()


def distance(one, other):
    """Total variation."""
    return 0.5 * float(np.abs(one - other).sum())


def some_belief(space, rng, count=200):
    belief = np.zeros(space.shape)
    states = rng.choice(space.size, count, replace=False)
    belief.ravel()[states] = rng.random(count) ** 8
    return belief / belief.sum()


@pytest.mark.parametrize(
    "control",
    [
        OdometryReading(),
        OdometryReading(rot1=0.3, trans=0.9, rot2=-0.2),
        OdometryReading(rot1=-2.9, trans=0.4, rot2=3.0),
        OdometryReading(trans=4.5, rot2=0.5),  # several directions for each heading
    ],
    ids=["still", "ordinary", "backward", "far"],
)
@pytest.mark.parametrize("noise", [OdometryNoise(), NOISE, OdometryNoise(rotation=0.5, translation=1.5)])
def test_listed_states_move_as_all_do(control, noise):
    rng = np.random.default_rng(3)
    space = pose_grid((20, 17, 24), cell=(0.4, 0.5))
    model = TurnDriveTurn(space=space, noise=noise, free=rng.random((20, 17)) < 0.8)
    for free in (model, TurnDriveTurn(space=space, noise=noise)):
        belief = some_belief(space, rng)
        dense = free.predict(belief, control)
        states = np.flatnonzero(belief)
        moved = free.predict_states(states, belief.ravel()[states], control)
        sparse = np.zeros(space.shape)
        sparse.ravel()[moved.states] = moved.masses
        np.testing.assert_allclose(sparse, dense, atol=1e-16, rtol=1e-12)
        assert (np.diff(moved.states) > 0).all()
        assert moved.left_out == 0.0
        # What is left out is counted, and no state gets more than it should.
        fewer = free.predict_states(states, belief.ravel()[states], control, skip=1e-3)
        assert fewer.left_out <= 1e-3
        lacking = dense.ravel()[fewer.states] - fewer.masses
        assert lacking.min() >= -1e-15
        assert dense.sum() - fewer.masses.sum() <= fewer.left_out + 1e-14


def test_no_mass_moves_to_no_mass():
    model = TurnDriveTurn(space=pose_grid((4, 4, 12), cell=1.0), noise=NOISE)
    nothing = model.predict_states(np.empty(0, dtype=np.intp), np.empty(0), OdometryReading(trans=1.0))
    assert nothing.states.size == nothing.masses.size == 0


def test_what_is_kept_is_heavier_than_the_rest():
    rng = np.random.default_rng(4)
    for size in (1, 2, 50, 3000):
        masses = rng.random(size) ** 30 * (rng.random(size) < 0.7)
        for allowed in (0.0, 1e-12, 1e-3, 0.1):
            kept, rest = heavy(masses, allowed)
            others = np.setdiff1d(np.arange(size), kept)
            assert rest == pytest.approx(masses[others].sum(), rel=1e-9, abs=0.0)
            assert rest <= allowed
            assert masses[others].max(initial=0.0) <= masses[kept].min(initial=np.inf)
            # Half of the least kept would be too much.
            assert rest + masses[kept][masses[kept] <= 2 * masses[kept].min(initial=1.0)].sum() > allowed or (
                not len(kept)
            )


def test_a_scan_of_some_states_is_that_of_all(hall, tour):
    rng = np.random.default_rng(5)
    for number in (0, 7):
        scan = tour.scans[number].copy()
        scan[3] = np.nan
        look = hall.table.scan(scan, BEAM, weight=0.12)
        dense = look()
        np.testing.assert_array_equal(dense, hall.table.log_likelihood(scan, BEAM, weight=0.12))
        states = rng.choice(hall.space.size, 5000)
        np.testing.assert_array_equal(look(states), dense.ravel()[states])
        assert dense.max() <= look.highest < 0.0


@pytest.mark.parametrize("skip", [0.0, 1e-9, 1e-4])
def test_the_distance_to_the_filter_over_all_states_is_within_the_bound(hall, tour, skip):
    dense = roughly_known(hall, tour)
    robot = SelectiveFilter(dense, hall.motion, skip=skip)
    narrow, told, log_evidence = 0, 0, 0.0
    for step, scan in enumerate(tour.scans[:8]):
        scores = hall.table.log_likelihood(scan, BEAM, weight=0.12)
        once = robot.belief
        if step:
            robot.predict(tour.controls[step - 1])
            dense, log_kept = predict(hall.motion.predict, dense, tour.controls[step - 1])
            once = hall.motion.predict(once, tour.controls[step - 1])
            log_evidence += log_kept
        dense, log_one = update(dense, scores)
        log_evidence += log_one
        once, _ = update(once, scores)
        robot.update(hall.table.scan(scan, BEAM, weight=0.12))
        listed = robot.active < hall.space.size
        narrow += listed
        told += listed and robot.left_out < 0.5
        assert robot.masses.sum() == pytest.approx(1.0)
        assert distance(robot.belief, dense) <= robot.left_out + 1e-13
        assert distance(robot.belief, once) <= robot.left_out_now + 1e-13
        assert robot.left_out_now <= robot.left_out
        assert robot.skipped <= skip
        # What the filter goes by: within a factor of the distance itself.
        assert distance(robot.belief, dense) <= 10.0 * robot.passive + 1e-13
    assert robot.looks == 0
    assert narrow >= 5 if skip else narrow == 0  # kernels reach so far that nothing is zero
    assert told >= 1 if skip else robot.left_out == 0.0
    assert robot.log_evidence == pytest.approx(log_evidence, abs=10 * skip + 1e-9)
    if skip:
        assert robot.active < 0.02 * hall.space.size


def test_a_bound_needs_the_highest_likelihood(hall, tour):
    robot = SelectiveFilter(roughly_known(hall, tour), hall.motion, skip=1e-6)
    for step, scan in enumerate(tour.scans[:6]):
        look = hall.table.scan(scan, BEAM, weight=0.12)
        if step:
            robot.predict(tour.controls[step - 1])
        if step == 5:
            robot.update(lambda states, look=look: look(states))
            assert robot.left_out == pytest.approx(1.0)
        else:
            robot.update(look)
    with pytest.raises(ValueError, match="above the highest"):
        robot.update(look, highest=-100.0)


def test_a_kidnapped_robot_is_found_again(hall, tour):
    robot = SelectiveFilter(roughly_known(hall, tour), hall.motion)
    stubborn = SelectiveFilter(roughly_known(hall, tour), hall.motion, refuted=np.nextafter(1.0, 0.0))
    stops = [*range(6), *range(28, 38)]  # carried from stop 5 to stop 28, and odometry tells nothing of it
    for step, stop in enumerate(stops):
        look = hall.table.scan(tour.scans[stop], BEAM, weight=0.12)
        for one in (robot, stubborn):
            if step:
                one.predict(OdometryReading() if stop == 28 else tour.controls[stop - 1])
            one.update(look)
        if stop == 5:
            assert robot.looks == 0
            assert robot.active < 0.02 * hall.space.size
    assert robot.looks > 0
    assert near(hall, robot.belief, tour.truth[stops[-1]]) > 0.9
    assert stubborn.looks == 0
    assert near(hall, stubborn.belief, tour.truth[stops[-1]]) < 0.9
    for _ in range(8):
        robot.predict(OdometryReading())
        robot.update(look)
    assert robot.active < 0.05 * hall.space.size


def near(hall, belief, pose):
    """Mass within 1 m and 20 degrees."""
    off = hall.space.centres() - pose
    turn = np.abs(np.mod(off[..., 2] + math.pi, 2.0 * math.pi) - math.pi)
    return float(belief[(np.hypot(off[..., 0], off[..., 1]) < 1.0) & (turn < math.radians(20.0))].sum())


def corridor(**options):
    space = pose_grid((20, 20, 12), cell=1.0)
    motion = TurnDriveTurn(space=space, noise=NOISE)
    return SelectiveFilter(space.point_mass((5.5, 5.5, 0.1)), motion, **options)


def test_impossible_readings_and_lost_mass():
    robot = corridor(kidnapped=0.0)
    before = robot.belief
    never = np.full((20, 20, 12), -np.inf)
    with pytest.raises(ImpossibleReadingError):
        robot.update(lambda states: never if states is None else never.ravel()[states])
    np.testing.assert_array_equal(robot.belief, before)
    # Possible elsewhere only: the passive mass has it.
    robot = corridor()
    robot.predict(OdometryReading(trans=0.5))
    there = never.copy()
    there[15, 15, 3] = 0.0
    robot.update(lambda states: there if states is None else there.ravel()[states])
    assert robot.belief[15, 15, 3] == 1.0
    assert robot.looks == 1
    # Driven off the grid: anywhere again.
    robot = corridor()
    for _ in range(3):
        robot.predict(OdometryReading(trans=20.0))
    assert robot.active == 4800
    assert robot.belief.sum() == pytest.approx(1.0)
    for policy in ("keep", "uniform"):
        robot = corridor(kidnapped=0.0, on_impossible=policy)
        robot.update(lambda states: never if states is None else never.ravel()[states])
        assert robot.recoveries == 1
        assert robot.belief.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    "options",
    [
        {"skip": -1e-9},
        {"skip": 1.0},
        {"widest": math.nan},
        {"kidnapped": 2},
        {"refuted": 0.0},
        {"advantage": -1.0},
        {"probes": 0},
    ],
    ids=str,
)
def test_options_that_mean_nothing_are_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        corridor(**options)


def test_likelihoods_of_a_wrong_kind_are_refused():
    robot = corridor()
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match=r"nan|inf"):
            robot.update(lambda states, wrong=wrong: np.full(len(states), wrong))
    with pytest.raises(ValueError, match="shape"):
        robot.update(lambda states: np.zeros(3))
