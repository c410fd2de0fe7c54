"""Indices and poses, and what a belief says, against direct computation."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ciberrato.bayes import (
    Axis,
    StateSpace,
    credible_set,
    entropy_bits,
    marginal,
    modes,
    moments,
    most_likely_cell,
    most_likely_cells,
)
from ciberrato.bayes.spaces import line, pose_grid, rectangle

POSES = pose_grid((12, 9, 18), cell=0.3048, origin=(-1.6764, -1.3716, -math.pi))


def test_the_course_grid_has_the_edges_of_its_definition():
    assert POSES.shape == (12, 9, 18)
    assert POSES.axis("x").edges[-1] == pytest.approx(1.9812)
    assert POSES.axis("y").edges[-1] == pytest.approx(1.3716)
    assert math.degrees(POSES.axis("heading").cell) == pytest.approx(20.0)
    assert POSES.cell_volume == pytest.approx(0.3048**2 * math.radians(20))


@given(st.integers(0, 11), st.integers(0, 8), st.integers(0, 17), st.integers(-3, 3))
def test_pose_and_index_are_inverse_and_headings_wrap(i, j, k, turns):
    pose = POSES.pose((i, j, k))
    pose[2] += turns * 2 * math.pi
    assert POSES.index(pose).tolist() == [i, j, k]
    assert POSES.flat_index(pose) == (i * 9 + j) * 18 + k
    assert POSES.point_mass(pose)[i, j, k] == 1.0


def test_every_cell_round_trips():
    assert (POSES.flat_index(POSES.centres()) == np.arange(POSES.size).reshape(POSES.shape)).all()


def test_values_at_the_edges_fall_inside_or_are_refused():
    axis = Axis(name="x", size=3, cell=0.1, origin=0.0)
    assert axis.index([0.0, np.nextafter(axis.length, 0.0)]).tolist() == [0, 2]
    for value in (-1e-9, 0.3000001, np.nan):
        with pytest.raises(ValueError, match="'x'"):
            axis.index(value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Axis(name="x", size=0),
        lambda: Axis(name="x", size=1, cell=-1.0),
        lambda: Axis(name="x", size=1, origin=math.inf),
        lambda: StateSpace(()),
        lambda: StateSpace((Axis(name="x", size=1), Axis(name="x", size=1))),
        lambda: line(3).axis("y"),
        lambda: rectangle((2, 2)).index([1.0]),
    ],
    ids=itertools.count(),
)
def test_impossible_spaces_are_refused(make):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        make()


def test_entropy_of_known_distributions():
    assert entropy_bits([0.0, 1.0]) == 0.0
    assert entropy_bits(np.full((7, 14), 1 / 98)) == pytest.approx(math.log2(98))
    assert entropy_bits([0.5, 0.25, 0.25]) == pytest.approx(1.5)


def test_most_likely_cells_and_ties():
    belief = np.array([[0.1, 0.3], [0.3 * (1 - 1e-12), 0.3 * (1 - 1e-6)]])
    assert most_likely_cell(belief) == (0, 1)
    assert most_likely_cells(belief).tolist() == [[0, 1], [1, 0]]


def test_modes_of_two_hills_and_a_plateau():
    space = StateSpace((Axis(name="x", size=9, periodic=True),))
    belief = np.array([0.2, 0.1, 0.0, 0.1, 0.25, 0.05, 0.0, 0.15, 0.15])
    # On a circle the shelf 7, 8 leads up to cell 0; on a bounded line it is a hill of its own.
    assert modes(belief, space=space)[0].peak == (0,)
    assert [round(m.mass, 9) for m in modes(belief, space=space)] == [0.6, 0.4]
    assert [(m.peak, round(m.mass, 9), m.cells) for m in modes(belief)] == [
        ((4,), 0.4, 3),
        ((0,), 0.3, 2),
        ((7,), 0.3, 2),
    ]
    assert sum(m.mass for m in modes(belief, least_mass=0.35)) == pytest.approx(0.4)


def test_modes_of_random_beliefs_partition_the_mass():
    rng = np.random.default_rng(7)
    belief = rng.dirichlet(np.ones(5 * 6 * 7)).reshape(5, 6, 7)
    hills = modes(belief, least_mass=0.0)
    assert sum(h.mass for h in hills) == pytest.approx(1.0)
    assert sum(h.cells for h in hills) == belief.size
    for hill in hills:  # a peak has no greater neighbour
        around = belief[tuple(slice(max(0, i - 1), i + 2) for i in hill.peak)]
        assert belief[hill.peak] == around.max()


def test_a_uniform_belief_is_one_hypothesis():
    assert [m.cells for m in modes(np.full((5, 5), 0.04))] == [25]


def test_moments_of_a_bounded_space_equal_the_weighted_sums():
    rng = np.random.default_rng(8)
    space = rectangle((5, 7), cell=0.5, origin=(-1.0, 2.0))
    belief = rng.dirichlet(np.ones(35)).reshape(5, 7)
    centres, weights = space.centres().reshape(-1, 2), belief.ravel()
    result = moments(belief, space)
    np.testing.assert_allclose(result.mean, weights @ centres)
    np.testing.assert_allclose(result.covariance, np.cov(centres.T, aweights=weights, ddof=0), atol=1e-12)


def test_heading_mean_goes_the_short_way_over_the_seam():
    space = pose_grid((1, 1, 36), cell=1.0)
    belief = np.zeros(space.shape)
    belief[0, 0, [0, 35]] = 0.5  # 5 degrees on either side of pi
    result = moments(belief, space)
    assert abs(result.mean[2]) == pytest.approx(math.pi)
    assert math.degrees(math.sqrt(result.covariance[2, 2])) == pytest.approx(5.0)
    assert result.concentration[2] == pytest.approx(math.cos(math.radians(5)))


def test_a_uniform_heading_has_no_mean_direction():
    assert moments(np.full((1, 1, 36), 1 / 36), pose_grid((1, 1, 36), cell=1.0)).concentration[2] < 1e-12


def test_marginals_equal_sums_in_the_order_of_the_names():
    belief = np.random.default_rng(9).random(POSES.shape)
    np.testing.assert_allclose(marginal(belief, POSES, "heading", "x"), belief.sum(axis=1).T)
    np.testing.assert_allclose(marginal(belief, POSES, "y"), belief.sum(axis=(0, 2)))


def test_credible_set_is_the_smallest_and_takes_ties_together():
    belief = np.array([0.4, 0.2, 0.2, 0.1, 0.1, 0.0])
    assert credible_set(belief, 0.4).tolist() == [True] + [False] * 5
    assert credible_set(belief, 0.5).tolist() == [True, True, True, False, False, False]
    assert credible_set(belief, 1.0).tolist() == [True] * 5 + [False]
    with pytest.raises(ValueError, match=r"\(0, 1\]"):
        credible_set(belief, 0.0)
