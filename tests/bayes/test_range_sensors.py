"""Beams, likelihood fields, landmarks and maps: against plain formulas, walks and samples."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ciberrato.bayes import update
from ciberrato.bayes.maps.occupancy import OccupancyGrid
from ciberrato.bayes.maps.segments import SegmentMap
from ciberrato.bayes.sensors.beam import BeamModel
from ciberrato.bayes.sensors.beam_learning import learn_beam_model
from ciberrato.bayes.sensors.detector import DiscreteSensor, DoorDetector
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.bayes.sensors.landmarks import LandmarkSensor, OrderedRanges
from ciberrato.bayes.sensors.likelihood_field import LikelihoodField
from ciberrato.bayes.sensors.scan_table import ScanTable
from ciberrato.bayes.spaces import line, pose_grid

BEAM = BeamModel(
    hit=0.7, short=0.15, longest=0.05, random=0.1, sigma=0.2, decay=0.4, max_range=8.0, resolution=0.05
)  # fmt: skip


def table_6_1(z, expected, m):
    """Eq. 6.4 to 6.12 with plain mathematics."""
    phi = stats.norm(expected, m.sigma)
    eta = phi.cdf(m.max_range) - phi.cdf(0.0)
    hit = phi.pdf(z) / eta
    short = m.decay * math.exp(-m.decay * z) / (1 - math.exp(-m.decay * expected)) if z <= expected else 0.0
    density = m.hit * hit + m.short * short + m.random / m.max_range
    return density * m.resolution + (m.longest if z >= m.max_range else 0.0)


@given(st.floats(0, 8), st.floats(0.05, 8))
def test_beam_equals_the_books_equations(z, expected):
    assert float(BEAM.beam_log_likelihood(z, expected)) == pytest.approx(
        math.log(table_6_1(z, expected, BEAM)), rel=1e-9
    )


@pytest.mark.parametrize("expected", [0.3, 2.0, 7.9, 8.0, 30.0])
def test_beam_probabilities_sum_to_one_over_all_readings(expected):
    steps = 160_000
    z = (np.arange(steps) + 0.5) * (8.0 / steps)
    below = BEAM.parts(z, expected)[[0, 1, 3]].sum() / BEAM.resolution * (8.0 / steps)
    assert below + BEAM.parts(8.0, expected)[2] == pytest.approx(1.0, abs=1e-5)


def test_beam_samples_have_the_models_distribution():
    rng = np.random.default_rng(1)
    samples = BEAM.sample(np.full(200_000, 3.0), rng)
    edges = np.linspace(0.0, 8.0, 41)
    counts = np.histogram(samples[samples < 8.0], edges)[0]
    fine = (np.arange(8000) + 0.5) * 0.001
    parts = BEAM.parts(fine, 3.0)[[0, 1, 3]].sum(axis=0) / BEAM.resolution * 0.001
    expected = 200_000 * parts.reshape(40, 200).sum(axis=1)
    assert stats.chi2.sf(((counts - expected) ** 2 / expected).sum(), 39) > 1e-3
    assert (samples == 8.0).mean() == pytest.approx(0.05, abs=0.003)


def test_a_scan_of_180_tiny_probabilities_does_not_underflow():
    rng = np.random.default_rng(2)
    sharp = BeamModel(
        hit=0.999,
        short=0.0,
        longest=0.0005,
        random=0.0005,
        sigma=0.01,
        decay=1.0,
        max_range=30.0,
        resolution=1e-3,
    )
    expected = rng.uniform(1, 20, (50, 180))
    scan = expected[17] + 0.005 * rng.standard_normal(180)
    scores = sharp.log_likelihood(scan, expected)
    assert scores[16] < -2500  # far below the smallest float, e^-745
    posterior, log_evidence = update(np.full(50, 0.02), scores)
    assert posterior[17] == pytest.approx(1.0)
    assert log_evidence == pytest.approx(scores[17] - math.log(50))
    exact = sum(math.log(table_6_1(z, e, sharp)) for z, e in zip(scan, expected[16], strict=True))
    assert scores[16] == pytest.approx(exact, rel=1e-9)


def test_missing_beams_say_nothing():
    expected = np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 2.0]])
    two = BEAM.log_likelihood([1.0, 3.0], expected[:, [0, 2]])
    np.testing.assert_allclose(BEAM.log_likelihood([1.0, np.nan, 3.0], expected), two)


def test_learning_finds_the_parameters_that_made_the_readings():
    rng = np.random.default_rng(3)
    expected = rng.uniform(0.5, 7.5, 60_000)
    guess = BeamModel(
        hit=0.25, short=0.25, longest=0.25, random=0.25, sigma=1.0, decay=2.0, max_range=8.0, resolution=0.05
    )
    learned = learn_beam_model(BEAM.sample(expected, rng), expected, guess)
    assert (np.diff(learned.log_likelihood) > -1e-9).all()
    for name, tolerance in (("hit", 0.01), ("short", 0.015), ("longest", 0.003), ("random", 0.015)):
        assert getattr(learned.model, name) == pytest.approx(getattr(BEAM, name), abs=tolerance)
    assert learned.model.sigma == pytest.approx(0.2, rel=0.02)
    assert learned.model.decay == pytest.approx(0.4, rel=0.15)


def test_likelihood_field_equals_table_6_3():
    rng = np.random.default_rng(4)
    occupied = rng.random((12, 15)) < 0.1
    grid = OccupancyGrid(occupied=occupied, cell=0.5, origin=(-1.0, 2.0))
    field = grid.distance_field()
    full = np.argwhere(occupied)
    for i, j in np.ndindex(12, 15):
        assert field[i, j] == pytest.approx(0.5 * np.hypot(*(full - (i, j)).T).min())
    model = LikelihoodField(hit=0.8, random=0.2, sigma=0.3, max_range=5.0)
    poses = np.stack([rng.uniform(0, 3, 20), rng.uniform(3, 8, 20), rng.uniform(-4, 4, 20)], axis=1)
    scan, angles = np.array([1.0, 2.5, 5.0, np.nan, 0.7]), np.array([-1.0, 0.0, 0.5, 1.0, 2.0])
    ours = model.log_likelihood(scan, angles, poses, field, grid)
    for pose, value in zip(poses, ours, strict=True):
        expected = 0.0
        for z, angle in zip(scan, angles, strict=True):
            if z < 5.0:
                x, y = pose[0] + z * math.cos(pose[2] + angle), pose[1] + z * math.sin(pose[2] + angle)
                i = min(max(math.floor((x + 1.0) / 0.5), 0), 11)
                j = min(max(math.floor((y - 2.0) / 0.5), 0), 14)
                nearest = 0.5 * min(math.hypot(i - a, j - b) for a, b in full)
                expected += math.log(0.8 * stats.norm.pdf(nearest, 0, 0.3) + 0.2 / 5.0)
        assert value == pytest.approx(expected, rel=1e-9)


def walk(occupied, cell, x, y, angle, limit):
    """Range by tiny steps: no cleverness to get wrong."""
    step = cell / 400
    for k in range(int(limit / step) + 1):
        i = math.floor((x + k * step * math.cos(angle)) / cell)
        j = math.floor((y + k * step * math.sin(angle)) / cell)
        if 0 <= i < occupied.shape[0] and 0 <= j < occupied.shape[1] and occupied[i, j]:
            return k * step
    return limit


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 999), st.floats(0.0, 0.3))
def test_rays_in_a_grid_equal_a_walk_by_small_steps(seed, density):
    rng = np.random.default_rng(seed)
    occupied = rng.random((14, 11)) < density
    grid = OccupancyGrid(occupied=occupied, cell=0.5)
    x, y, angle = rng.uniform(-2, 9, 12), rng.uniform(-2, 7, 12), rng.uniform(-7, 7, 12)
    ours = grid.cast(x, y, angle, 6.0)
    for k in range(12):
        walked = walk(occupied, 0.5, x[k], y[k], angle[k], 6.0)
        # The walk may step over a corner that the ray cuts.
        assert ours[k] <= walked + 1e-9
        beyond = ours[k] + 1e-9
        if ours[k] < min(walked - 0.5 / 400 - 1e-9, 6.0):
            end = (x[k] + beyond * math.cos(angle[k])) / 0.5, (y[k] + beyond * math.sin(angle[k])) / 0.5
            assert occupied[math.floor(end[0]), math.floor(end[1])]


def test_rays_along_the_axes_and_from_inside():
    occupied = np.zeros((6, 6), dtype=bool)
    occupied[4, 2] = True
    grid = OccupancyGrid(occupied=occupied, cell=2.0, origin=(10.0, 0.0))
    assert grid.cast(11.0, 5.0, 0.0, 99.0) == pytest.approx(7.0)
    assert grid.cast(19.0, 11.0, -math.pi / 2, 99.0) == pytest.approx(5.0)
    assert grid.cast(19.0, 5.0, 1.0, 99.0) == 0.0
    assert grid.cast(25.0, 5.0, math.pi, 99.0) == pytest.approx(5.0)
    assert grid.cast(11.0, 7.0, 0.0, 99.0) == 99.0
    assert grid.cast(11.0, 5.0, 0.0, 3.0) == 3.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 999))
def test_rays_to_segments_equal_the_crossing_found_by_solving(seed):
    rng = np.random.default_rng(seed)
    segments = rng.uniform(-3, 3, (5, 4))
    x, y, angle = rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-4, 4)
    expected = 9.0
    for ax, ay, bx, by in segments:
        t, s = np.linalg.solve([[math.cos(angle), ax - bx], [math.sin(angle), ay - by]], [ax - x, ay - y])
        if t >= 0 and 0 <= s <= 1:
            expected = min(expected, t)
    assert float(SegmentMap(segments).cast(x, y, angle, 9.0)) == pytest.approx(expected, rel=1e-9)


def test_rays_see_a_closed_room_from_everywhere():
    room = SegmentMap(np.array([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]], dtype=float))
    corners = np.arctan2([-1, -1, 2, 2], [-1, 3, -1, 3])
    ranges = room.cast(1.0, 1.0, np.concatenate([np.linspace(-4, 4, 1000), corners]))
    assert np.isfinite(ranges).all()
    np.testing.assert_allclose(ranges[-4:], np.hypot([-1, 3, -1, 3], [-1, -1, 2, 2]))


def test_scan_table_equals_the_beam_model_state_by_state():
    rng = np.random.default_rng(6)
    occupied = np.zeros((12, 10), dtype=bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = occupied[5, 3:6] = True
    grid = OccupancyGrid(occupied=occupied, cell=0.5)
    space = pose_grid((12, 10, 24), cell=0.5)
    for beams, spacing in ((7, 2), (4, 1)):
        table = ScanTable(space, ~occupied, grid.cast, beams=beams, spacing=spacing, max_range=8.0)
        truth = (2.3, 3.2, 0.4)
        scan = BEAM.sample(grid.cast(truth[0], truth[1], truth[2] + table.angles, 8.0), rng)
        scan[1] = np.nan
        ours = table.log_likelihood(scan, BEAM.beam_log_likelihood, weight=0.5)
        assert (ours[occupied] == -np.inf).all()
        for index in rng.permutation(np.argwhere(np.repeat(~occupied[:, :, None], 24, axis=2)))[:60]:
            x, y, heading = space.pose(index)
            ranges = grid.cast(x, y, heading + table.angles, 8.0)
            nearest = table.levels[np.abs(table.levels[:, None] - ranges).argmin(axis=0)]
            expected = 0.5 * BEAM.log_likelihood(scan, nearest)
            assert ours[tuple(index)] == pytest.approx(expected, abs=1e-3)
            assert np.abs(nearest - ranges).max() <= 4.0 / 255 + 1e-9


def test_gaussian_beams_equal_scipys_densities():
    rng = np.random.default_rng(5)
    mean, sigma = rng.uniform(0, 5, (4, 3, 6)), rng.uniform(0.1, 1, (4, 3, 6))
    reading = rng.uniform(0, 5, 6)
    ours = GaussianSensor(sigma=sigma).log_likelihood(reading, mean)
    np.testing.assert_allclose(ours, stats.norm.logpdf(reading, mean, sigma).sum(axis=-1))
    bare = GaussianSensor(sigma=0.5, normalized=False).log_likelihood(reading, mean)
    full = GaussianSensor(sigma=0.5).log_likelihood(reading, mean)
    np.testing.assert_allclose(bare - full, 6 * math.log(0.5 * math.sqrt(2 * math.pi)))
    for model in (
        GaussianSensor(sigma=sigma),
        GaussianSensor(sigma=0.01),
        GaussianSensor(sigma=0.5, normalized=False),
    ):
        prepared = model.prepare(mean)
        np.testing.assert_allclose(
            prepared.log_likelihood(reading), model.log_likelihood(reading, mean), rtol=1e-9
        )
    with pytest.raises(ValueError, match="6 finite beams"):
        prepared.log_likelihood(np.append(reading[:5], np.nan))
    mean[0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="must be finite"):
        GaussianSensor(sigma=0.5).prepare(mean)
    with pytest.raises(ValueError, match=r"map is nan at \(0, 0, 0\)"):
        GaussianSensor(sigma=0.5).log_likelihood(reading, mean)


def test_discrete_sensor_and_door_detector():
    sensor = DiscreteSensor(probabilities={"wall": np.array([0.9, 0.0]), "gap": np.array([0.1, 1.0])})
    np.testing.assert_allclose(np.exp(sensor.log_likelihood("wall")), [0.9, 0.0])
    axis = line(170, cell=5.0, periodic=True).axes[0]
    detector = DoorDetector(doors=(222.0, 849.0), sigma=22.5, seen=0.9, false_alarm=0.05)
    seen, unseen = np.exp(detector.log_likelihood(True, axis)), np.exp(detector.log_likelihood(False, axis))
    np.testing.assert_allclose(seen + unseen, 1.0)
    for k, x in enumerate(axis.centres):
        d = min(min(abs(x - m), 850 - abs(x - m)) for m in (222.0, 849.0))
        assert seen[k] == pytest.approx(0.05 + 0.85 * math.exp(-0.5 * (d / 22.5) ** 2))
    certain = DoorDetector(doors=(0.0,), sigma=1.0).log_likelihood(True, axis, [0.0, 400.0])
    assert certain[0] == 0.0
    assert certain[1] == -0.5 * 400.0**2  # not -inf: only ratios count


def test_landmark_ranges_and_bearings_equal_plain_formulas():
    sensor = LandmarkSensor(landmarks=((0.0, 4.0), (5.0, 1.0)), range_sigma=0.3, bearing_sigma=0.1)
    pose = (1.0, 2.0, 3.0)
    r = math.hypot(4.0, -1.0)
    b = math.atan2(-1.0, 4.0) - 3.0
    ours = sensor.log_likelihood(pose, [1, 0], [r + 0.2, 2.0], [b - 0.15 + 2 * math.pi, 0.0])
    expected = stats.norm.logpdf(0.2, 0, 0.3) + stats.norm.logpdf(2.0 - math.hypot(-1, 2), 0, 0.3)
    expected += stats.norm.logpdf(-0.15, 0, 0.1)
    expected += stats.norm.logpdf(math.remainder(-(math.atan2(2.0, -1.0) - 3.0), 2 * math.pi), 0, 0.1)
    assert float(ours) == pytest.approx(expected)


def test_ordered_ranges_match_nearest_with_nearest_and_count_what_is_left():
    sensor = OrderedRanges(
        landmarks=(31.0, 9.0, 25.0), sigma=0.5, max_range=20.0, unread=0.1, unexpected=0.01
    )
    places = np.array([5.0, 12.0, 24.0, 40.0])
    ours = sensor.log_likelihood([14.0, 19.5], places)
    log = stats.norm.logpdf
    np.testing.assert_allclose(
        ours,
        [
            2 * math.log(0.9) + log(14.0, 4.0, 0.5) + log(19.5, 20.0, 0.5),
            2 * math.log(0.9) + log(14.0, 13.0, 0.5) + log(19.5, 19.0, 0.5),
            2 * math.log(0.9) + log(14.0, 1.0, 0.5) + log(19.5, 7.0, 0.5),
            2 * math.log(0.01),
        ],
    )
    strict = OrderedRanges(landmarks=(9.0, 25.0), sigma=0.5, max_range=20.0)
    assert strict.log_likelihood([], [0.0, 6.0, 30.0]).tolist() == [-np.inf, -np.inf, 0.0]


@pytest.mark.parametrize(
    "make",
    [
        lambda: BeamModel(hit=0.5, short=0.5, longest=0.5, random=0.5, sigma=1, decay=1, max_range=1),
        lambda: BeamModel(hit=1.2, short=-0.2, longest=0, random=0, sigma=1, decay=1, max_range=1),
        lambda: BeamModel(hit=1, short=0, longest=0, random=0, sigma=0, decay=1, max_range=1),
        lambda: learn_beam_model([], [], BEAM),
        lambda: LikelihoodField(hit=0.5, random=0.4, sigma=1, max_range=1),
        lambda: GaussianSensor(sigma=0.0),
        lambda: DiscreteSensor(probabilities={"a": np.array([0.5]), "b": np.array([0.6])}),
        lambda: DoorDetector(doors=(), sigma=1.0),
        lambda: DoorDetector(doors=(1.0,), sigma=1.0, seen=0.1, false_alarm=0.2),
        lambda: LandmarkSensor(landmarks=(), range_sigma=1.0),
        lambda: OrderedRanges(landmarks=(1.0,), sigma=1.0, max_range=1.0, unread=1.0),
        lambda: SegmentMap(np.zeros((0, 4))),
        lambda: OccupancyGrid(occupied=np.zeros(3), cell=1.0),
    ],
    ids=itertools.count(),
)
def test_impossible_parameters_are_refused(make):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        make()
