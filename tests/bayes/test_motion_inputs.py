"""What motion models take: ordinary motions, wild ones, other numbers and containers, unequal cells."""

from __future__ import annotations

import itertools
import math
import tracemalloc

import numpy as np
import pytest

from ciberrato.bayes import MarkovFilter
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.bayes.motion.carried import Carried
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.motion.kernel import CommandKernel, KernelMotion
from ciberrato.bayes.motion.lattice import lattice_kernels
from ciberrato.bayes.motion.odometry import GaussianOdometry, OdometryNoise, OdometryReading
from ciberrato.bayes.motion.omnidirectional import (
    OmnidirectionalNoise,
    OmnidirectionalOdometry,
    OmnidirectionalReading,
)
from ciberrato.bayes.motion.shift import Shift
from ciberrato.bayes.motion.transition_matrix import TransitionMatrix
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.motion.velocity import VelocityCommand, VelocityMotion, VelocityNoise
from ciberrato.bayes.motion.wheels import DifferentialWheels
from ciberrato.bayes.spaces import Axis, StateSpace, pose_grid
from ciberrato.bayes.summaries import moments

SPACE = pose_grid((12, 9, 18), cell=0.3048)
ALPHAS = OdometryNoise(alpha1=0.2, alpha2=0.2, alpha3=0.2, alpha4=0.2)
BELIEF = SPACE.uniform()


def odometry(**reading):
    return [
        lambda model=model: model.predict(BELIEF, OdometryReading(**reading))
        for model in (
            GaussianOdometry(SPACE, ALPHAS),
            GaussianOdometry(SPACE, OdometryNoise(rotation=0.3, translation=0.3), density="pose"),
            TurnDriveTurn(space=SPACE, noise=ALPHAS),
        )
    ]


def velocity(speed, turning):
    model = VelocityMotion(space=SPACE, noise=VelocityNoise(alpha1=0.1, alpha4=0.1, alpha5=0.1))
    return lambda: model.predict(BELIEF, VelocityCommand(speed=speed, turning=turning))


def wheels(left, right):
    model = DifferentialWheels(space=SPACE, base=0.3, noise=0.1)
    return lambda: model.predict(BELIEF, (left, right), model.at_rest())


def omni(**reading):
    model = OmnidirectionalOdometry(space=SPACE, noise=OmnidirectionalNoise(alpha3=0.1))
    return lambda: model.predict(BELIEF, OmnidirectionalReading(**reading))


WILD = [
    *odometry(trans=100.0),
    *odometry(trans=-1e6),
    *odometry(trans=1e300),
    *odometry(rot1=math.nan),
    *odometry(trans=math.inf),
    *odometry(rot2=90.0),
    velocity(1e6, 0.0),
    velocity(0.1, math.nan),
    velocity(0.1, 500.0),
    wheels(300.0, 300.0),
    wheels(0.1, math.nan),
    omni(forward=100.0),
    omni(left=math.inf),
    lambda: GaussianOdometry(SPACE, OdometryNoise(translation=1e9)).predict(BELIEF, OdometryReading()),
    lambda: GaussianShift(cell=1.0, sigma=1e9, edge="lose").predict(np.ones(9) / 9, 0.0),
    lambda: GaussianShift(cell=1.0, sigma=1.0, edge="lose").predict(np.ones(9) / 9, math.nan),
    lambda: GaussianShift(cell=1.0, sigma=1.0, edge="lose").predict(np.array([0.5, math.nan]), 0.0),
    lambda: CommandKernel.from_displacements({0: 0.5, 10**10: 0.5}),
    lambda: OdometryNoise(alpha1=math.inf),
    lambda: OmnidirectionalNoise(strafe=-1.0),
]


