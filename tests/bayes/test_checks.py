"""Inputs that are none: every function says so, and where; unusual ones are taken as they are meant."""

import itertools
import math

import numpy as np
import pytest
from scipy import sparse

from ciberrato.bayes import (
    Axis,
    LogBelief,
    MarkovFilter,
    StateSpace,
    credible_set,
    entropy_bits,
    marginal,
    modes,
    moments,
    most_likely_cell,
    most_likely_cells,
    predict,
    update,
    update_by_likelihood,
)
from ciberrato.bayes.checks import transition_array, whole, whole_array
from ciberrato.bayes.kidnapping import EvidenceMonitor, inject
from ciberrato.bayes.maps.segments import SegmentMap
from ciberrato.bayes.motion.transition_matrix import TransitionMatrix
from ciberrato.bayes.sensors.beam import BeamModel
from ciberrato.bayes.sensors.beam_learning import learn_beam_model
from ciberrato.bayes.sensors.detector import DiscreteSensor, DoorDetector
from ciberrato.bayes.sensors.quantized_gaussian import QuantizedGaussian
from ciberrato.bayes.smoothing import forward, forward_backward, most_likely_path
from ciberrato.bayes.spaces import cell_rows, line, pose_grid, rectangle

LINE = line(4)
BELIEF_FUNCTIONS = {
    "entropy_bits": entropy_bits,
    "most_likely_cell": most_likely_cell,
    "most_likely_cells": most_likely_cells,
    "modes": modes,
    "modes over a space": lambda b: modes(b, space=LINE),
    "moments": lambda b: moments(b, LINE),
    "marginal": lambda b: marginal(b, LINE, "x"),
    "credible_set": credible_set,
    "inject": lambda b: inject(b, 0.5),
    "inject, fresh": lambda b: inject(np.full(4, 0.25), 0.5, b),
    "update": lambda b: update(b, np.zeros(4), on_impossible="keep"),
    "update_by_likelihood": lambda b: update_by_likelihood(b, np.ones(4), on_impossible="keep"),
    "likelihood": lambda b: update_by_likelihood(np.full(4, 0.25), b, on_impossible="keep"),
    "predict": lambda b: predict(lambda b, u: b, b, None),
    "predicted": lambda b: predict(lambda b_, u: b, np.full(4, 0.25), None),
    "MarkovFilter": lambda b: MarkovFilter(b, lambda b, u: b),
    "LogBelief": LogBelief.of,
    "forward": lambda b: forward(b, np.zeros((2, 4)), np.eye(4)),
    "forward_backward": lambda b: forward_backward(b, np.zeros((2, 4)), np.eye(4)),
    "most_likely_path": lambda b: most_likely_path(b, np.zeros((2, 4)), np.eye(4)),
}
# What a prediction that lost everything leaves is told as such, by -inf, or has a policy.
TAKE_ZEROS = {"update", "update_by_likelihood", "likelihood", "predict", "predicted", "LogBelief"}


@pytest.mark.parametrize("wrong", [np.nan, -0.1, np.inf, -np.inf])
@pytest.mark.parametrize("name", BELIEF_FUNCTIONS)
def test_every_function_refuses_what_is_no_belief_and_names_the_cell(name, wrong):
    with pytest.raises(ValueError, match=f"cell 2 is {wrong}"):
        BELIEF_FUNCTIONS[name](np.array([0.5, 0.3, wrong, 0.2]))


@pytest.mark.parametrize("name", sorted(set(BELIEF_FUNCTIONS) - TAKE_ZEROS))
def test_every_function_that_needs_mass_refuses_a_belief_of_zeros(name):
    with pytest.raises(ValueError, match=r"zero in every cell|possible somewhere"):
        BELIEF_FUNCTIONS[name](np.zeros(4))


