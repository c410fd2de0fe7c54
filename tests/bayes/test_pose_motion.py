"""Motion over (x, y, heading): against all pairs of cells, and samples of the generating process."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from ciberrato.bayes.angles import wrapped_normal
from ciberrato.bayes.motion.displacements import displacements
from ciberrato.bayes.motion.lattice import lattice_kernels
from ciberrato.bayes.motion.odometry import GaussianOdometry, OdometryNoise, OdometryReading
from ciberrato.bayes.motion.transition_matrix import transition_matrix
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.motion.velocity import VelocityCommand, VelocityMotion, VelocityNoise
from ciberrato.bayes.motion.wheels import DifferentialWheels
from ciberrato.bayes.spaces import pose_grid

COURSE = pose_grid((12, 9, 18), cell=0.3048, origin=(-1.6764, -1.3716, -math.pi))
COURSE_NOISE = OdometryNoise(rotation=math.radians(15.0), translation=0.45)
SMALL = pose_grid((4, 3, 8), cell=0.5, origin=(0.0, 0.0, -math.pi))


def normal(x, sigma):
    return math.exp(-0.5 * (x / sigma) ** 2) / (sigma * math.sqrt(2 * math.pi))


def wound(angle, sigma):
    return sum(normal(angle + 2 * math.pi * k, sigma) for k in range(-8, 9))


def mean_inverse_distance(dx, dy, width):
    """Integral of 1/r over a square, by quadrature along y of the closed form along x."""
    a, b = dx - width / 2, dx + width / 2
    return integrate.quad(
        lambda y: math.asinh(b / abs(y)) - math.asinh(a / abs(y)),
        dy - width / 2,
        dy + width / 2,
        points=[0.0],
        epsabs=1e-13,
    )[0]


def pose_density(space, noise, u, start, end):
    """Mass of cell `end` for a start at the centre of `start`: one pair, without any factoring."""
    (x0, y0, t0), (x1, y1, t1) = space.pose(start), space.pose(end)
    s1, st_, s2 = noise.sigmas(u)
    width = space.axes[0].cell
    away = math.hypot(x1 - x0, y1 - y0)
    if start[:2] == end[:2]:
        n = min(8, max(4, math.ceil(1.5 / noise.rotation)))
    else:
        n = min(8, math.ceil(width / (1.4 * noise.rotation * away) - 1e-9))
    steps = [((k + 0.5) / n - 0.5) * width for k in range(n)]
    parts = [(x1 - x0 + a, y1 - y0 + b, width / n) for a in steps for b in steps]
    total = 0.0
    for dx, dy, size in parts:
        r, inverse = math.hypot(dx, dy), mean_inverse_distance(dx, dy, size)
        for way, phi in ((r, math.atan2(dy, dx)), (-r, math.atan2(-dy, -dx))):
            turns = wound(phi - t0 - u.rot1, s1) * wound(t1 - phi - u.rot2, s2)
            total += inverse * normal(way - u.trans, st_) * turns
    return total * space.axes[2].cell


@pytest.mark.parametrize(
    "u",
    [
        OdometryReading(rot1=0.4, trans=0.7, rot2=-1.0),
        OdometryReading(rot1=3.0, trans=0.0, rot2=0.3),
        OdometryReading(rot1=-2.0, trans=-0.6, rot2=2.5),
    ],
)
def test_every_pair_of_cells_has_the_density_of_the_formula(u):
    noise = OdometryNoise(rotation=0.5, translation=0.3, alpha1=0.05, alpha4=0.02)
    ours = transition_matrix(GaussianOdometry(SMALL, noise, normalized=False).predict, SMALL.shape, u)
    cells = list(np.ndindex(*SMALL.shape))
    rng = np.random.default_rng(1)
    # All ends of some starts: the formula by quadrature is slow.
    for start in rng.choice(len(cells), 6, replace=False):
        expected = [pose_density(SMALL, noise, u, cells[start], end) for end in cells]
        np.testing.assert_allclose(ours[start], expected, rtol=1e-9, atol=1e-15)


def book_table_5_5(space, noise, u):
    """p1 p2 p3 of table 5.5 for all pairs of the course's grid, vectorized over the end pose only."""
    s1, st_, s2 = noise.sigmas(u)
    centres = space.centres().reshape(-1, 3)
    matrix = np.empty((space.size, space.size))

    def wrapped(angle):
        return (angle + np.pi) % (2 * np.pi) - np.pi

    for k, (x, y, heading) in enumerate(centres):
        dx, dy = centres[:, 0] - x, centres[:, 1] - y
        # Exactly zero where the cell is the same: the difference of equal centres.
        rot1 = np.arctan2(np.round(dy, 9), np.round(dx, 9)) - heading
        rot2 = centres[:, 2] - heading - rot1
        matrix[k] = (
            np.exp(-0.5 * (wrapped(u.rot1 - rot1) / s1) ** 2) / (s1 * math.sqrt(2 * math.pi))
            * np.exp(-0.5 * ((u.trans - np.hypot(dx, dy)) / st_) ** 2) / (st_ * math.sqrt(2 * math.pi))
            * np.exp(-0.5 * (wrapped(u.rot2 - rot2) / s2) ** 2) / (s2 * math.sqrt(2 * math.pi))
        )  # fmt: skip
    return matrix * space.cell_volume


