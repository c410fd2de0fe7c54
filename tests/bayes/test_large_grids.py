"""What large grids are computed with, piece by piece, against plain loops and numpy's own steps."""

import math
import os
import signal

import numpy as np
import pytest

from ciberrato.bayes import compiled, filtering
from ciberrato.bayes.filtering import update
from ciberrato.bayes.maps.occupancy import OccupancyGrid
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.sensors.fans import FAN, Fans, _numbered, sums_of_states
from ciberrato.bayes.spaces import pose_grid
from examples import museum


@pytest.fixture
def machine_code(loops):
    compiled.use(loops)
    yield loops
    compiled.use(None)


def test_vectors_are_numbers_side_by_side(loops):
    import numba

    from ciberrato.bayes import vectors as v

    number = np.uint64

    @numba.njit
    def work(values, out, many):
        one, other = v.load(values, number(3)), v.load(values, number(20))
        v.transpose(values, number(0), number(9), out, number(1), number(10))
        v.store(out, number(100), v.multiply_add(one, other, v.splat(values[0])))
        v.store(out, number(108), v.subtract(v.greater(one, other), v.multiply(one, other)))
        v.store(out, number(116), v.where_at_least(one, other, v.splat(values[2])))
        first, second = v.load_many(many, number(1)), v.load_many(many, number(20))
        v.store_in_turn(many, number(40), first, v.add(first, second))
        inside = v.outside(one, v.splat(values[1]), other)
        return v.total(v.double(one)), inside, v.positive(one), v.count(inside)

    rng = np.random.default_rng(1)
    for kind in (np.float64, np.float32):
        values, out = rng.standard_normal(80).astype(kind), np.zeros(128, kind)
        values[5] = np.nan
        many = rng.standard_normal(80).astype(np.float32)
        first, second = many[1:17].copy(), many[20:36].copy()
        one, other = values[3:11], values[20:28]
        whole, outside, positive, count = work(values, out, many)
        for i in range(8):
            for k in range(8):
                np.testing.assert_equal(out[1 + 10 * i + k], values[9 * k + i])
        np.testing.assert_allclose(out[100:108], one * other + values[0], rtol=1e-6, atol=1e-6)
        greater = np.where(one > other, one, other)
        np.testing.assert_allclose(out[108:116], greater - one * other, rtol=1e-6, atol=1e-6)
        np.testing.assert_array_equal(out[116:124], np.where(other >= values[2], one, 0.0))
        np.testing.assert_array_equal(many[40:72:2], first)
        np.testing.assert_array_equal(many[41:72:2], first + second)
        assert math.isnan(whole)
        wrong = [not values[1] <= a <= b for a, b in zip(one, other, strict=True)]
        assert outside == sum(2**k for k in range(8) if wrong[k])
        assert count == sum(wrong)
        assert positive == sum(2**k for k in range(8) if one[k] > 0.0)


def test_rays_in_machine_code_are_those_of_numpy_to_the_last_bit(machine_code):
    rng = np.random.default_rng(2)
    cells = rng.choice([-1, 0, 100], (23, 31), p=[0.02, 0.9, 0.08])
    for grid in (
        OccupancyGrid(occupied=cells, cell=0.3, origin=(-1.0, 2.0)),
        OccupancyGrid(occupied=cells > 0, cell=0.3),
        OccupancyGrid(occupied=np.zeros((5, 4), dtype=bool), cell=1.0),
    ):
        x, y = rng.uniform(-4.0, 12.0, (2, 5000))
        angle = rng.uniform(-7.0, 7.0, 5000)
        angle[::5] = rng.integers(-8, 9, 1000) * (math.pi / 4.0)  # along rows, columns and diagonals
        x[::3] = np.rint(x[::3] / 0.3) * 0.3  # on edges of cells
        fast = grid.cast(x, y, angle, 6.0)
        compiled.use(None)
        plain = grid.cast(x, y, angle, 6.0)
        compiled.use(machine_code)
        np.testing.assert_array_equal(fast, plain)
        assert np.isnan(plain).any() == grid.unknown.any()