@pytest.mark.parametrize("name", sorted(set(BELIEF_FUNCTIONS) - {"likelihood"}))
def test_every_function_refuses_a_sum_beyond_all_numbers(name):
    with pytest.raises(ValueError, match=r"sums to infinity"):
        BELIEF_FUNCTIONS[name](np.full(4, 1e308))


@pytest.mark.parametrize(
    "name", sorted(set(BELIEF_FUNCTIONS) - {"likelihood", "update", "update_by_likelihood", "predict"})
)
def test_every_function_refuses_an_empty_belief(name):
    with pytest.raises(ValueError, match=r"no cells|shape|possible somewhere"):
        BELIEF_FUNCTIONS[name](np.zeros(0))


def test_summaries_do_not_need_a_sum_of_one():
    belief = np.array([0.4, 0.2, 0.2, 0.1, 0.1, 0.0])
    for scale in (1e-300, 7.0, 1e200):
        assert entropy_bits(scale * belief) == pytest.approx(entropy_bits(belief), rel=1e-12)
        assert credible_set(scale * belief, 0.5).tolist() == credible_set(belief, 0.5).tolist()
        np.testing.assert_allclose(
            [m.mass for m in modes(scale * belief)], [m.mass for m in modes(belief)], rtol=1e-12
        )
        np.testing.assert_allclose(inject(scale * belief, 0.2, scale * belief), belief)
    assert entropy_bits([1.0, 1.0]) == 1.0


@pytest.mark.parametrize(
    ("belief", "function"),
    [
        (np.full((3, 4), 1 / 12), lambda b: inject(b, 0.5, np.full(4, 0.25))),
        (np.full((2, 4), 1 / 8), lambda b: moments(b, LINE)),
        (np.full(5, 0.2), lambda b: marginal(b, LINE, "x")),
        (np.full(5, 0.2), lambda b: modes(b, space=LINE)),
        (np.full(5, 0.2), lambda b: update(b, np.zeros(4))),
        (np.full(5, 0.2), lambda b: update(b, 0.0)),
    ],
)
def test_shapes_must_agree(belief, function):
    with pytest.raises(ValueError, match="shape"):
        function(belief)


@pytest.mark.parametrize(
    "call",
    [
        lambda: marginal(np.ones(4), LINE),
        lambda: marginal(np.ones(4), LINE, "x", "x"),
        lambda: modes(np.ones(4), least_mass=np.nan),
        lambda: most_likely_cells(np.ones(4), tolerance=-1.0),
        lambda: inject(np.ones(4), np.nan),
        lambda: EvidenceMonitor().seen(np.inf),
        lambda: EvidenceMonitor().seen(np.nan),
        lambda: EvidenceMonitor(warm_up=1.9),
        lambda: EvidenceMonitor(floor=np.inf),
        lambda: DiscreteSensor(probabilities={"a": np.array([0.5, 0.5]), "b": 0.5}),
        lambda: DiscreteSensor(probabilities={"a": np.array([1.2, 0.5]), "b": np.array([-0.2, 0.5])}),
        lambda: DiscreteSensor(probabilities={}),
        lambda: DoorDetector(doors=(np.nan,), sigma=1.0),
        lambda: DoorDetector(doors=(1.0,), sigma=np.inf),
        lambda: DoorDetector(doors=(1.0,), sigma=1.0).log_likelihood(np.nan, LINE.axes[0]),
        lambda: DoorDetector(doors=(1.0,), sigma=1.0).log_likelihood(True, LINE.axes[0], [np.nan]),
        lambda: SegmentMap(np.array([[0.0, 0.0, 1.0, 0.0]])).cast(np.nan, 0.0, 0.0),
        lambda: SegmentMap(np.array([[0.0, 0.0, 1.0, np.inf]])),
        lambda: QuantizedGaussian(sigma=0.1, step=0.1, outlier_readings=1.5),
        lambda: QuantizedGaussian(sigma=np.nan, step=0.1),
    ],
    ids=itertools.count(),
)
def test_what_makes_no_sense_is_refused(call):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        call()