def test_course_grid_equals_table_5_5_over_all_pairs():
    u = OdometryReading(rot1=0.35, trans=0.55, rot2=-0.8)
    matrix = book_table_5_5(COURSE, COURSE_NOISE, u)
    model = GaussianOdometry(COURSE, COURSE_NOISE, density="book", normalized=False)
    for seed in range(3):
        belief = np.random.default_rng(seed).dirichlet(np.full(COURSE.size, 0.1))
        expected = belief @ matrix
        ours = model.predict(belief.reshape(COURSE.shape), u).ravel()
        np.testing.assert_allclose(ours, expected, atol=1e-13 * expected.max())


@pytest.mark.parametrize(
    "u", [OdometryReading(rot1=0.35, trans=0.55, rot2=-0.8), OdometryReading(trans=0.05)]
)
def test_slices_and_table_and_normalization_agree(u):
    belief = np.random.default_rng(3).dirichlet(np.full(COURSE.size, 0.1)).reshape(COURSE.shape)
    plain = GaussianOdometry(COURSE, COURSE_NOISE, density="pose")
    sliced = GaussianOdometry(COURSE, COURSE_NOISE, density="pose", skip_below=1e-300)
    np.testing.assert_allclose(plain.predict(belief, u), sliced.predict(belief, u), atol=1e-16)
    raw = GaussianOdometry(COURSE, COURSE_NOISE, normalized=False)
    np.testing.assert_allclose(
        plain.predict(belief, u), raw.predict(belief / plain.kernel_mass(u), u), atol=1e-16
    )


def test_kernel_mass_is_the_row_sum_on_a_grid_that_holds_the_whole_kernel():
    big = pose_grid((61, 61, 18), cell=0.3048, origin=(-30.5 * 0.3048, -30.5 * 0.3048, -math.pi))
    u = OdometryReading(rot1=0.35, trans=0.9, rot2=-0.8)
    raw = GaussianOdometry(COURSE, COURSE_NOISE, normalized=False)
    wide = GaussianOdometry(big, COURSE_NOISE, normalized=False)
    for k in (0, 5, 11):
        point = np.zeros(big.shape)
        point[30, 30, k] = 1.0
        assert wide.predict(point, u).sum() == pytest.approx(raw.kernel_mass(u)[k], rel=1e-6)
        for density in (None, "pose"):
            predicted = GaussianOdometry(big, COURSE_NOISE, density=density).predict(point, u)
            assert predicted.sum() == pytest.approx(1.0, abs=1e-6)


def sample_odometry(rng, noise, u, start, count):
    """Table 5.6."""
    s1, st_, s2 = noise.sigmas(u)
    rot1 = u.rot1 + s1 * rng.standard_normal(count)
    trans = u.trans + st_ * rng.standard_normal(count)
    rot2 = u.rot2 + s2 * rng.standard_normal(count)
    heading = start[2] + rot1
    return np.stack(
        [start[0] + trans * np.cos(heading), start[1] + trans * np.sin(heading), heading + rot2], axis=1
    )