@pytest.mark.parametrize("act", WILD, ids=itertools.count())
def test_wild_motion_is_a_named_error_in_little_memory(act):
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"finite|longer than|radians|unit|too far|not "):
            act()
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "act",
    [
        lambda: Shift(edges=("wrap",)).predict(np.eye(4)[0], 1.9),
        lambda: Shift(edges=("wrap",)).predict(np.eye(4)[0], math.nan),
        lambda: Shift(edges=("wrap",)).predict(np.eye(4)[0], "1"),
        lambda: BlockedShift(openings=Openings.free(2, 3)).predict(np.ones((2, 3)) / 6, ("east", 1.5)),
        lambda: BlockedShift(openings=Openings.free(2, 3)).predict(np.ones((2, 3)) / 6, ("east",)),
        lambda: BlockedShift(openings=Openings.free(2, 3), arrival={0: math.nan}),
        lambda: CommandKernel.from_displacements({}),
        lambda: CommandKernel.from_displacements({0: 0.5, (1, 2): 0.5}),
        lambda: CommandKernel.from_displacements({0.5: 1.0}),
        lambda: KernelMotion(kernels={}, edges=("wrap",)).predict(np.ones(3) / 3, {"no": "key"}),
        lambda: TransitionMatrix(matrices={0: np.eye(2)}).predict(np.ones(3) / 3, 0),
        lambda: TransitionMatrix(matrices={0: np.eye(2)}).predict(np.ones(2) / 2, 1),
        lambda: TransitionMatrix(matrices={0: np.ones((2, 3)) / 3}),
        lambda: TransitionMatrix(matrices={0: np.array([[math.nan, 0.0], [0.0, 1.0]])}),
    ],
    ids=itertools.count(),
)
def test_what_is_no_command_is_refused(act):
    with pytest.raises(ValueError, match=r"must be|needs|no |is not|does not|command|entry"):
        act()


def test_commands_of_numpy_lists_and_whole_floats_mean_ints_and_tuples():
    point = np.eye(4)[0]
    for one in (1, 1.0, np.int64(1), np.float32(1.0), [1], np.array([1]), (1.0,)):
        np.testing.assert_array_equal(Shift(edges=("wrap",)).predict(point, one), np.eye(4)[1])
    np.testing.assert_array_equal(Shift(edges=("wrap",)).predict(point, 10**30 + 1), np.eye(4)[1])
    np.testing.assert_array_equal(Shift(edges=("stay",)).predict(point, 10**30), np.eye(4)[3])
    for key in (-1, np.int64(-1), (-1,), (-1.0,)):
        kernel = CommandKernel.from_displacements({key: 0.25, 1: 0.75})
        assert (kernel.first, kernel.weights.tolist()) == ((-1,), [0.25, 0.0, 0.75])
    step = CommandKernel.from_displacements({(0, 1): 1.0})
    for command in ((0, 1), [0, 1], np.array([0, 1]), (np.int64(0), 1.0)):
        moved = KernelMotion(kernels={(0, 1): step}, edges=("wrap", "wrap")).predict(np.eye(3), command)
        np.testing.assert_array_equal(moved, np.roll(np.eye(3), 1, axis=1))
        matrix = TransitionMatrix(matrices={(0, 1): np.eye(2)}).predict(point[:2], command)
        np.testing.assert_array_equal(matrix, point[:2])
    walls = BlockedShift(openings=Openings.free(1, 4))
    for command in (("east", 2), ["east", 2.0], ("east", np.int8(2))):
        np.testing.assert_array_equal(walls.predict(point[np.newaxis], command), np.eye(4)[2:3])


@pytest.mark.parametrize("periodic", [False, True])
def test_a_billion_blocked_steps_take_no_longer_than_a_few(periodic):
    openings = Openings.free(3, 5, periodic=periodic)
    east = openings.east.copy()
    east[1, 2] = False
    model = BlockedShift(openings=Openings(east=east, north=openings.north), arrival={0: 0.5, 3: 0.5})
    belief = np.random.default_rng(1).dirichlet(np.ones(15)).reshape(3, 5)
    expected = model.predict(belief, ("east", 13))
    np.testing.assert_allclose(model.predict(belief, ("east", 10**9 + 3)), expected, atol=1e-15)


def test_still_turning_in_place_and_backward_are_ordinary():
    space = pose_grid((10, 10, 36), cell=0.1)
    start = space.pose((4, 5, 18))
    for model in (GaussianOdometry(space, ALPHAS), TurnDriveTurn(space=space, noise=ALPHAS)):
        belief = space.point_mass(start)
        np.testing.assert_allclose(model.predict(belief, OdometryReading()), belief, atol=1e-15)
        turned = [
            model.predict(belief, OdometryReading.between((0, 0, 0), (way, 0, 0.1)))
            for way in (0.0, 1e-9, -1e-9)
        ]
        for other in turned[1:]:
            np.testing.assert_allclose(other, turned[0], atol=1e-6)
        heading = turned[0].sum(axis=(0, 1)) @ space.axes[2].centres
        assert heading == pytest.approx(start[2] + 0.1, abs=1e-9)
        # 0.2 m backward with alphas of 0.2: sigma of each turn 0.2 sqrt 0.2, of the way as much.
        back = moments(model.predict(belief, OdometryReading.between((0, 0, 0), (-0.2, 0, 0))), space)
        along = 0.2 * math.exp(-0.5 * 0.2 * 0.04)
        cos, sin = math.cos(start[2]), math.sin(start[2])
        np.testing.assert_allclose(back.mean[:2], start[:2] - [along * cos, along * sin], atol=2e-3)
        assert math.sqrt(back.covariance[2, 2]) == pytest.approx(0.2 * math.sqrt(0.4), rel=0.01)


