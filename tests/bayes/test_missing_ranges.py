"""One rule for ranges in all sensors, maps with unknown cells, and angles: each against a second method."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.special import logsumexp

from ciberrato.bayes.angles import log_wrapped_normal, wrapped_normal
from ciberrato.bayes.maps.occupancy import OccupancyGrid
from ciberrato.bayes.sensors.angle import AngleSensor
from ciberrato.bayes.sensors.beam import BeamModel
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.bayes.sensors.landmarks import LandmarkSensor, OrderedRanges
from ciberrato.bayes.sensors.likelihood_field import LikelihoodField
from ciberrato.bayes.sensors.quantized_gaussian import QuantizedGaussian
from ciberrato.bayes.sensors.scan_table import ScanTable
from ciberrato.bayes.spaces import Axis, pose_grid

BEAM = BeamModel(hit=0.7, short=0.1, longest=0.1, random=0.1, sigma=0.1, decay=1.0, max_range=4.0)
MEAN = np.array([[1.0, 2.0], [3.0, 4.0], [1.5, 2.5]])
GRID = OccupancyGrid(occupied=np.eye(10, dtype=bool), cell=0.1)
ROOM = np.pad(np.zeros((6, 6), dtype=bool), 1, constant_values=True)
TABLE = ScanTable(
    pose_grid((8, 8, 8), cell=0.5),
    ~ROOM,
    OccupancyGrid(occupied=ROOM, cell=0.5).cast,
    beams=2,
    spacing=1,
    max_range=4.0,
)
POSES = [[0.05, 0.5, 0.0], [0.3, 0.4, 2.0]]
# Two ranges; each sensor has a longest range.
SENSORS = {
    "gaussian": lambda z: GaussianSensor(sigma=0.3, max_range=5.0).log_likelihood(z, MEAN),
    "signed gaussian": lambda z: GaussianSensor(sigma=0.3, max_range=5.0, signed=True).log_likelihood(
        z, MEAN
    ),
    "quantized": lambda z: QuantizedGaussian(sigma=0.3, step=0.1, max_range=5.0).log_likelihood(z, MEAN),
    "beam": lambda z: BEAM.log_likelihood(z, MEAN),
    "table": lambda z: TABLE.log_likelihood(z, BEAM.beam_log_likelihood),
    "field": lambda z: LikelihoodField(hit=0.9, random=0.1, sigma=0.1, max_range=5.0).log_likelihood(
        z, [0.0, 0.1], POSES, GRID.distance_field(), GRID
    ),
    "landmarks": lambda z: LandmarkSensor(
        landmarks=((0.0, 0.0), (1.0, 1.0)), range_sigma=0.1, max_range=5.0
    ).log_likelihood([[0.0, 0.2], [3.0, 1.0]], [0, 1], z),
    "ordered": lambda z: OrderedRanges(
        landmarks=(3.0, 5.0), sigma=0.3, max_range=9.0, unread=0.1, unexpected=0.01
    ).log_likelihood(z, [0.0, 1.0, 4.0, 9.0]),
}


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("reading", [[np.nan, 2.0], [2.0, np.inf], [np.nan, np.nan], [np.inf, np.inf]])
def test_missing_and_endless_ranges_are_taken_by_all_sensors(name, reading):
    result = SENSORS[name](reading)
    assert not np.isnan(result).any()
    assert (result < np.inf).all()
    assert np.isfinite(result).any()
    if np.isnan(reading).all() and name != "ordered":
        assert (result[np.isfinite(result)] == 0.0).all()  # no reading says nothing


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("wrong", [-np.inf, -1.0, -1e-9])
def test_negative_ranges_are_refused_by_all_sensors_with_beam_and_value(name, wrong):
    if name == "signed gaussian" and wrong > -np.inf:
        assert np.isfinite(SENSORS[name]([2.0, wrong])).all()
        return
    with pytest.raises(ValueError, match=rf"\w+ 1 reads {wrong}"):
        SENSORS[name]([2.0, wrong])


@pytest.mark.parametrize("name", sorted(set(SENSORS) - {"ordered"}))
def test_more_or_fewer_ranges_than_beams_are_refused_by_all_sensors(name):
    for reading in ([2.0], [2.0, 2.0, 2.0], 2.0):
        with pytest.raises(ValueError, match=r"shape|agree"):
            SENSORS[name](reading)


@pytest.mark.parametrize(
    "function",
    [
        lambda m: GaussianSensor(sigma=0.3).log_likelihood([1.0, 2.0], m),
        lambda m: GaussianSensor(sigma=0.3).log_likelihood([1.0, np.nan], m),
        lambda m: QuantizedGaussian(sigma=0.3, step=0.1).log_likelihood([1.0, 2.0], m),
        lambda m: BEAM.log_likelihood([1.0, 2.0], m),
        lambda m: BEAM.sample(m, np.random.default_rng(1)),
    ],
    ids=itertools.count(),
)
def test_nan_in_the_map_is_named(function):
    with pytest.raises(ValueError, match=r"map is nan at \(1, 1\)"):
        function(np.where(MEAN == 4.0, np.nan, MEAN))


@pytest.mark.parametrize("sensor", [GaussianSensor(sigma=0.3), QuantizedGaussian(sigma=0.3, step=0.1)])
def test_expected_readings_below_zero_are_named_unless_readings_may_be_negative(sensor):
    # -1 for "nothing", or headings: a Gaussian on them was taken, and is wrong across the half turn.
    mean = np.where(MEAN == 4.0, -1.0, MEAN)
    message = r"map is -1\.0 at \(1, 1\) of shape \(3, 2\): .*signed=True, for angles take AngleSensor"
    for reading in ([1.0, 2.0], [np.nan, 2.0], [1.0, np.nan]):
        with pytest.raises(ValueError, match=message):
            sensor.log_likelihood(reading, mean)
    if isinstance(sensor, GaussianSensor):
        with pytest.raises(ValueError, match=message):
            sensor.prepare(mean)
    free = dataclasses.replace(sensor, signed=True).log_likelihood([1.0, 2.0], mean)
    shifted = dataclasses.replace(sensor, signed=True).log_likelihood([3.0, 4.0], mean + 2.0)
    np.testing.assert_allclose(free, shifted, rtol=1e-9)


def test_a_range_beyond_the_longest_has_the_gaussians_tail():
    expected = stats.norm.logsf(5.0, MEAN[:, 0], 0.3) + stats.norm.logpdf(2.0, MEAN[:, 1], 0.3)
    for reading in (np.inf, 5.0, 7.0):
        ours = GaussianSensor(sigma=0.3, max_range=5.0).log_likelihood([reading, 2.0], MEAN)
        np.testing.assert_allclose(ours, expected, rtol=1e-12)
        np.testing.assert_allclose(
            QuantizedGaussian(sigma=0.3, step=0.1, max_range=5.0).beam_log_likelihood(reading, MEAN),
            stats.norm.logsf(5.0, MEAN, 0.3),
            rtol=1e-12,
        )
    exact = QuantizedGaussian(sigma=0.0, step=0.1, max_range=2.5)
    assert exact.beam_log_likelihood(np.inf, [2.4, 2.5, np.inf]).tolist() == [-np.inf, 0.0, 0.0]
    landmark = LandmarkSensor(landmarks=((3.0, 4.0),), range_sigma=0.5, max_range=4.0)
    assert landmark.log_likelihood([0.0, 0.0], [0], [np.inf]) == pytest.approx(
        stats.norm.logsf(4.0, 5.0, 0.5), rel=1e-12
    )
    # Where nothing is expected, nothing is certain.
    nothing = GaussianSensor(sigma=0.3, max_range=5.0).log_likelihood([np.inf], [[np.inf]])
    assert nothing[0] == pytest.approx(0.0, abs=1e-300)
    for sensor in (
        lambda: GaussianSensor(sigma=0.3).log_likelihood([1.0, np.inf], MEAN),
        lambda: QuantizedGaussian(sigma=0.3, step=0.1).log_likelihood([1.0, np.inf], MEAN),
        lambda: LandmarkSensor(landmarks=((3.0, 4.0),), range_sigma=0.5).log_likelihood(
            [0.0, 0.0], [0, 0], [1.0, np.inf]
        ),
    ):
        with pytest.raises(ValueError, match=r"(beam|range) 1 (reads|is) inf.*max_range"):
            sensor()
    prepared = GaussianSensor(sigma=0.3, max_range=5.0).prepare(MEAN)
    for reading in ([1.0, np.inf], [1.0, 5.0]):
        with pytest.raises(ValueError, match=r"beam 1 reads .*log_likelihood"):
            prepared.log_likelihood(reading)


def test_readings_with_a_longest_range_have_probabilities_that_sum_to_one():
    model = QuantizedGaussian(sigma=0.3, step=0.1, max_range=2.0, signed=True)
    below = np.arange(-30, 20) * 0.1
    for mean in (0.3, 1.9, 2.6):
        # The last interval is cut at most range, half a step above its middle.
        total = np.exp(model.beam_log_likelihood(below, mean)).sum()
        rest = stats.norm.cdf(2.0, mean, 0.3) - stats.norm.cdf(1.95, mean, 0.3)
        assert total + rest + np.exp(model.beam_log_likelihood(np.inf, mean)) == pytest.approx(1.0, abs=1e-12)


def test_without_a_random_part_hits_far_off_are_told_apart():
    # 40 and 50 sigmas: an exponential would be zero for both.
    beam = BeamModel(hit=1.0, short=0.0, longest=0.0, random=0.0, sigma=0.01, decay=1.0, max_range=9.0)
    ours = beam.beam_log_likelihood(1.0, [1.4, 1.5])
    np.testing.assert_allclose(ours, stats.norm.logpdf(1.0, [1.4, 1.5], 0.01) + math.log(0.01), rtol=1e-12)
    mixed = BeamModel(hit=0.5, short=0.5, longest=0.0, random=0.0, sigma=0.01, decay=1.0, max_range=9.0)
    exact = math.log(0.5) + stats.norm.logpdf(2.0, [1.4, 1.5], 0.01) + math.log(0.01)
    np.testing.assert_allclose(mixed.beam_log_likelihood(2.0, [1.4, 1.5]), exact, rtol=1e-12)
    field = LikelihoodField(hit=1.0, random=0.0, sigma=0.01, max_range=5.0)
    wall = OccupancyGrid(occupied=np.arange(30)[:, np.newaxis] == 29, cell=0.1)
    far = field.log_likelihood(
        [0.1], [0.0], [[0.05, 0.05, 0.0], [0.25, 0.05, 0.0]], wall.distance_field(), wall
    )
    np.testing.assert_allclose(far, stats.norm.logpdf([2.8, 2.6], 0.0, 0.01), rtol=1e-9)


@given(st.integers(0, 10**6), st.integers(0, 3), st.integers(0, 3))
def test_gaps_in_ordered_ranges_may_be_any_landmarks(seed, count, gaps):
    rng = np.random.default_rng(seed)
    landmarks, seen = np.sort(rng.uniform(0, 9, 4)), np.sort(rng.uniform(0, 9, count))
    sensor = OrderedRanges(landmarks=tuple(landmarks), sigma=0.5, max_range=6.0, unread=0.2, unexpected=0.05)
    place = rng.uniform(0, 8)
    ours = sensor.log_likelihood(rng.permutation(np.append(seen, [np.nan] * gaps)), [place])[0]
    ahead = [m - place for m in landmarks if 0 <= m - place <= 6.0]
    used = ahead[: count + gaps]
    matched = min(count, len(used))
    choices = [
        sum(stats.norm.logpdf(z, d, 0.5) for z, d in zip(seen, chosen, strict=False))
        for chosen in itertools.combinations(used, matched)
    ]
    if not gaps:
        assert len(choices) == 1 or count < len(ahead)
    expected = logsumexp(choices) + matched * math.log(0.8)
    expected += (len(ahead) - len(used)) * math.log(0.2) + (count - matched) * math.log(0.05)
    assert ours == pytest.approx(expected, rel=1e-9)


def test_a_landmark_that_is_none_is_refused():
    sensor = LandmarkSensor(landmarks=((0.0, 0.0), (1.0, 1.0)), range_sigma=0.1)
    for which, ranges, words in (
        ([-1], [1.0], "no landmark -1"),
        ([2], [1.0], "no landmark 2"),
        ([0.5], [1.0], "whole numbers"),
        ([0], [0.5, 0.7], "agree"),
        ([0, 1], [0.5], "agree"),
    ):
        with pytest.raises(ValueError, match=words):
            sensor.log_likelihood([[0.0, 0.0]], which, ranges)
    with pytest.raises(ValueError, match="agree"):
        sensor.log_likelihood([[0.0, 0.0, 0.0]], [0, 1], [1.0, 1.0], [0.1])
    with pytest.raises(ValueError, match="heading"):
        sensor.log_likelihood([[0.0, 0.0]], [0], [1.0], [0.1])
    with pytest.raises(ValueError, match="poses must be finite"):
        sensor.log_likelihood([[0.0, np.nan]], [0], [1.0])
    assert sensor.log_likelihood([[0.0, 0.0]], [np.int8(1)], [1.0]) == sensor.log_likelihood(
        [[0.0, 0.0]], [1.0], [1.0]
    )


def test_bearings_on_the_landmark_are_all_alike():
    sensor = LandmarkSensor(landmarks=((0.3, 1.0),), range_sigma=0.3, bearing_sigma=math.radians(10))
    ranges_only = sensor.log_likelihood([0.3, 1.0], [0], [0.1])
    # 0.1 + 0.2 is not 0.3: rounding must not make up a bearing.
    for pose in ([0.3, 1.0, 0.4], [0.1 + 0.2, 1.0, -3.0]):
        for bearing in np.radians([0.0, 90.0, 180.0, 271.0]):
            ours = sensor.log_likelihood(pose, [0], [0.1], [bearing])
            assert ours == pytest.approx(ranges_only - math.log(2 * math.pi), rel=1e-12)
    beside = sensor.log_likelihood([0.2, 1.0, 0.0], [0], [0.1], [0.0])
    assert beside == pytest.approx(stats.norm.logpdf(0.0, 0, 0.3) + stats.norm.logpdf(0, 0, math.radians(10)))
    missing = sensor.log_likelihood([0.2, 1.0, 0.0], [0], [0.1], [np.nan])
    assert missing == sensor.log_likelihood([0.2, 1.0], [0], [0.1])
    only_bearing = sensor.log_likelihood([0.2, 1.0, 0.0], [0], [np.nan], [0.1])
    assert only_bearing == pytest.approx(stats.norm.logpdf(0.1, 0, math.radians(10)))
    in_degrees = sensor.log_likelihood([0.2, 1.0, 30.0], [0], [0.1], [-25.0], deg=True)
    assert in_degrees == pytest.approx(
        sensor.log_likelihood([0.2, 1.0, math.radians(30)], [0], [0.1], [math.radians(-25)])
    )


@given(st.floats(-20, 20), st.floats(0.01, 9.0))
def test_the_wound_normals_logarithm_equals_the_sum_over_turns(angle, sigma):
    turns = 2 * math.pi * np.arange(-60, 61)
    expected = logsumexp(stats.norm.logpdf(angle + turns, 0.0, sigma))
    assert float(log_wrapped_normal(angle, sigma)) == pytest.approx(expected, rel=1e-11, abs=1e-11)
    assert float(log_wrapped_normal([angle], [[sigma], [2.0]])[0, 0]) == pytest.approx(
        expected, rel=1e-11, abs=1e-11
    )
    if expected > -600:
        assert float(wrapped_normal(angle, sigma)) == pytest.approx(math.exp(expected), rel=1e-9, abs=1e-14)


def test_a_compass_is_right_across_the_half_turn():
    headings = Axis(name="heading", size=180, cell=np.pi / 90, origin=-np.pi, periodic=True)
    rng = np.random.default_rng(1)
    for degrees in (179.0, -179.0, 3.0, 540.0):
        sensor = AngleSensor(sigma=10.0, deg=True)
        ours = np.exp(sensor.log_likelihood(degrees, np.degrees(headings.centres)))
        again = AngleSensor(sigma=math.radians(10)).log_likelihood(
            [math.radians(degrees)], headings.centres[:, None]
        )
        np.testing.assert_allclose(np.exp(again), ours, rtol=1e-9)
        # Samples: where headings are that give this reading.
        samples = np.radians(degrees) - math.radians(10) * rng.standard_normal(400_000)
        counts = np.bincount(headings.index(samples), minlength=180)
        np.testing.assert_allclose(ours / ours.sum(), counts / 400_000, atol=0.002)
    assert ours[0] / ours.sum() == pytest.approx(ours[-1] / ours.sum(), rel=1e-9)


def test_angles_are_checked_and_missing_ones_say_nothing():
    sensor = AngleSensor(sigma=0.2)
    means = np.array([[0.1, 3.0], [0.2, -3.0], [1.0, 2.0]])
    both = sensor.log_likelihood([0.3, 3.1], means)
    one = sensor.log_likelihood([0.3, np.nan], means)
    np.testing.assert_allclose(one, sensor.log_likelihood(0.3, means[:, 0]))
    np.testing.assert_allclose(both - one, sensor.log_likelihood(3.1, means[:, 1]))
    nowhere = np.array([False, True, False])
    ours = sensor.log_likelihood(0.3, [0.1, np.nan, 1.0], undefined=nowhere)
    assert ours[1] == -math.log(2 * math.pi)
    np.testing.assert_allclose(ours[[0, 2]], sensor.log_likelihood(0.3, [0.1, 1.0]))
    for wrong in (
        lambda: AngleSensor(sigma=0.0),
        lambda: AngleSensor(sigma=np.nan),
        lambda: sensor.log_likelihood(np.inf, [0.1]),
        lambda: sensor.log_likelihood(0.3, [0.1, np.nan]),
        lambda: sensor.log_likelihood(0.3, [0.1, np.inf]),
        lambda: sensor.log_likelihood([0.3], means),
        lambda: sensor.log_likelihood(0.3, [0.1], undefined=nowhere),
        lambda: AngleSensor(sigma=np.array([[0.1], [0.2]])).log_likelihood(0.3, [0.1]),
        lambda: wrapped_normal(0.1, 0.0),
        lambda: log_wrapped_normal(0.1, np.nan),
    ):
        with pytest.raises(ValueError):  # noqa: PT011  each has its own words
            wrong()


HALL = np.zeros((20, 20))
HALL[-1] = 1.0


@pytest.mark.parametrize(
    ("cells", "threshold"),
    [
        (HALL.astype(bool), None),
        (HALL, None),
        (HALL.astype(int), None),
        (0.05 + 0.9 * HALL, 0.65),
        (100 * HALL, None),
        ((100 * HALL).astype(np.int8), None),
        ((10 + 80 * HALL).astype(np.int8), 0.65),
    ],
)
def test_maps_of_all_kinds_are_the_same_hall(cells, threshold):
    grid = OccupancyGrid(occupied=cells, cell=0.1, threshold=threshold)
    assert grid.occupied.tolist() == HALL.astype(bool).tolist()
    assert not grid.unknown.any()
    assert grid.cast(0.15, 1.0, 0.0, 5.0) == pytest.approx(1.75)
    rows = OccupancyGrid.from_rows(np.asarray(cells).T, cell=0.1, threshold=threshold)
    assert rows.occupied.tolist() == grid.occupied.tolist()


@pytest.mark.parametrize(
    ("cells", "threshold", "words"),
    [
        (0.05 + 0.9 * HALL, None, r"cell \(0, 0\) .* name the probability"),
        (10 + 80 * HALL, None, "name the probability"),
        (HALL * np.nan, None, r"nan at cell"),
        (-2 * HALL, None, "cell .* is -2"),
        (101 * HALL, None, "cell .* is 101"),
        (1.5 * HALL, 0.5, "cell .* is 1.5"),
        (HALL, 1.5, "threshold"),
        (HALL, (0.6, 0.4), "threshold"),
        (HALL, np.nan, "threshold"),
        (HALL[0], None, "two dimensions"),
    ],
)
def test_maps_that_are_none_are_refused(cells, threshold, words):
    with pytest.raises(ValueError, match=words):
        OccupancyGrid(occupied=cells, cell=0.1, threshold=threshold)


def test_unknown_cells_are_a_third_kind():
    served = (100 * HALL).astype(int)
    served[:5] = -1
    served[10, 3] = -1
    grid = OccupancyGrid(occupied=served, cell=0.1)
    assert grid.unknown.sum() == 101
    assert not (grid.occupied & grid.unknown).any()
    # From the unknown part; in the known part; towards the unknown part; to the unknown cell.
    ours = grid.cast([0.15, 0.55, 0.55, 0.55], [1.0, 1.0, 1.0, 0.35], [0, 0, np.pi, 0], 5.0)
    np.testing.assert_allclose(ours, [np.nan, 1.35, np.nan, np.nan], rtol=1e-12)
    assert grid.cast(0.55, 0.35, 0.0, 0.4) == 0.4  # the unknown cell is farther than the sensor sees
    np.testing.assert_allclose(grid.distance_field()[0, 0], 1.9)
    between = OccupancyGrid(occupied=[[0.1, 0.5, 0.9]], cell=1.0, threshold=(0.2, 0.8))
    assert between.unknown.tolist() == [[False, True, False]]
    assert between.occupied.tolist() == [[False, False, True]]
    marked = OccupancyGrid(occupied=[[False, True]], cell=1.0, unknown=[[True, True]])
    assert marked.unknown.all()
    assert not marked.occupied.any()
    with pytest.raises(ValueError, match="`unknown` has shape"):
        OccupancyGrid(occupied=[[False, True]], cell=1.0, unknown=[True])
    for call in (
        lambda: grid.cast(np.nan, 0.0, 0.0, 1.0),
        lambda: grid.cast(0.0, 0.0, np.inf, 1.0),
        lambda: grid.cast(0.0, 0.0, 0.0, -1.0),
    ):
        with pytest.raises(ValueError, match=r"finite|positive"):
            call()


def test_rays_to_unknown_cells_equal_rays_in_the_map_with_and_without_them():
    rng = np.random.default_rng(2)
    kinds = rng.choice(3, size=(14, 11), p=[0.8, 0.1, 0.1])
    full, unknown = kinds == 1, kinds == 2
    grid = OccupancyGrid(occupied=full, unknown=unknown, cell=0.5)
    x, y, angle = rng.uniform(-2, 9, 500), rng.uniform(-2, 7, 500), rng.uniform(-7, 7, 500)
    ours = grid.cast(x, y, angle, 6.0)
    as_free = OccupancyGrid(occupied=full, cell=0.5).cast(x, y, angle, 6.0)
    as_full = OccupancyGrid(occupied=full | unknown, cell=0.5).cast(x, y, angle, 6.0)
    # The way to the first cell that is not free is the same; whether it is known depends on what it is.
    known = ~np.isnan(ours)
    assert 100 < known.sum() < 450
    np.testing.assert_allclose(ours[known], as_full[known])
    np.testing.assert_allclose(ours[known], as_free[known])
    assert (as_full[~known] < 6.0).all()
    end = np.stack([x, y]) + (as_full + 1e-9) * np.stack([np.cos(angle), np.sin(angle)])
    i, j = np.floor(end / 0.5).astype(int)
    assert unknown[i[~known], j[~known]].all()


def test_beams_into_the_unknown_are_alike_likely():
    uniform = BeamModel(
        hit=0.7, short=0.1, longest=0.1, random=0.1, sigma=0.1, decay=1.0, max_range=4.0, unknown="uniform"
    )
    expected = np.array([[1.0, np.nan], [3.0, 2.0]])
    for reading in (0.3, 2.0, 3.99, np.inf):
        ours = uniform.log_likelihood([1.1, reading], expected)
        assert ours[0] == pytest.approx(BEAM.beam_log_likelihood(1.1, 1.0) + math.log(0.01 / 4.0))
        assert ours[1] == pytest.approx(BEAM.log_likelihood([1.1, reading], expected[1]))
    with pytest.raises(ValueError, match="unknown cells"):
        BeamModel(hit=1, short=0, longest=0, random=0, sigma=1, decay=1, max_range=1, unknown="pass")
    # The same by table.
    unknown = np.zeros((8, 8), dtype=bool)
    unknown[5, 3] = True
    grid = OccupancyGrid(occupied=ROOM, unknown=unknown, cell=0.5)
    space = pose_grid((8, 8, 8), cell=0.5)
    table = ScanTable(space, ~ROOM & ~unknown, grid.cast, beams=3, spacing=1, max_range=4.0)
    ours = table.log_likelihood([1.0, 2.0, np.inf], uniform.beam_log_likelihood)
    count = 0
    for index in np.argwhere(np.repeat((~ROOM & ~unknown)[:, :, None], 8, axis=2)):
        x, y, heading = space.pose(index)
        ranges = grid.cast(x, y, heading + table.angles, 4.0)
        count += int(np.isnan(ranges).sum())
        gap = np.abs(table.levels[:, None] - ranges)
        nearest = np.where(np.isnan(ranges), np.nan, table.levels[np.nan_to_num(gap, nan=9.0).argmin(axis=0)])
        assert ours[tuple(index)] == pytest.approx(
            uniform.log_likelihood([1.0, 2.0, np.inf], nearest), abs=1e-3
        )
    assert count > 20
    # A likelihood field: 1 / z_max where the beam ends in an unknown cell.
    field = LikelihoodField(hit=0.9, random=0.1, sigma=0.1, max_range=4.0)
    pose = [[2.25, 1.75, 0.0]]  # in the cell before the unknown one
    inside = field.log_likelihood([0.5], [0.0], pose, grid.distance_field(), grid)
    assert inside[0] == pytest.approx(-math.log(4.0))
    before = field.log_likelihood([0.1], [0.0], pose, grid.distance_field(), grid)
    distance = grid.distance_field()[4, 3]
    exact = 0.9 * stats.norm.pdf(distance, 0.0, 0.1) + 0.1 / 4.0
    assert before[0] == pytest.approx(math.log(exact))


def test_a_likelihood_field_checks_its_angles_poses_and_field():
    field, distances = LikelihoodField(hit=0.9, random=0.1, sigma=0.1, max_range=5.0), GRID.distance_field()
    skipped = field.log_likelihood([np.nan, 0.2], [np.nan, 0.1], POSES, distances, GRID)
    np.testing.assert_allclose(skipped, field.log_likelihood([0.2], [0.1], POSES, distances, GRID))
    for reading, angles, poses, far in (
        ([0.1, 0.2], [0.0], POSES, distances),
        ([0.1], [np.nan], POSES, distances),
        ([0.1], [0.0], [[0.0, 0.0]], distances),
        ([0.1], [0.0], [[0.0, np.nan, 0.0]], distances),
        ([0.1], [0.0], POSES, distances[1:]),
        ([0.1], [0.0], POSES, distances * np.nan),
    ):
        with pytest.raises(ValueError, match=r"agree|finite|heading|shape|nan"):
            field.log_likelihood(reading, angles, poses, far, GRID)


def test_scan_tables_refuse_maps_and_weights_that_are_none():
    space, cast = pose_grid((8, 8, 8), cell=0.5), OccupancyGrid(occupied=ROOM, cell=0.5).cast
    for wrong in ({"beams": 1.5}, {"beams": 0}, {"spacing": 0}, {"max_range": np.nan}):
        with pytest.raises(ValueError, match=r"whole number|positive"):
            ScanTable(space, ~ROOM, cast, **({"beams": 2, "spacing": 1, "max_range": 4.0} | wrong))
    with pytest.raises(ValueError, match="expected range"):
        ScanTable(space, ~ROOM, lambda *a: -cast(*a), beams=2, spacing=1, max_range=4.0)
    for weight in (0.0, 1.5, np.nan):
        with pytest.raises(ValueError, match="weight"):
            TABLE.log_likelihood([1.0, 2.0], BEAM.beam_log_likelihood, weight=weight)
