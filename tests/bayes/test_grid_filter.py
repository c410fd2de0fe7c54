"""The filter that predicts and corrects in one pass, against its steps one after another."""

import math

import numpy as np
import pytest

from ciberrato.bayes import GridFilter, ImpossibleReadingError, MarkovFilter, compiled
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.sensors.scan_table import ScanTable
from ciberrato.bayes.spaces import pose_grid
from examples import museum

BEAM = museum.BEAM.beam_log_likelihood
FAR = OdometryReading(trans=4.5, rot2=0.5)  # several directions for each heading: one step after another


@pytest.fixture(params=["numpy", "machine code"])
def way(request):
    """With and without machine code."""
    compiled.use(request.getfixturevalue("loops") if request.param == "machine code" else None)
    yield request.param
    compiled.use(None)


@pytest.fixture(scope="module")
def hall():
    return museum.build(cell=0.8, headings=36)


@pytest.fixture(scope="module")
def tour(hall):
    return museum.visit(hall, 1)


def everywhere(hall):
    belief = np.repeat(hall.free[:, :, np.newaxis].astype(float), hall.space.shape[2], axis=2)
    return belief / belief.sum()


def without(look):
    """The same likelihood, of which the filter knows nothing more."""
    return lambda states: look(states)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("asked", [False, True], ids=["asked at the end", "asked at each stop"])
def test_a_tour_is_that_of_the_steps_one_after_another(hall, tour, way, kind, asked):
    robot = GridFilter(everywhere(hall), hall.motion, dtype=kind)
    plain = MarkovFilter(everywhere(hall), hall.motion.predict, dtype=kind)
    kept = []
    for step, scan in enumerate(tour.scans[:12]):
        look = hall.table.scan(scan, BEAM, weight=0.3)
        if step:
            control = FAR if step == 6 else tour.controls[step - 1]
            robot.predict(control)
            plain.predict(control)
            if step == 8:  # two predictions, no scan in between
                robot.predict(control)
                plain.predict(control)
            if step in (3, 8):
                np.testing.assert_allclose(robot.belief.sum(), 1.0, rtol=1e-5)
        robot.update(look)
        plain.update(look())
        if asked:
            kept.append((robot.belief, robot.belief.copy()))
    single = kind == np.float32
    assert robot.belief.dtype == kind
    assert robot.belief.sum(dtype=float) == pytest.approx(1.0, abs=1e-5 if single else 1e-12)
    bound = 12 * (2e-6 if single else 1e-14) * plain.belief.max()
    assert np.abs(robot.belief - plain.belief).max() <= bound
    assert robot.log_evidence == pytest.approx(plain.log_evidence, abs=1e-4 if single else 1e-10)
    assert robot.recoveries == plain.recoveries == 0
    for belief, then in kept:  # what was handed out is nobody else's
        np.testing.assert_array_equal(belief, then)


@pytest.mark.parametrize(("beams", "spacing", "headings"), [(1, 1, 24), (7, 3, 21), (60, 1, 20), (101, 2, 8)])
def test_odd_grids_and_scans(loops, beams, spacing, headings):
    """Rows of places and headings that fill no vectors; places where motion and table differ."""
    rng = np.random.default_rng(beams)
    space = pose_grid((11, 39, headings), cell=0.4)
    free = rng.random((11, 39)) < 0.8

    def cast(x, y, angle, farthest):
        return np.minimum(farthest, 2.0 + np.sin(3.0 * x + angle) + np.cos(5.0 * y - 2.0 * angle))

    table = ScanTable(space, free, cast, beams=beams, spacing=spacing, max_range=4.0)
    belief = rng.random(space.shape) ** 20
    belief[:4] = 0.0
    look = table.scan(rng.uniform(0.0, 4.0, beams), BEAM, weight=0.2)
    control = OdometryReading(rot1=1.1, trans=1.3, rot2=-2.0)
    compiled.use(loops)
    try:
        for allowed in (None, rng.random((11, 39)) < 0.7):
            motion = TurnDriveTurn(
                space=space, noise=OdometryNoise(rotation=0.4, translation=0.3), free=allowed
            )
            robots = [GridFilter(belief, motion) for _ in range(2)]
            for robot, given in zip(robots, (look, without(look)), strict=True):
                for _ in range(2):
                    robot.predict(control)
                    robot.update(given)
            fused, apart = (robot.belief for robot in robots)
            assert np.abs(fused - apart).max() <= 2e-14 * apart.max()
            assert not fused[~free].any()
            assert robots[0].log_evidence == pytest.approx(robots[1].log_evidence, abs=1e-11)
    finally:
        compiled.use(None)