@pytest.mark.parametrize("still", [False, True])
def test_a_minute_at_10_hertz_is_carried_by_a_filter(still):
    # 600 steps of 1.5 mm on cells of 0.1 m, 1 mm of noise each: 0.9 m, with 24.5 mm of noise.
    space = pose_grid((24, 16, 12), cell=0.1)
    start = space.pose((6, 6, 6))
    motion = Carried(TurnDriveTurn(space=space, noise=OdometryNoise(translation=0.001)))
    robot = MarkovFilter(space.point_mass(start), motion.predict)
    step = OdometryReading(trans=0.0 if still else 0.0015)
    for _ in range(600):
        robot.predict(step)
    way = 0.0 if still else 0.9
    ahead = np.array([math.cos(start[2]), math.sin(start[2])])
    np.testing.assert_allclose(motion.mean(robot.belief)[:2], start[:2] + way * ahead, atol=1e-5)
    assert motion.mean(robot.belief)[2] == pytest.approx(start[2], abs=1e-9)
    off = (motion.centres()[..., :2] - start[:2] - way * ahead) @ ahead
    assert (robot.belief * off**2).sum() == pytest.approx(600 * 0.001**2, rel=0.05)
    assert np.abs(motion.centres() - space.centres())[..., :2].max() <= 0.05 + 1e-12


def test_the_noise_of_a_reversal_counts_the_turn_that_is_made():
    noise = OdometryNoise(alpha1=0.3, alpha4=0.3)
    back = OdometryReading.between((1.0, 1.0, 0.4), (1.0 - math.cos(0.4), 1.0 - math.sin(0.4), 0.5))
    assert back.trans == pytest.approx(1.0)
    assert abs(back.rot1) == pytest.approx(math.pi)
    assert back.turns_made() == pytest.approx((0.0, 0.1), abs=1e-12)
    assert noise.sigmas(back) == pytest.approx(noise.sigmas(OdometryReading(trans=-1.0, rot2=0.1)))
    # Turning in place by most of half a turn is no reversal.
    assert OdometryReading(rot2=3.0).turns_made() == (0.0, 3.0)
    creep = OdometryReading.between((0, 0, 0), (-0.004, 0.003, 0.2), threshold=0.01)
    assert creep == OdometryReading(rot1=0.0, trans=-0.004, rot2=0.2)


def test_omnidirectional_readings_come_from_poses():
    reading = OmnidirectionalReading.between((1.0, 2.0, 0.5 * math.pi), (0.6, 2.3, 0.7 * math.pi))
    assert (reading.forward, reading.left, reading.turn) == pytest.approx((0.3, 0.4, 0.2 * math.pi))
    noise = OmnidirectionalNoise(rotation=0.1, alpha1=0.2, alpha2=0.3, alpha3=0.4, alpha4=0.5, alpha5=0.6)
    way, turn = 0.25, reading.turn**2
    assert noise.sigmas(reading) == pytest.approx(
        [
            math.sqrt(v)
            for v in (0.01 + 0.2 * turn + 0.3 * way, 0.4 * way + 0.5 * turn, 0.6 * way + 0.5 * turn)
        ]
    )


UNEQUAL = StateSpace(
    (
        Axis(name="x", size=60, cell=0.05),
        Axis(name="y", size=21, cell=0.2),
        Axis(name="heading", size=24, cell=math.pi / 12, periodic=True),
    )
)