def test_drives_over_long_rows_and_odd_numbers_of_headings(loops):
    rng = np.random.default_rng(3)
    for shape in ((9, 70, 21), (40, 33, 8), (3, 64, 5)):
        space = pose_grid(shape, cell=0.4)
        free = rng.random(shape[:2]) < 0.6
        free[:, :40] = shape[1] > 40
        belief = rng.random(shape) ** 6 * free[:, :, np.newaxis]
        belief[: shape[0] // 2, :20] = 0.0
        model = TurnDriveTurn(space=space, noise=OdometryNoise(rotation=0.4, translation=0.3), free=free)
        for control in (OdometryReading(rot1=1.1, trans=1.9, rot2=-2.0), OdometryReading(trans=-1.0)):
            for kind, error in ((np.float64, 1e-14), (np.float32, 3e-6)):
                given = belief.astype(kind)
                plain = model.predict(given, control)
                compiled.use(loops)
                fast = model.predict(given, control)
                compiled.use(None)
                assert fast.dtype == kind
                assert np.abs(fast - plain).max() <= error * plain.max()
                assert not fast[~free].any()


@pytest.mark.parametrize("spread", [0.1, 3.0, 15.0])
def test_single_precision_in_machine_code(machine_code, spread):
    rng = np.random.default_rng(4)
    belief = (rng.random(70_001) ** 9).astype(np.float32)
    belief[::7] = 0.0
    belief /= belief.sum()
    scores = (spread * rng.standard_normal(belief.shape)).astype(np.float32)
    scores[::5] = -np.inf
    single = update(belief, scores)
    compiled.use(None)
    exact = update(belief.astype(float), scores)
    assert single.posterior.dtype == np.float32
    assert single.log_evidence == pytest.approx(exact.log_evidence, abs=1e-5)
    held = exact.posterior >= 1e-25
    np.testing.assert_allclose(single.posterior[held], exact.posterior[held], rtol=1e-5)
    assert (single.posterior[~held] <= 1.1e-25).all()
    zero = (single.posterior == 0.0) & (belief > 0.0) & (scores > -np.inf)
    assert single.lost >= np.count_nonzero(zero)


@pytest.mark.parametrize("spread", [0.01, 60.0, 900.0])
def test_large_posteriors_of_numpy_are_those_of_small_ones(monkeypatch, spread):
    rng = np.random.default_rng(5)
    belief = rng.random((70, 1003)) ** rng.choice([1.0, 80.0, 400.0], (70, 1003))
    scores = (spread * rng.standard_normal(belief.shape)).astype(np.float32)
    scores[rng.random(belief.shape) < 0.2] = -np.inf
    compiled.use(None)
    plain = update(belief, scores)
    monkeypatch.setattr(compiled, "LARGE", 1000)
    monkeypatch.setattr(filtering, "_PIECE", 4000)
    results = []
    for cores in (1, 3):
        monkeypatch.setattr(compiled, "LEAST_SHARE", 9000)
        monkeypatch.setattr(compiled, "_cores", lambda count=cores: count)
        results.append(update(belief, scores))
    large = results[0]
    assert large.lost == plain.lost
    assert large.log_evidence == pytest.approx(plain.log_evidence, abs=1e-12, rel=1e-15)
    np.testing.assert_allclose(large.posterior, plain.posterior, rtol=1e-12 if spread > 50.0 else 1e-14)
    assert np.array_equal(large.posterior, results[1].posterior)
    belief[3, 4] = np.nan
    with pytest.raises(ValueError, match=r"\(3, 4\)"):
        update(belief, scores)


def test_threads_change_nothing_in_numpy(monkeypatch):
    hall = museum.build(cell=0.8, headings=24)
    tour = museum.visit(hall, 2)
    belief = np.random.default_rng(6).random(hall.space.shape) * hall.free[:, :, np.newaxis]
    results = []
    compiled.use(None)
    for cores in (1, 3):
        monkeypatch.setattr(compiled, "LARGE", 1000)
        monkeypatch.setattr(compiled, "LEAST_SHARE", 5000)
        monkeypatch.setattr(compiled, "_cores", lambda count=cores: count)
        scores = hall.table.log_likelihood(tour.scans[1], museum.BEAM.beam_log_likelihood, weight=0.12)
        results.append((hall.motion.predict(belief, tour.controls[0]), scores))
    assert np.array_equal(results[0][0], results[1][0])
    assert np.array_equal(results[0][1], results[1][1])


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize(
    "control",
    [
        OdometryReading(),
        OdometryReading(rot1=1.1, trans=1.9, rot2=-2.0),
        OdometryReading(trans=-2.4),
        OdometryReading(trans=4.5, rot2=0.5),  # several directions for each heading
    ],
    ids=["still", "ordinary", "backward", "far"],
)
def test_long_rows_of_large_grids_are_what_small_ones_get(monkeypatch, control, kind):
    rng = np.random.default_rng(8)
    compiled.use(None)
    space = pose_grid((13, 17, 24), cell=(0.4, 0.5))
    belief = rng.random(space.shape).astype(kind)
    for free in (None, rng.random((13, 17)) < 0.7):
        for noise in (OdometryNoise(), OdometryNoise(rotation=0.3, translation=0.5)):
            model = TurnDriveTurn(space=space, noise=noise, free=free)
            plain = model.predict_with_losses(belief, control)
            with monkeypatch.context() as patch:
                patch.setattr(compiled, "LARGE", 1000)
                first, again = (model.predict_with_losses(belief, control) for _ in range(2))
            error = 1e-14 if kind == np.float64 else 3e-6
            assert first.belief.dtype == kind
            assert np.abs(first.belief - plain.belief).max() <= error * plain.belief.max()
            assert np.array_equal(first.belief, again.belief)  # work arrays hold nothing over
            assert first[1:] == plain[1:]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    monkeypatch.setattr(compiled, "_cores", lambda: 2)

    def work():
        return compiled.share(lambda begin, end: end - begin, 10, 10 * compiled.LEAST_SHARE)

    assert work() == [1] * 10
    child = os.fork()
    if not child:
        signal.alarm(30)  # what hangs is killed
        os._exit(0 if work() == [1] * 10 else 1)
    assert os.waitpid(child, 0)[1] == 0


@pytest.mark.parametrize(("beams", "spacing", "first"), [(1, 1, 0), (17, 2, -9), (46, 2, -44), (60, 5, 3)])
def test_fans_are_sums_over_beams(beams, spacing, first):
    rng = np.random.default_rng(beams)
    codes = rng.integers(0, 256, (36, 50)).astype(np.uint8)
    codes[:, 25:] = codes[:, :25]  # places that see alike
    worth = rng.standard_normal((beams, 256))
    fans = Fans(codes, spacing)
    here, ahead = fans.sums(worth, first)
    assert np.array_equal(here[:, 25:], here[:, :25])
    for heading in range(36):
        seen = codes[(heading + first + spacing * np.arange(beams)) % 36]
        exact = worth[np.arange(beams)[:, np.newaxis], seen].sum(axis=0)
        found = here[heading] + ahead[heading]
        np.testing.assert_allclose(found, exact, atol=1.2e-7 * np.abs(worth).max(axis=1).sum() * beams)
        assert np.array_equal(found, sums_of_states(worth, seen))
    assert fans.nbytes > FAN * 36


@pytest.mark.parametrize("greatest", [10, 100_000])
def test_pairs_are_numbered(greatest):
    """Few kinds by a table, many by sorting."""
    rng = np.random.default_rng(7)
    first, second = rng.integers(0, greatest, (2, 300))
    (one, other), number = _numbered(first, second, greatest)
    assert np.array_equal(one[number], first)
    assert np.array_equal(other[number], second)
    assert len(set(zip(one.tolist(), other.tolist(), strict=True))) == len(one)