def test_threads_change_nothing(hall, tour, loops, monkeypatch):
    compiled.use(loops)
    results = []
    try:
        for cores in (1, 3):
            monkeypatch.setattr(compiled, "LEAST_SHARE", 5000)
            monkeypatch.setattr(compiled, "_cores", lambda count=cores: count)
            robot = GridFilter(everywhere(hall), hall.motion)
            for control, scan in zip(tour.controls[:3], tour.scans[1:], strict=False):
                robot.predict(control)
                robot.update(hall.table.scan(scan, BEAM, weight=0.12))
            results.append((robot.belief, robot.log_evidence))
    finally:
        compiled.use(None)
    assert np.array_equal(results[0][0], results[1][0])
    assert results[0][1] == results[1][1]


def test_what_the_best_states_can_hardly_explain_is_left_to_the_logarithms(hall, way):
    """A scan whose likelihood is hundreds of nats below what it could be anywhere."""
    space = hall.space
    belief = np.zeros(space.shape)
    place = np.argwhere(hall.free)[200]
    belief[tuple(place)] = 1.0
    scan = np.full(len(hall.table.steps), 0.1)

    def harsh(reading, expected):
        return -400.0 * np.square(np.minimum(reading, 8.0) - expected)

    robot = GridFilter(belief, hall.motion)
    plain = MarkovFilter(belief, hall.motion.predict)
    look = hall.table.scan(scan, harsh)
    control = OdometryReading(trans=0.2)
    robot.predict(control)
    robot.update(look)
    plain.predict(control)
    plain.update(look())
    assert robot.log_evidence == pytest.approx(plain.log_evidence, rel=1e-6)
    assert robot.log_evidence < -600.0
    np.testing.assert_allclose(robot.belief, plain.belief, rtol=1e-3, atol=1e-200)


def test_impossible_scans_and_lost_mass(hall, way):
    belief = np.zeros(hall.space.shape)
    belief[tuple(np.argwhere(hall.free)[200])] = 1.0

    def never(reading, expected):
        return np.full(np.broadcast(reading, expected).shape, -1e4)

    look = hall.table.scan(np.full(len(hall.table.steps), 1.0), BEAM)

    def nowhere(states):
        return np.full(hall.space.shape, -np.inf)

    robot = GridFilter(belief, hall.motion)
    robot.predict(OdometryReading(trans=0.3))
    with pytest.raises(ImpossibleReadingError):
        robot.update(nowhere)
    assert robot.belief.sum() == pytest.approx(1.0)
    robot.update(hall.table.scan(np.full(len(hall.table.steps), 1.0), never))
    assert robot.belief.sum() == pytest.approx(1.0)
    # Driven out of the hall: all is lost, then the policy decides.
    robot = GridFilter(belief, hall.motion, on_impossible="uniform")
    for _ in range(3):
        robot.predict(OdometryReading(trans=40.0))
    robot.update(look)
    assert robot.recoveries == 1
    assert robot.belief.sum() == pytest.approx(1.0)
    assert robot.lost == 0


def test_bad_options_and_controls_are_refused_where_they_are_given(hall, way):
    with pytest.raises(ValueError, match="float64 or float32"):
        GridFilter(everywhere(hall), hall.motion, dtype=np.float16)
    with pytest.raises(ValueError, match="shape"):
        GridFilter(np.ones((3, 4)), hall.motion)
    robot = GridFilter(everywhere(hall), hall.motion)
    for wrong in (OdometryReading(trans=math.nan), OdometryReading(trans=1e6)):
        with pytest.raises(ValueError, match=r"finite|longer"):
            robot.predict(wrong)
    with pytest.raises(ValueError, match="shape"):
        robot.update(lambda states: np.zeros(3))
    np.testing.assert_allclose(robot.belief, everywhere(hall), rtol=1e-15)
