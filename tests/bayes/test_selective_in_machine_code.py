"""Listed states in machine code against numpy's, and against what all states get."""

import math

import numpy as np
import pytest

from ciberrato.bayes import SelectiveFilter, compiled
from ciberrato.bayes.motion.lattice import lattice_kernels
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading
from ciberrato.bayes.motion.selected import heavy
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.sensors.scan_table import ScanTable
from ciberrato.bayes.spaces import pose_grid
from examples import museum

BEAM = museum.BEAM.beam_log_likelihood
CONTROLS = {
    "still": OdometryReading(),
    "ordinary": OdometryReading(rot1=0.3, trans=0.9, rot2=-0.2),
    "backward": OdometryReading(rot1=-2.9, trans=0.4, rot2=3.0),
    "far": OdometryReading(trans=4.5, rot2=0.5),  # several directions for each heading: numpy's work
}
NOISES = {
    "none": OdometryNoise(),
    "some": OdometryNoise(rotation=0.08, translation=0.1, alpha1=0.02, alpha3=0.01),
    "wide": OdometryNoise(rotation=0.5, translation=1.5),
    "anywhere": OdometryNoise(rotation=30.0, translation=0.1),
}


@pytest.fixture
def machine_code(loops):
    compiled.use(loops)
    yield loops
    compiled.use(None)


def as_array(moved, space):
    result = np.zeros(space.shape)
    result.ravel()[moved.states] = moved.masses
    return result


@pytest.mark.parametrize("control", CONTROLS.values(), ids=CONTROLS)
@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
@pytest.mark.parametrize("headings", [24, 5])
def test_listed_states_move_as_all_do(machine_code, control, noise, headings):
    rng = np.random.default_rng(headings)
    space = pose_grid((20, 17, headings), cell=(0.4, 0.5))
    for free in (None, rng.random((20, 17)) < 0.8):
        model = TurnDriveTurn(space=space, noise=noise, free=free)
        states = np.sort(rng.choice(space.size, 200, replace=False))
        masses = rng.random(200) ** 8
        belief = np.zeros(space.shape)
        belief.ravel()[states] = masses
        fast = model.predict_states(states, masses, control)
        dense = model.predict(belief, control)
        compiled.use(None)
        plain = model.predict_states(states, masses, control)
        compiled.use(machine_code)
        assert (np.diff(fast.states) > 0).all()
        assert (fast.masses > 0.0).all()
        assert fast.left_out == plain.left_out == 0.0
        bound = 1e-14 * plain.masses.max()
        assert np.abs(as_array(fast, space) - as_array(plain, space)).max() <= bound
        assert np.abs(as_array(fast, space) - dense).max() <= bound
        # What is left out is counted, and no state gets more than it should; types and strides do not matter.
        room = np.repeat(masses, 2)
        fewer = model.predict_states(states.astype(np.int32), room[::2], control, skip=1e-3)
        assert 0.0 < fewer.left_out <= 1e-3 * masses.sum()
        assert len(fewer.states) <= len(fast.states)
        assert (fewer.masses - dense.ravel()[fewer.states]).max() <= bound
        assert dense.sum() - fewer.masses.sum() <= fewer.left_out + 1e-13


def test_no_mass_moves_to_no_mass(machine_code):
    model = TurnDriveTurn(space=pose_grid((4, 4, 12), cell=1.0), noise=NOISES["some"])
    nothing = model.predict_states(np.empty(0, dtype=np.intp), np.empty(0), OdometryReading(trans=1.0))
    assert nothing.states.size == nothing.masses.size == 0
    # All of it leaves the grid.
    gone = model.predict_states(np.array([0]), np.array([1.0]), OdometryReading(rot1=math.pi / 12, trans=5.0))
    assert gone.states.size == 0


def test_what_is_kept_is_what_numpy_keeps(loops):
    rng = np.random.default_rng(4)
    for size in (0, 1, 2, 50, 3000):
        masses = rng.random(size) ** rng.choice([1, 30, 300]) * (rng.random(size) < 0.7)
        masses[: size // 50] = 5e-324
        for allowed in (0.0, 1e-12, 1e-3, 0.1, 1e9):
            kept, rest = loops.heavy(masses, allowed)
            plain, plain_rest = heavy(masses, allowed)
            np.testing.assert_array_equal(kept, plain)
            assert rest == pytest.approx(plain_rest, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.3, 0.7])