def test_whole_numbers_of_all_kinds_are_taken_and_fractions_are_not():
    for value in (3, 3.0, np.int8(3), np.uint64(3), np.float32(3.0), np.array(3)):
        assert whole(value, what="n") == 3
        assert type(whole(value, what="n")) is int
        assert Axis(name="x", size=value).size == 3
        assert pose_grid((value, 2, value), cell=1.0).shape == (3, 2, 3)
    for value in (1.9, np.nan, np.inf, "3", True, None, np.array([1, 2]), 1 + 0j):
        with pytest.raises(ValueError, match="n must be a whole number"):
            whole(value, what="n")
    with pytest.raises(ValueError, match="of 1 or more, not 0"):
        whole(0, what="n", least=1)
    assert whole_array([0.0, 2.0], what="n").tolist() == [0, 2]
    assert whole_array([], what="n").tolist() == []
    for values in ([0.0, 1.9], [np.nan], [np.inf], [1e300], [True], ["1"]):
        with pytest.raises(ValueError, match="whole numbers"):
            whole_array(values, what="n")


MATRICES = {
    "columns": (np.array([[0.9, 0.4], [0.1, 0.6]]), "transpose"),
    "negative": (np.array([[1.5, -0.5], [0.4, 0.6]]), "entry of -0.5"),
    "nan": (np.array([[np.nan, 0.5], [0.4, 0.6]]), "entry of nan"),
    "above": (np.array([[0.5, 0.5], [0.7, 0.6]]), "row 1 of .* sums to 1.3"),
    "not square": (np.array([[0.5, 0.5]]), "shape"),
    "too large": (np.eye(3), "shape"),
}


@pytest.mark.parametrize("name", MATRICES)
@pytest.mark.parametrize("as_sparse", [False, True])
def test_smoothing_takes_no_matrix_that_a_transition_matrix_does_not_take(name, as_sparse):
    matrix, words = MATRICES[name]
    given = sparse.csr_array(matrix) if as_sparse else matrix
    scores = np.zeros((3, 2))
    for function in (forward, forward_backward, most_likely_path):
        for transitions in (given, [np.eye(2), given]):
            with pytest.raises(ValueError, match=words):
                function([0.5, 0.5], scores, transitions)
    if name != "too large":
        with pytest.raises(ValueError, match="matrix"):
            TransitionMatrix(matrices={0: given})


def test_matrices_are_taken_as_lists_stacks_integers_and_in_all_sparse_formats():
    rng = np.random.default_rng(4)
    matrix, scores, prior = rng.dirichlet(np.ones(3), 3), np.log(rng.random((5, 3))), np.full(3, 1 / 3)
    expected = forward_backward(prior, scores, matrix).smoothed
    for same in (
        matrix.tolist(),
        [matrix.tolist()] * 4,
        np.stack([matrix] * 4),
        *(getattr(sparse, f"{kind}_array")(matrix) for kind in ("csr", "csc", "coo", "lil", "dok")),
    ):
        np.testing.assert_allclose(forward_backward(prior, scores, same).smoothed, expected, rtol=1e-12)
        assert most_likely_path(prior, scores, same)[0].tolist() == (
            most_likely_path(prior, scores, matrix)[0].tolist()
        )
    np.testing.assert_allclose(forward(prior, scores, np.eye(3, dtype=int)).filtered.sum(axis=1), 1.0)
    assert transition_array(sparse.csr_array(np.eye(3, dtype=int))).dtype == float


