"""Beliefs of float32 against those of float64."""

import numpy as np
import pytest

from ciberrato.bayes import ImpossibleReadingError, LogBelief, MarkovFilter, compiled
from ciberrato.bayes.filtering import predict, update
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from examples import museum

BEAM = museum.BEAM.beam_log_likelihood


@pytest.fixture(params=["numpy", "numba"])
def loops(request):
    before = compiled.kernels()
    compiled.use(None)
    if request.param == "numba":
        pytest.importorskip("numba")
        compiled.load()
    yield request.param
    compiled.use(before)


def test_a_run_in_single_precision_follows_that_in_double(loops):
    hall = museum.build(cell=0.8, headings=36)
    tour = museum.visit(hall, 1)
    prior = np.repeat(hall.free[:, :, np.newaxis] * 1.0, 36, axis=2)
    exact, single = (MarkovFilter(prior, hall.motion.predict, dtype=t) for t in (np.float64, np.float32))
    for stop in range(8):
        for robot in (exact, single):
            if stop:
                robot.predict(tour.controls[stop - 1])
            robot.update(hall.table.log_likelihood(tour.scans[stop], BEAM, weight=museum.WEIGHT))
        assert single.belief.dtype == np.float32
        assert 0.5 * np.abs(single.belief - exact.belief).sum() < 1e-5
        assert single.log_evidence == pytest.approx(exact.log_evidence, abs=1e-5 * (stop + 1))
        assert single.belief.sum(dtype=float) == pytest.approx(1.0, abs=1e-5)


def test_predictions_keep_single_precision(loops):
    hall = museum.build(cell=0.8, headings=36)
    belief = np.random.default_rng(1).random(hall.space.shape) ** 8
    belief /= belief.sum()
    for control in museum.visit(hall, 1).controls[:3]:
        exact, single = (hall.motion.predict(belief.astype(t), control) for t in (float, np.float32))
        assert single.dtype == np.float32
        assert np.abs(single - exact).max() <= 3e-6 * exact.max()


@pytest.mark.parametrize("scores_of", [np.float32, np.float64])
@pytest.mark.parametrize("spread", [0.1, 3.0, 15.0])
def test_posteriors_are_right_to_a_hundred_thousandth(spread, scores_of):
    rng = np.random.default_rng(2)
    belief = (rng.random(70_001) ** 9).astype(np.float32)
    belief[::7] = 0.0
    belief /= belief.sum()
    scores = (spread * rng.standard_normal(belief.shape)).astype(scores_of)
    scores[::5] = -np.inf
    exact, single = update(belief.astype(float), scores), update(belief, scores)
    assert single.posterior.dtype == np.float32
    assert single.log_evidence == pytest.approx(exact.log_evidence, abs=1e-5)
    held = exact.posterior >= 1e-25
    np.testing.assert_allclose(single.posterior[held], exact.posterior[held], rtol=1e-5)
    zero = (single.posterior == 0.0) & (belief > 0.0) & (scores > -np.inf)
    assert (single.posterior[~held] <= 1.1e-25).all()
    assert single.lost >= np.count_nonzero(zero & ~(single.posterior > 0.0)) - exact.lost
    out = belief.copy()
    assert update(out, scores, out=out).posterior is out
    assert np.array_equal(out, single.posterior)


def test_what_single_precision_cannot_decide_is_worked_out_in_double():
    belief = np.array([1.0, 1e-30, 2e-30], dtype=np.float32)
    result = update(belief, np.array([-500.0, 0.0, 0.0]))
    np.testing.assert_allclose(result.posterior, [0.0, 1 / 3, 2 / 3], rtol=1e-6)
    assert result.posterior.dtype == np.float32
    assert result.log_evidence == pytest.approx(np.log(3e-30), rel=1e-6)
    with pytest.raises(ImpossibleReadingError):
        update(belief, np.full(3, -np.inf))
    kept = update(belief, np.full(3, -np.inf), on_impossible="keep").posterior
    np.testing.assert_allclose(kept, belief, rtol=1e-6)
    with pytest.raises(ValueError, match="nan"):
        update(belief, np.array([0.0, np.nan, 0.0]))
    with pytest.raises(ValueError, match="negative"):
        update(-belief, np.zeros(3))


def test_the_filter_keeps_its_precision_with_models_that_compute_in_double():
    model = GaussianShift(cell=1.0, sigma=0.7, edge="lose")
    prior = np.arange(40.0)
    exact, single = MarkovFilter(prior, model.predict), MarkovFilter(prior, model.predict, dtype="float32")
    for robot in (exact, single):
        robot.predict(2.0)
    assert single.belief.dtype == np.float32
    np.testing.assert_allclose(single.belief, exact.belief, rtol=1e-6)
    assert single.log_evidence == pytest.approx(exact.log_evidence, abs=1e-6)
    assert predict(model.predict, single.belief, 2.0).posterior.dtype == np.float32
    for wrong in ({"dtype": np.int64}, {"dtype": np.float32, "log": True}):
        with pytest.raises(ValueError, match="float"):
            MarkovFilter(np.ones(40), model.predict, **wrong)
    with pytest.raises(ValueError, match="logarithms"):
        MarkovFilter(LogBelief.of(np.full(4, 0.25)), model.predict, dtype=np.float32)
