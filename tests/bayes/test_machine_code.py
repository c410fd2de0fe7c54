"""Large grids in machine code against numpy, exact numbers, and themselves with other threads."""

import math
from decimal import Decimal, localcontext
from itertools import product

import numpy as np
import pytest

from ciberrato.bayes import ImpossibleReadingError, compiled
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.sensors.scan_table import ScanTable
from ciberrato.bayes.spaces import pose_grid
from examples import museum

BEAM = museum.BEAM.beam_log_likelihood


@pytest.fixture
def with_and_without(loops):
    def both(work):
        plain = work()
        compiled.use(loops)
        try:
            return plain, work()
        finally:
            compiled.use(None)

    yield both
    compiled.use(None)


def free_places(rng):
    return rng.random((11, 19)) < 0.8


@pytest.mark.parametrize(
    ("beams", "spacing"),
    [(1, 1), (5, 1), (8, 2), (7, 3), (12, 5), (24, 1), (30, 1), (9, 7), (60, 1), (101, 2)],
)
def test_scans_are_sums_over_beams(with_and_without, loops, beams, spacing):
    """Also where spacings do not divide a turn, and where beams go round more than once."""
    rng = np.random.default_rng(beams)
    space = pose_grid((11, 19, 24), cell=0.4)
    free = free_places(rng)

    def cast(x, y, angle, farthest):
        return np.minimum(farthest, 2.0 + np.sin(3.0 * x + angle) + np.cos(5.0 * y - 2.0 * angle))

    table = ScanTable(space, free, cast, beams=beams, spacing=spacing, max_range=4.0)
    scan = rng.uniform(0.0, 4.0, beams)
    scan[0] = np.inf if beams > 5 else scan[0]
    scan[beams // 2] = np.nan if beams > 5 else scan[beams // 2]
    asked = table.scan(scan, BEAM, weight=0.4)
    plain, fast = with_and_without(asked)
    assert np.array_equal(np.isfinite(plain), np.isfinite(fast))
    # One by one, in double precision.
    codes = table._codes
    places = np.full(free.shape, -1)
    places[free] = np.arange(free.sum())
    bound = 1.2e-7 * beams * np.abs(asked.worth).max(axis=1).sum()
    for i, j, k in rng.integers((11, 19, 24), size=(200, 3)):
        if free[i, j]:
            exact = math.fsum(
                asked.worth[b, codes[(k + step) % 24, places[i, j]]] for b, step in enumerate(table.steps)
            )
            assert abs(plain[i, j, k] - exact) <= bound
            assert abs(fast[i, j, k] - exact) <= bound
        else:
            assert fast[i, j, k] == -np.inf
    compiled.use(loops)
    some = rng.permutation(space.size)[:500]
    assert np.array_equal(asked(some), fast.ravel()[some])  # what they get among all, to the last bit
    assert table.nbytes > codes.nbytes + table._fans.nbytes + codes.nbytes


@pytest.mark.parametrize(
    ("control", "noise"),
    list(
        product(
            (
                OdometryReading(),
                OdometryReading(rot1=0.3, trans=0.9, rot2=-0.2),
                OdometryReading(rot1=-2.9, trans=0.4, rot2=3.0),
                OdometryReading(trans=4.5, rot2=0.5),  # several directions for each heading: numpy's work
            ),
            (
                OdometryNoise(),
                OdometryNoise(rotation=0.08, translation=0.1),
                OdometryNoise(rotation=0.5, translation=1.5),
                OdometryNoise(rotation=30.0, translation=0.1),
            ),
        )
    ),
)
def test_predictions_are_those_of_numpy(with_and_without, control, noise):
    rng = np.random.default_rng(4)
    space = pose_grid((11, 19, 24), cell=(0.4, 0.5))
    belief = rng.random(space.shape) ** 6 * (rng.random(space.shape[:2]) < 0.7)[:, :, np.newaxis]
    belief /= belief.sum()
    for free in (None, free_places(rng)):
        model = TurnDriveTurn(space=space, noise=noise, free=free)
        plain, fast = with_and_without(lambda m=model: m.predict(belief, control))
        assert np.abs(fast - plain).max() <= 1e-14 * plain.max()
        assert (fast >= 0.0).all()
        # Listed states are moved by numpy's path in either case.
        states = np.flatnonzero(belief)
        listed = model.predict_states(states, belief.ravel()[states], control)
        np.testing.assert_allclose(fast.ravel()[listed.states], listed.masses, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("wrong", [-0.1, np.nan, np.inf])
def test_what_is_no_belief_is_refused(loops, wrong):
    space = pose_grid((5, 6, 8), cell=0.4)
    model = TurnDriveTurn(space=space, noise=OdometryNoise(rotation=0.3))
    belief = np.array(space.uniform())
    belief[2, 3, 4] = wrong
    compiled.use(loops)
    try:
        with pytest.raises(ValueError, match="finite and not negative"):
            model.predict(belief, OdometryReading())
        with pytest.raises(ValueError, match="shape"):
            model.predict(belief[1:], OdometryReading())
        with pytest.raises(ValueError, match=r"\(2, 3, 4\)"):
            update(belief, np.zeros(space.shape))
        with pytest.raises(ValueError, match="nan"):
            update(space.uniform(), np.where(belief == belief[0, 0, 0], 0.0, np.nan))
        with pytest.raises(ImpossibleReadingError):
            update(space.uniform(), np.full(space.shape, -np.inf))
    finally:
        compiled.use(None)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("spread", [0.01, 5.0, 60.0, 900.0])
def test_posteriors_are_those_of_numpy(with_and_without, precision, spread):
    rng = np.random.default_rng(5)
    shape = (7, 13, 29)
    belief = rng.random(shape) ** rng.choice([1.0, 80.0, 400.0], shape)
    belief[rng.random(shape) < 0.2] = 0.0
    scores = (spread * rng.standard_normal(shape)).astype(precision)
    scores[rng.random(shape) < 0.2] = -np.inf
    plain, fast = with_and_without(lambda: update(belief, scores))
    assert fast.lost == plain.lost
    assert fast.log_evidence == pytest.approx(plain.log_evidence, abs=1e-12, rel=1e-15)
    assert np.array_equal(fast.posterior == 0.0, plain.posterior == 0.0)
    # Of each posterior, the smallest included; those worked out by logarithms have the logarithm's rounding.
    np.testing.assert_allclose(fast.posterior, plain.posterior, rtol=1e-12 if spread > 50.0 else 1e-14)
    other = np.empty(shape)
    _, again = with_and_without(lambda: update(belief, scores, out=other))
    assert again.posterior is other
    assert np.array_equal(other, fast.posterior)


def test_the_exponential_is_right_to_three_units_in_the_last_place(loops):
    scores = np.concatenate([-np.linspace(0.0, 600.0, 4000), -np.logspace(-12, 2, 500)])
    found = np.empty(len(scores))
    loops.products(np.ones(len(scores)), scores, 0.0, -600.0, 0.0, 0.0, 1.0, found, 0, len(scores))
    with localcontext() as context:
        context.prec = 40
        for value, result in zip(scores[::17].tolist(), found[::17].tolist(), strict=True):
            exact = Decimal(value).exp()
            assert abs(Decimal(result) - exact) <= 3 * Decimal(2) ** -53 * exact


def test_threads_change_nothing(loops, monkeypatch):
    hall = museum.build(cell=0.8, headings=24)
    tour = museum.visit(hall, 2)
    belief = np.random.default_rng(6).random(hall.space.shape) * hall.free[:, :, np.newaxis]
    belief /= belief.sum()
    results = []
    compiled.use(loops)
    try:
        for cores in (1, 3):
            monkeypatch.setattr(compiled, "LEAST_SHARE", 5000)
            monkeypatch.setattr(compiled, "_cores", lambda count=cores: count)
            predicted = hall.motion.predict(belief, tour.controls[0])
            scores = hall.table.log_likelihood(tour.scans[1], BEAM, weight=museum.WEIGHT)
            results.append((predicted, scores, update(predicted, scores).posterior))
    finally:
        compiled.use(None)
    assert np.array_equal(results[0][0], results[1][0])
    assert np.array_equal(results[0][1], results[1][1])
    assert np.array_equal(results[0][2], results[1][2])


def test_large_spaces_load_the_loops_for_themselves_unless_told_not_to(loops, monkeypatch):
    compiled.load_for(compiled.LARGE - 1)
    assert compiled.kernels(compiled.LARGE) is None
    monkeypatch.setenv("CIBERRATO_COMPILED", "off")
    compiled.load_for(compiled.LARGE)
    assert compiled.kernels(compiled.LARGE) is None
    assert not compiled.load()
    monkeypatch.undo()
    compiled.load_for(compiled.LARGE)
    assert compiled.kernels(compiled.LARGE) is loops
    assert compiled.kernels(compiled.LARGE - 1) is None, (
        "a small grid's results do not depend on what came before"
    )
    compiled.use(None)
    assert compiled.kernels(compiled.LARGE) is None