def test_small_kernels_are_those_of_numpy(loops, sigma):
    rng = np.random.default_rng(5)
    angle = np.concatenate([rng.uniform(-4.0, 4.0, 300), np.arange(-8, 9) * (math.pi / 8.0)])
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.choice([1.0, 2.5])
    mean = along * rng.uniform(0.0, 6.0, (len(angle), 1))
    covariance = sigma**2 * along[:, :, np.newaxis] * along[:, np.newaxis]
    covariance[::3] += 0.01 * np.eye(2)
    plain = lattice_kernels(mean, covariance, reach=(30, 30))
    fast = lattice_kernels(mean, covariance, reach=(30, 30), loops=loops)
    table = np.zeros((2, len(angle), 61, 61))
    for one, kernels in zip(table, (plain, fast), strict=True):
        np.add.at(one, (kernels.kernel, *(kernels.cells + 30).T), kernels.weights)
    assert np.abs(table[0] - table[1]).max() <= 2e-15
    for ours, theirs in zip(fast.moments(len(angle)), plain.moments(len(angle)), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-13)


@pytest.mark.parametrize(("beams", "spacing"), [(1, 1), (13, 2), (46, 2), (60, 1), (101, 5)])
def test_listed_scans_are_those_of_all_to_the_last_bit(machine_code, beams, spacing):
    """Single states, whole places, and parts of places, with beams that go round once and more."""
    rng = np.random.default_rng(beams)
    space = pose_grid((11, 19, 60), cell=0.4)
    free = rng.random((11, 19)) < 0.8

    def cast(x, y, angle, farthest):
        return np.minimum(farthest, 2.0 + np.sin(3.0 * x + angle) + np.cos(5.0 * y - 2.0 * angle))

    table = ScanTable(space, free, cast, beams=beams, spacing=spacing, max_range=4.0)
    look = table.scan(rng.uniform(0.0, 4.0, beams), BEAM, weight=0.4)
    every = look().ravel()
    for some in (
        rng.permutation(space.size)[:700],
        np.arange(60 * 7, 60 * 90),
        np.sort(rng.choice(space.size, 3000, replace=False)),
        np.append(np.arange(500, 530), [3, 9000]),
        np.empty(0, dtype=np.int32),
    ):
        np.testing.assert_array_equal(look(some), every[some])


@pytest.mark.parametrize("skip", [1e-9, 1e-4])
def test_the_selective_filter_goes_where_numpys_goes(loops, skip):
    hall = museum.build(cell=0.4, headings=60)
    tour = museum.visit(hall, 1)
    off = hall.space.centres() - tour.truth[0]
    belief = np.exp(-0.5 * (off[..., 0] ** 2 + off[..., 1] ** 2 + (off[..., 2] / 0.5) ** 2)) + 1e-6
    belief *= hall.free[:, :, np.newaxis]
    robots = [SelectiveFilter(belief, hall.motion, skip=skip) for _ in range(2)]
    narrow = 0
    for step, scan in enumerate(tour.scans[:10]):
        for robot, module in zip(robots, (None, loops), strict=True):
            compiled.use(module)
            try:
                if step:
                    robot.predict(tour.controls[step - 1])
                robot.update(hall.table.scan(scan, BEAM, weight=0.12))
            finally:
                compiled.use(None)
        plain, fast = robots
        assert fast.masses.sum() == pytest.approx(1.0)
        # Scans differ by single precision's rounding.
        assert 0.5 * np.abs(fast.belief - plain.belief).sum() <= 1e-5 + skip
        assert fast.log_evidence == pytest.approx(plain.log_evidence, abs=1e-4)
        assert fast.looks == plain.looks == 0
        assert fast.left_out_now <= fast.left_out
        narrow += fast.active < 0.02 * hall.space.size
    assert narrow >= 5