@pytest.mark.parametrize(
    ("model", "control"),
    [
        (GaussianOdometry(UNEQUAL, OdometryNoise(translation=0.1)), OdometryReading(rot1=0.3, trans=0.5)),
        (
            TurnDriveTurn(space=UNEQUAL, noise=OdometryNoise(translation=0.1)),
            OdometryReading(rot1=0.3, trans=0.5),
        ),
        (
            VelocityMotion(space=UNEQUAL, noise=VelocityNoise(speed=0.1)),
            VelocityCommand(speed=0.5 * 0.3 / math.sin(0.3), turning=0.6),
        ),
        (
            OmnidirectionalOdometry(space=UNEQUAL, noise=OmnidirectionalNoise(translation=0.1)),
            OmnidirectionalReading(forward=0.5 * math.cos(0.3), left=0.5 * math.sin(0.3)),
        ),
    ],
)  # fmt: skip
def test_cells_may_differ_in_x_and_y(model, control):
    start = UNEQUAL.pose((20, 10, 4))
    got = moments(model.predict(UNEQUAL.point_mass(start), control), UNEQUAL)
    ahead = start[2] + 0.3
    along = np.array([math.cos(ahead), math.sin(ahead)])
    np.testing.assert_allclose(got.mean[:2], start[:2] + 0.5 * along, atol=1e-5)
    chord = 0.1 * (math.sin(0.3) / 0.3 if isinstance(model, VelocityMotion) else 1.0)
    added = got.covariance[:2, :2] - chord**2 * np.outer(along, along)
    # A quarter of a square cell at most, either way.
    assert -1e-4 <= added[0, 0] <= 0.25 * 0.05**2 + 1e-5
    assert -1e-4 <= added[1, 1] <= 0.25 * 0.2**2 + 1e-5


def test_wide_kernels_move_as_the_sum_over_their_cells_does():
    rng = np.random.default_rng(5)
    space = pose_grid((30, 25, 4), cell=0.1)
    noise = OmnidirectionalNoise(translation=0.5, strafe=0.4)
    belief = np.zeros(space.shape)
    belief[8:20, 3:15] = rng.random((12, 12, 4))
    belief /= belief.sum()
    ours = OmnidirectionalOdometry(space=space, noise=noise).predict(
        belief, OmnidirectionalReading(forward=0.43)
    )
    expected = np.zeros(space.shape)
    for k, heading in enumerate(space.axes[2].centres):
        cos, sin = math.cos(heading), math.sin(heading)
        turn = np.array([[cos, -sin], [sin, cos]])
        covariance = turn @ np.diag([25.0, 16.0]) @ turn.T
        kernel = lattice_kernels(4.3 * turn[:, 0][np.newaxis], covariance[np.newaxis], reach=(29, 24))
        assert len(kernel.cells) > 400
        for (i, j), weight in zip(kernel.cells, kernel.weights, strict=True):
            for a in range(8, 20):
                b = np.arange(3, 15)
                if 0 <= a + i < 30:
                    b = b[(b + j >= 0) & (b + j < 25)]
                    expected[a + i, b + j, k] += weight * belief[a, b, k]
    np.testing.assert_allclose(ours, expected, atol=1e-15)
    assert (ours >= 0.0).all()


def test_lattice_kernels_have_the_moments_asked_for():
    rng = np.random.default_rng(3)
    angle, sigma, flat = rng.uniform(0, 7, 400), 10 ** rng.uniform(-3, 1, 400), rng.uniform(0, 1, 400)
    ahead = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    covariance = sum(
        s[:, None, None] ** 2 * v[:, :, None] * v[:, None, :]
        for s, v in ((sigma, ahead), (sigma * flat, aside))
    )
    mean = rng.uniform(-3, 3, (400, 2)) * (rng.random((400, 1)) < 0.5)
    kernels = lattice_kernels(mean, covariance, reach=(300, 300))
    assert (kernels.weights > 0.0).all()
    np.testing.assert_allclose(np.bincount(kernels.kernel, kernels.weights), 1.0, atol=1e-12)
    got_mean, got = kernels.moments(400)
    np.testing.assert_allclose(got_mean, mean, atol=1e-5)
    added = got - covariance
    rest = np.abs(mean - np.rint(mean))
    small = np.maximum(covariance[:, 0, 0], covariance[:, 1, 1]) <= 0.5
    trace = np.trace(added, axis1=1, axis2=2)
    # r (1 - r) must be added, less the variance there is; at most all of it, and a little for thin ones.
    most = (rest * (1.0 - rest)).sum(axis=1)
    second = np.trace(covariance, axis1=1, axis2=2) + np.square(rest).sum(axis=1)
    assert (trace[small] >= -1e-9).all()
    assert (trace[small] <= (most + 0.1 * second)[small] + 1e-9).all()
    assert (trace[~small] <= 0.26 + 1e-3 * sigma[~small] ** 2).all()
    # As wide across as a quarter of a square cell asks for, and between cells or not: exact.
    round_ = flat * sigma > 0.5
    assert round_.sum() > 30
    np.testing.assert_allclose(
        added[round_ & ~small], 0.0, atol=2e-3 * sigma[round_ & ~small, None, None].max() ** 2
    )