def test_cells_may_be_of_two_widths_and_headings_in_degrees():
    space = pose_grid((4, 3, 36), cell=(0.5, 0.2), origin=(1.0, -0.3, -180.0), deg=True)
    assert space.axis("x").edges.tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    np.testing.assert_allclose(space.axis("y").edges, [-0.3, -0.1, 0.1, 0.3], atol=1e-15)
    assert space.axis("heading").origin == pytest.approx(-math.pi)
    assert space.axes[2] == pose_grid((1, 1, 36), cell=1.0).axes[2]
    index = space.index((1.6, 0.0, 95.0), deg=True)
    assert index.tolist() == [1, 1, 27]
    assert index.tolist() == space.index((1.6, 0.0, math.radians(95.0))).tolist()
    np.testing.assert_allclose(space.pose(index, deg=True), [1.75, 0.0, 95.0], atol=1e-12)
    assert space.point_mass((1.6, 0.0, 95.0 + 360.0), deg=True)[1, 1, 27] == 1.0
    assert space.flat_index((1.6, 0.0, 95.0), deg=True) == (1 * 3 + 1) * 36 + 27
    assert rectangle((2, 2), cell=(1.0, 3.0)).cell_volume == 3.0
    for wrong in (
        lambda: rectangle((2, 2), cell=(1.0, 2.0, 3.0)),
        lambda: rectangle((2, 2, 2)),
        lambda: rectangle((2, 2), origin=(0.0,)),
        lambda: pose_grid((2, 2), cell=1.0),
        lambda: pose_grid((2, 2, 2), cell=1.0, origin=(0.0, 0.0)),
        lambda: pose_grid((2, 2, 1.9), cell=1.0),
        lambda: space.point_mass([(1.6, 0.0, 0.1)] * 2),
    ):
        with pytest.raises(ValueError):  # noqa: PT011  each has its own words
            wrong()


def test_indices_off_the_grid_have_no_pose():
    space = pose_grid((4, 3, 36), cell=1.0)
    for index in ((-1, 0, 0), (4, 0, 0), (0, 3, 0)):
        with pytest.raises(ValueError, match="has cells 0 to"):
            space.pose(index)
    with pytest.raises(ValueError, match="whole numbers"):
        space.pose((0.5, 0, 0))
    np.testing.assert_allclose(space.pose((1, 2, 37)), space.pose((1, 2, 1)))
    np.testing.assert_allclose(space.pose((1.0, 2.0, -1.0)), space.pose((1, 2, 35)))


def test_arrays_of_rows_have_a_space_of_their_own():
    rows, plane = cell_rows((3, 5), cell=(2.0, 1.0)), rectangle((5, 3), cell=(1.0, 2.0))
    belief = np.arange(1.0, 16.0).reshape(3, 5)
    assert rows.index((3.0, 4.5)).tolist() == [1, 4]  # row 1, column 4: y = 3, x = 4.5
    turned = marginal(belief, rows, "x", "y")
    np.testing.assert_array_equal(turned, belief.T)
    np.testing.assert_allclose(moments(belief, rows).mean, moments(turned, plane).mean[::-1])
    assert StateSpace(rows.axes).axis("x") == plane.axis("x")


def test_learning_skips_readings_that_are_none():
    start = BeamModel(hit=0.7, short=0.1, longest=0.1, random=0.1, sigma=0.2, decay=0.4, max_range=8.0)
    rng = np.random.default_rng(5)
    expected = rng.uniform(1.0, 7.0, 500)
    reading = start.sample(expected, rng)
    holes = reading.copy()
    holes[::3] = np.nan
    keep = ~np.isnan(holes)
    with_holes = learn_beam_model(holes, expected, start, iterations=5)
    assert with_holes.model == learn_beam_model(reading[keep], expected[keep], start, iterations=5).model
    endless = np.where(reading >= 8.0, np.inf, reading)
    assert learn_beam_model(endless, expected, start, iterations=5).model == (
        learn_beam_model(reading, expected, start, iterations=5).model
    )
    for wrong in (-reading, reading[:-1], np.full(500, np.nan)):
        with pytest.raises(ValueError, match=r"reads -|as many|no reading"):
            learn_beam_model(wrong, expected, start)
    with pytest.raises(ValueError, match="map is nan"):
        learn_beam_model(reading, np.where(expected > 6.0, np.nan, expected), start)