def coarse(space, poses, factor):
    """Fraction of the poses in blocks of factor x factor x factor cells."""
    inside = space.axes[0].contains(poses[:, 0]) & space.axes[1].contains(poses[:, 1])
    index = space.index(poses[inside]) // factor
    shape = [-(-n // factor) for n in space.shape]
    flat = np.ravel_multi_index(tuple(index.T), shape)
    return np.bincount(flat, minlength=math.prod(shape)).reshape(shape) / len(poses)


def blocks(belief, factor):
    x, y, h = belief.shape
    return belief.reshape(x // factor, factor, y // factor, factor, h // factor, factor).sum(axis=(1, 3, 5))


FINE = pose_grid((48, 48, 72), cell=0.1, origin=(-2.4, -2.4, -math.pi))
CENTRE = FINE.pose((24, 24, 40))


@pytest.mark.parametrize(
    ("u", "limit"),
    [
        (OdometryReading(rot1=0.7, trans=0.9, rot2=-0.4), 0.02),
        (OdometryReading(rot1=0.7, trans=0.1), 0.06),  # hardly beyond the first cell
    ],
)
def test_odometry_kernels_equal_samples_of_table_5_6(u, limit):
    noise = OdometryNoise(rotation=0.2, translation=0.25)
    sampled = coarse(FINE, sample_odometry(np.random.default_rng(4), noise, u, CENTRE, 400_000), 4)

    def distance(model):
        return np.abs(sampled - blocks(model.predict(FINE.point_mass(CENTRE), u), 4)).sum()

    assert distance(GaussianOdometry(FINE, noise)) < limit
    assert distance(TurnDriveTurn(space=FINE, noise=noise)) < limit
    # The book's product is no density over the end pose: without 1 / r it favours the distant.
    book = GaussianOdometry(FINE, noise, density="book")
    assert distance(book) > 5 * limit


def test_velocity_kernel_equals_samples_of_table_5_3():
    rng = np.random.default_rng(5)
    noise = VelocityNoise(speed=0.12, turning=0.3, final=0.15, alpha1=0.01, alpha4=0.01)
    command = VelocityCommand(speed=0.5, turning=0.8, duration=2.0)
    space = pose_grid((24, 24, 24), cell=0.15, origin=(-1.8, -1.8, -math.pi))
    start = space.pose((12, 9, 14))
    way, turn, final = noise.sigmas(command)
    count = 400_000
    s = 1.0 + way * rng.standard_normal(count)
    alpha = 1.6 + turn * rng.standard_normal(count)
    radius = s / alpha
    x = start[0] + radius * (np.sin(start[2] + alpha) - np.sin(start[2]))
    y = start[1] - radius * (np.cos(start[2] + alpha) - np.cos(start[2]))
    heading = start[2] + alpha + final * rng.standard_normal(count)
    sampled = coarse(space, np.stack([x, y, heading], axis=1), 4)
    belief = VelocityMotion(space=space, noise=noise).predict(space.point_mass(start), command)
    assert belief.sum() == pytest.approx(1.0, abs=0.02)
    assert np.abs(sampled - blocks(belief, 4)).sum() < 0.08
    # Backward, by symmetry: the mirror image in place, the same in turn.
    back = VelocityMotion(space=space, noise=noise).predict(
        space.point_mass(start), VelocityCommand(speed=-0.5, turning=-0.8, duration=2.0)
    )
    assert back.sum() == pytest.approx(1.0, abs=0.02)
    mean_x = (back.sum(axis=(1, 2)) @ space.axes[0].centres) - start[0]
    mean_y = (back.sum(axis=(0, 2)) @ space.axes[1].centres) - start[1]
    half = start[2] - 0.8 + math.pi
    assert math.atan2(mean_y, mean_x) == pytest.approx(math.remainder(half, 2 * math.pi), abs=0.05)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 99), quarter=st.integers(1, 3), trans=st.floats(-0.6, 0.9), rot1=st.floats(-3, 3))
def test_turning_the_world_by_quarters_turns_the_prediction(seed, quarter, trans, rot1):
    space = pose_grid((5, 5, 8), cell=0.4, origin=(-1.0, -1.0, -math.pi))
    noise = OdometryNoise(rotation=0.5, translation=0.3)
    u = OdometryReading(rot1=rot1, trans=trans, rot2=0.3)
    belief = np.random.default_rng(seed).dirichlet(np.ones(space.size)).reshape(space.shape)

    def turned(b):
        return np.roll(np.rot90(b, quarter, axes=(0, 1)), 2 * quarter, axis=2)

    for model in (GaussianOdometry(space, noise), GaussianOdometry(space, noise, density="book")):
        if model.density == "book":
            continue  # the book's direction of no displacement is 0, whatever the heading
        np.testing.assert_allclose(
            model.predict(turned(belief), u), turned(model.predict(belief, u)), atol=1e-14
        )
    three = TurnDriveTurn(space=space, noise=noise)
    np.testing.assert_allclose(three.predict(turned(belief), u), turned(three.predict(belief, u)), atol=1e-12)


def test_what_skipping_and_the_window_drop_is_reported_and_bounds_the_error():
    rng = np.random.default_rng(6)
    belief = rng.dirichlet(np.full(COURSE.size, 0.02)).reshape(COURSE.shape)
    u = OdometryReading(rot1=0.35, trans=0.55, rot2=-0.8)
    exact = GaussianOdometry(COURSE, COURSE_NOISE).predict(belief, u)
    skipping = GaussianOdometry(COURSE, COURSE_NOISE, skip_below=1e-4).predict_with_losses(belief, u)
    small = belief[belief < 1e-4].sum()
    assert 0 < small == pytest.approx(skipping.skipped)
    assert 0 < np.abs(exact - skipping.belief).sum() <= small
    for window in (1.0, 2.0, 3.0):
        cut = GaussianOdometry(COURSE, COURSE_NOISE, window=window).predict_with_losses(belief, u)
        missing = exact.sum() - cut.belief.sum()
        assert (cut.belief <= exact + 1e-15).all()
        # The bound is on the continuous kernel; on cells of 0.7 sigma the share moves by up to half a cell's.
        assert 0 < missing <= cut.truncated + 0.25 * (window < 1.5) + 0.05


def test_inverse_distance_equals_quadrature():
    steps = displacements((2, 1), (0.3, 0.3), rotation=0.4)
    for k in range(len(steps.distance)):
        width = math.sqrt(steps.area[k])
        dx, dy = (
            steps.distance[k] * math.cos(steps.direction[k]),
            steps.distance[k] * math.sin(steps.direction[k]),
        )
        assert steps.inverse_distance[k] == pytest.approx(mean_inverse_distance(dx, dy, width), rel=1e-8)
    assert steps.area.sum() == pytest.approx(15 * 0.09)


@given(st.floats(-30, 30), st.floats(0.05, 12))
def test_wrapped_normal_equals_the_sum_over_turns(angle, sigma):
    expected = sum(normal(angle + 2 * math.pi * k, sigma) for k in range(-40, 41))
    assert float(wrapped_normal(angle, sigma)) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_odometry_between_poses_inverts_the_motion():
    u = OdometryReading.between((1.0, 2.0, 3.0), (0.0, 1.0, -3.0))
    heading = 3.0 + u.rot1
    assert 1.0 + u.trans * math.cos(heading) == pytest.approx(0.0)
    assert 2.0 + u.trans * math.sin(heading) == pytest.approx(1.0)
    assert math.remainder(heading + u.rot2 + 3.0, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert OdometryReading.between((1.0, 1.0, 0.5), (1.0, 1.0, 1.0)) == OdometryReading(rot2=0.5)


def drive_wheels(space, cycles, commands, noise, start, free=None):
    model = DifferentialWheels(space=space, base=1.0, noise=noise, free=free)
    belief, carry = space.point_mass(start), model.at_rest()
    for cycle in range(cycles):
        belief, carry = model.predict(belief, commands(cycle), carry)
    return belief, carry


def test_wheels_without_noise_end_where_the_robot_does():
    space = pose_grid((60, 60, 36), cell=0.2, origin=(-6.0, -6.0, -math.pi))
    start = space.pose((20, 25, 19))

    def commands(cycle):
        return (0.1, 0.1) if cycle % 40 < 30 else (-0.05, 0.05)

    x, y, heading, left, right = *start, 0.0, 0.0
    for cycle in range(200):
        left, right = (0.5 * c + 0.5 * p for c, p in zip(commands(cycle), (left, right), strict=True))
        way = (left + right) / 2
        x, y, heading = x + way * math.cos(heading), y + way * math.sin(heading), heading + right - left
    belief, carry = drive_wheels(space, 200, commands, 0.0, start)
    assert belief.max() == pytest.approx(1.0)
    i, j, k = np.unravel_index(belief.argmax(), belief.shape)
    assert space.axes[0].centres[i] + carry.offset[k, 0] == pytest.approx(x, abs=1e-9)
    assert space.axes[1].centres[j] + carry.offset[k, 1] == pytest.approx(y, abs=1e-9)
    turn = math.remainder(space.axes[2].centres[k] + carry.turn - heading, 2 * math.pi)
    assert turn == pytest.approx(0.0, abs=1e-9)


def test_wheels_spread_as_samples_of_the_noisy_filter_do():
    rng = np.random.default_rng(7)
    space = pose_grid((80, 60, 120), cell=0.2, origin=(-2.0, -6.0, -math.pi))
    start = space.pose((10, 30, 60))
    count, cycles, noise = 20_000, 100, 0.05
    x, y, heading = (np.full(count, v) for v in start)
    left, right = np.zeros(count), np.zeros(count)
    for _ in range(cycles):
        left = (0.05 + 0.5 * left) * (1 + noise * rng.standard_normal(count))
        right = (0.05 + 0.5 * right) * (1 + noise * rng.standard_normal(count))
        way = (left + right) / 2
        x, y, heading = x + way * np.cos(heading), y + way * np.sin(heading), heading + right - left
    belief, carry = drive_wheels(space, cycles, lambda cycle: (0.1, 0.1), noise, start)
    weights = belief / belief.sum()
    along_x = weights.sum(axis=1)
    place_x = space.axes[0].centres[:, None] + carry.offset[:, 0]
    place_y = space.axes[1].centres[:, None] + carry.offset[:, 1]
    mean_x = (along_x * place_x).sum()
    spread_y = math.sqrt(
        (weights.sum(axis=0) * place_y**2).sum() - (weights.sum(axis=0) * place_y).sum() ** 2
    )
    turn = space.axes[2].centres + carry.turn
    marginal = weights.sum(axis=(0, 1))
    spread_turn = math.sqrt((marginal * turn**2).sum() - (marginal * turn).sum() ** 2)
    assert mean_x == pytest.approx(x.mean(), abs=0.08)
    assert spread_turn == pytest.approx(heading.std(), rel=0.05)
    assert spread_y == pytest.approx(y.std(), rel=0.10)


def test_wheels_at_a_wall_stay_and_turn():
    space = pose_grid((10, 10, 8), cell=0.2, origin=(0.0, 0.0, -math.pi))
    free = np.ones((10, 10), dtype=bool)
    free[6:] = False
    start = space.pose((3, 5, 4))
    belief, _ = drive_wheels(space, 60, lambda cycle: (0.1, 0.1), 0.05, start, free)
    assert belief.sum() == pytest.approx(1.0)
    assert belief[6:].sum() == 0.0
    assert belief[5, :, 3:6].sum() > 0.7
    assert belief[5, :, 5].sum() > 1e-6


@pytest.mark.parametrize(
    "make",
    [
        lambda: GaussianOdometry(COURSE, OdometryNoise(rotation=-1.0)),
        lambda: GaussianOdometry(COURSE, COURSE_NOISE, density="neither"),
        lambda: GaussianOdometry(COURSE, COURSE_NOISE, window=0.0),
        lambda: GaussianOdometry(COURSE, OdometryNoise(), density="pose").predict(
            COURSE.uniform(), OdometryReading()
        ),
        lambda: GaussianOdometry(COURSE, COURSE_NOISE).predict(-COURSE.uniform(), OdometryReading()),
        lambda: OdometryReading.between((0.0, 0.0, math.nan), (1.0, 0.0, 0.0)),
        lambda: GaussianOdometry(COURSE, COURSE_NOISE).predict(np.ones((2, 2, 2)), OdometryReading()),
        lambda: TurnDriveTurn(space=COURSE, noise=COURSE_NOISE, free=np.ones((3, 3), bool)),
        lambda: VelocityMotion(space=COURSE, noise=VelocityNoise()).kernel(
            VelocityCommand(speed=1.0, turning=0.0)
        ),
        lambda: VelocityCommand(speed=1.0, turning=0.0, duration=0.0),
        lambda: DifferentialWheels(space=COURSE, base=0.0),
        lambda: DifferentialWheels(space=COURSE, base=1.0, response=1.5),
    ],
    ids=itertools.count(),
)
def test_what_is_no_motion_is_refused(make):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        make()


def test_three_passes_equal_their_matrices_built_entry_by_entry():
    space = pose_grid((4, 5, 12), cell=0.5, origin=(0.0, 0.0, -math.pi))
    noise = OdometryNoise(rotation=0.4, translation=0.3)
    free = np.random.default_rng(8).random((4, 5)) < 0.8
    model = TurnDriveTurn(space=space, noise=noise, free=free, window=8.0)
    u = OdometryReading(rot1=0.9, trans=0.7, rot2=-0.5)
    cells = list(np.ndindex(*space.shape))
    first, drive, second = np.zeros((3, len(cells), len(cells)))
    width = space.axes[2].cell
    left = (
        u.rot1 - 2 * width
    )  # 0.9 is nearest to two cells of 0.52; the rest turns the ways, then the headings
    for a, (i, j, k) in enumerate(cells):
        for turn, target in ((2 * width, first), (u.rot2 + left, second)):
            # A Gaussian of 0.58 cells variance: three points with its mean and second moment.
            mean, variance = turn / width, (0.4 / width) ** 2
            nearest, rest = round(mean), mean - round(mean)
            assert 0.25 < variance < 0.75
            for step, weight in (
                (-1, (variance + rest * rest - rest) / 2),
                (0, 1 - variance - rest * rest),
                (1, (variance + rest * rest + rest) / 2),
            ):
                target[a, cells.index((i, j, (k + nearest + step) % 12))] += weight
        heading = space.axes[2].centres[k] + left
        along = np.array([math.cos(heading), math.sin(heading)])
        kernel = lattice_kernels(
            0.7 / 0.5 * along[np.newaxis], 0.36 * np.outer(along, along)[np.newaxis], reach=(3, 4)
        )
        for (di, dj), weight in zip(kernel.cells, kernel.weights, strict=True):
            at = i + di, j + dj
            if 0 <= at[0] < 4 and 0 <= at[1] < 5 and free[at]:
                drive[a, cells.index((*at, k))] += weight
    ours = transition_matrix(model.predict, space.shape, u)
    np.testing.assert_allclose(ours, first @ drive @ second, atol=1e-12)


def test_velocity_kernel_has_the_formulas_value_for_each_pair_of_cells():
    space = pose_grid((4, 4, 10), cell=0.5, origin=(0.0, 0.0, -math.pi))
    noise = VelocityNoise(speed=0.3, turning=0.8, final=0.5)
    command = VelocityCommand(speed=0.6, turning=-0.7, duration=1.5)
    way_sigma, turn_sigma, final_sigma = 0.45, 1.2, 0.75
    model = VelocityMotion(space=space, noise=noise, density=True)
    ours = transition_matrix(model.predict, space.shape, command)
    cells = list(np.ndindex(*space.shape))
    for start in (cells[0], cells[77], cells[121]):
        x0, y0, t0 = space.pose(start)
        for end in cells[::3]:
            x1, y1, t1 = space.pose(end)
            away = math.hypot(x1 - x0, y1 - y0)
            n = 4 if away == 0 else min(8, math.ceil(0.5 / (1.4 * 0.6 * away) - 1e-9))
            total = 0.0
            for a in range(n):
                for b in range(n):
                    dx = x1 - x0 + ((a + 0.5) / n - 0.5) * 0.5
                    dy = y1 - y0 + ((b + 0.5) / n - 0.5) * 0.5
                    for sign in (1, -1):
                        beta = math.remainder(math.atan2(sign * dy, sign * dx) - t0, 2 * math.pi)
                        stretch = beta / math.sin(beta) if beta else 1.0
                        arc = sign * math.hypot(dx, dy) * stretch
                        p = normal(arc - 0.9, way_sigma) * normal(2 * beta + 1.05, turn_sigma)
                        p *= wound(t1 - t0 - 2 * beta, final_sigma)
                        total += p * 2 * stretch * mean_inverse_distance(dx, dy, 0.5 / n)
            expected = total * 2 * math.pi / 10
            assert ours[cells.index(start), cells.index(end)] == pytest.approx(expected, rel=1e-7, abs=1e-12)
