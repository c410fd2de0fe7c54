"""Motion along axes: against matrices built entry by entry, moments, and samples."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from ciberrato.bayes.convolution import convolve, gaussian_kernel, whole_steps
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.motion.kernel import CommandKernel, KernelMotion
from ciberrato.bayes.motion.shift import Shift
from ciberrato.bayes.motion.transition_matrix import TransitionMatrix, transition_matrix

edges = st.sampled_from(["wrap", "stay", "lose"])


def arrive(cell, size, edge):
    """Where mass that goes to `cell` ends: a cell, or None if it is lost."""
    if 0 <= cell < size:
        return cell
    return {"wrap": cell % size, "stay": min(max(cell, 0), size - 1), "lose": None}[edge]


def dense(shape, displacements, edge_list):
    size = math.prod(shape)
    matrix = np.zeros((size, size))
    for start in np.ndindex(*shape):
        for displacement, weight in displacements.items():
            end = [
                arrive(s + d, n, e) for s, d, n, e in zip(start, displacement, shape, edge_list, strict=True)
            ]
            if None not in end:
                matrix[np.ravel_multi_index(start, shape), np.ravel_multi_index(end, shape)] += weight
    return matrix


@settings(max_examples=50, deadline=None)
@given(shape=st.lists(st.integers(1, 4), min_size=1, max_size=3), data=st.data())
def test_shift_equals_the_matrix_entry_by_entry(shape, data):
    steps = [data.draw(st.integers(-6, 6)) for _ in shape]
    edge_list = tuple(data.draw(edges) for _ in shape)
    ours = transition_matrix(Shift(edges=edge_list).predict, shape, steps)
    np.testing.assert_array_equal(ours, dense(shape, {tuple(steps): 1.0}, edge_list))


@settings(max_examples=50, deadline=None)
@given(shape=st.lists(st.integers(1, 4), min_size=1, max_size=3), seed=st.integers(0, 9999), data=st.data())
def test_kernel_motion_equals_the_matrix_entry_by_entry(shape, seed, data):
    rng = np.random.default_rng(seed)
    edge_list = tuple(data.draw(edges) for _ in shape)
    places = {tuple(int(i) for i in rng.integers(-5, 6, len(shape))): float(w) for w in rng.random(4)}
    total = sum(places.values())
    places = {k: v / total for k, v in places.items()}
    motion = KernelMotion(kernels={"go": CommandKernel.from_displacements(places)}, edges=edge_list)
    expected = dense(shape, places, edge_list)
    np.testing.assert_allclose(transition_matrix(motion.predict, shape, "go"), expected, atol=1e-15)
    belief = rng.dirichlet(np.ones(math.prod(shape))).reshape(shape)
    for matrix in (expected, sparse.csr_array(expected)):
        other = TransitionMatrix(matrices={"go": matrix}).predict(belief, "go")
        np.testing.assert_allclose(motion.predict(belief, "go"), other, atol=1e-15)


@settings(max_examples=40, deadline=None)
@given(
    size=st.integers(1, 9),
    taps=st.integers(1, 12),
    first=st.integers(-14, 14),
    edge=edges,
    axis=st.integers(0, 2),
)
def test_convolution_along_one_axis_equals_the_matrix(size, taps, first, edge, axis):
    rng = np.random.default_rng(size * 100 + taps)
    shape = [2, 2, 2]
    shape[axis] = size
    belief, weights = rng.random(shape), rng.dirichlet(np.ones(taps))
    displacements = {tuple(first + k if i == axis else 0 for i in range(3)): w for k, w in enumerate(weights)}
    edge_list = ["lose"] * 3
    edge_list[axis] = edge
    expected = (belief.ravel() @ dense(shape, displacements, edge_list)).reshape(shape)
    np.testing.assert_allclose(convolve(belief, weights, first, edge=edge, axis=axis), expected, atol=1e-14)
    line = belief.sum(axis=tuple(i for i in range(3) if i != axis))
    flat = dense([size], {(first + k,): w for k, w in enumerate(weights)}, [edge])
    np.testing.assert_allclose(convolve(line, weights, first, edge=edge), line @ flat, atol=1e-14)


@given(mean=st.floats(-20, 20), variance=st.floats(0, 30))
def test_kernel_has_the_moments_it_was_asked_for(mean, variance):
    kernel = gaussian_kernel(mean, variance)
    cells = kernel.first + np.arange(len(kernel.weights))
    assert kernel.weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert (kernel.weights >= -1e-17).all()
    got = kernel.weights @ cells
    assert got == pytest.approx(mean, abs=1e-6)
    spread = kernel.weights @ (cells - got) ** 2
    assert spread == pytest.approx(variance + kernel.excess_variance, abs=1e-6 + 1e-6 * variance)
    fraction = abs(mean - round(mean))
    assert (kernel.excess_variance > 0) == (variance < fraction * (1 - fraction) and variance < 1)
    assert kernel.dropped <= 1e-9


@pytest.mark.parametrize("edge", ["wrap", "lose", "stay"])
@pytest.mark.parametrize("first", [-40, -2, 0, 3, 55])
def test_long_lines_equal_the_sum_cell_by_cell(edge, first):
    rng = np.random.default_rng(8)
    line, weights = rng.random(20_000), rng.dirichlet(np.ones(5))
    expected = np.zeros(20_000)
    for k, weight in enumerate(weights):
        places = np.arange(20_000) + first + k
        if edge == "lose":
            kept = (places >= 0) & (places < 20_000)
        else:
            kept = np.ones(20_000, dtype=bool)
            places = places % 20_000 if edge == "wrap" else np.clip(places, 0, 19_999)
        np.add.at(expected, places[kept], weight * line[kept])
    np.testing.assert_allclose(convolve(line, weights, first, edge=edge), expected, atol=1e-14)


def test_wide_kernel_is_the_gaussian_density_and_reports_its_tail():
    kernel = gaussian_kernel(0.3, 9.0, tail=0.01)
    cells = kernel.first + np.arange(len(kernel.weights))
    density = np.exp(-0.5 * ((cells - 0.3) / 3) ** 2)
    np.testing.assert_allclose(kernel.weights, density / density.sum(), rtol=1e-12)
    samples = np.random.default_rng(5).normal(0.3, 3.0, 400_000)
    outside = np.mean((samples < cells[0] - 0.5) | (samples > cells[-1] + 0.5))
    assert kernel.dropped == pytest.approx(outside, rel=0.1)
    assert 0 < kernel.dropped <= 0.01


@pytest.mark.parametrize("carried", [True, False])
def test_many_small_steps_add_up_to_the_right_place_and_spread(carried):
    # 1,000 steps of 0.037 cells with sigma 0.05: 37 cells with variance 2.5. Rounding each step would not
    # move at all.
    model = GaussianShift(cell=2.0, sigma=0.1, edge="wrap")
    belief = np.zeros(200)
    belief[20] = 1.0
    carry = 0.0
    for _ in range(1000):
        if carried:
            belief, carry = model.predict_carried(belief, 0.074, carry)
        else:
            belief = model.predict(belief, 0.074)
    cells = np.arange(200) + carry / 2.0
    mean = belief @ cells
    assert mean == pytest.approx(57.0, abs=1e-9)
    variance = belief @ (cells - mean) ** 2
    excess = 0.0 if carried else 1000 * model.kernel(0.074).excess_variance
    assert variance == pytest.approx(1000 * 0.05**2 + excess, rel=1e-9)
    assert (excess == 0.0) == carried


def test_gaussian_shift_on_a_circle_equals_samples():
    rng = np.random.default_rng(6)
    model = GaussianShift(cell=5.0, sigma=12.0, edge="wrap")
    belief = np.zeros(40)
    belief[37] = 1.0
    for _ in range(3):
        belief = model.predict(belief, 7.0)
    place = (37.5 * 5.0 + rng.normal(7.0, 12.0, (100_000, 3)).sum(axis=1)) % 200.0
    sampled = np.bincount((place // 5.0).astype(int), minlength=40) / 100_000
    # Cells are integrated by sampling and not by the kernel, which differs in the second order of cell /
    # sigma.
    assert np.abs(sampled - belief).max() < 0.0015 + 4 * math.sqrt(belief.max() / 100_000)


@given(st.lists(st.floats(-3, 3), min_size=1, max_size=30))
def test_carried_steps_lose_nothing(displacements):
    carry, total = 0.0, 0
    for displacement in displacements:
        steps, carry = whole_steps(displacement, carry)
        total += steps
        assert abs(carry) <= 0.5
    assert total + carry == pytest.approx(sum(displacements), abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 999), shift=st.integers(-20, 20), control=st.floats(-30, 30), sigma=st.floats(0, 9)
)
def test_prediction_on_a_circle_commutes_with_rotation(seed, shift, control, sigma):
    belief = np.random.default_rng(seed).dirichlet(np.ones(17))
    model = GaussianShift(cell=1.5, sigma=sigma, edge="wrap")
    turned = model.predict(np.roll(belief, shift), control)
    np.testing.assert_allclose(turned, np.roll(model.predict(belief, control), shift), atol=1e-15)


@pytest.mark.parametrize(
    "make",
    [
        lambda: gaussian_kernel(0.0, -1.0),
        lambda: gaussian_kernel(math.nan, 1.0),
        lambda: gaussian_kernel(0.0, 1.0, tail=0.0),
        lambda: Shift(edges=("bounce",)),
        lambda: Shift(edges=("wrap",)).predict(np.ones((2, 2)), (1, 1)),
        lambda: GaussianShift(cell=0.0, sigma=1.0, edge="wrap"),
        lambda: CommandKernel(weights=np.array([0.5, 0.4]), first=(0,)),
        lambda: CommandKernel(weights=np.array([1.5, -0.5]), first=(0,)),
        lambda: KernelMotion(kernels={}, edges=("wrap",)).predict(np.ones(3), "go"),
        lambda: TransitionMatrix(matrices={0: np.array([[0.9, 0.2], [0.0, 1.0]])}),
        lambda: TransitionMatrix(matrices={0: np.array([[1.1, -0.1], [0.0, 1.0]])}),
    ],
    ids=itertools.count(),
)
def test_what_is_no_motion_is_refused(make):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        make()


@given(place=st.integers(0, 59), control=st.floats(-9, 9), sigma=st.floats(0, 4), edge=edges)
def test_prediction_of_a_point_mass_is_the_kernel(place, control, sigma, edge):
    model = GaussianShift(cell=0.7, sigma=sigma, edge=edge)
    point = np.zeros(60)
    point[place] = 1.0
    kernel = model.kernel(control)
    expected = np.zeros(60)
    for k, weight in enumerate(kernel.weights):
        cell = arrive(place + kernel.first + k, 60, edge)
        if cell is not None:
            expected[cell] += weight
    result = model.predict(point, control)
    np.testing.assert_allclose(result, expected, atol=1e-15)
    assert result.sum() <= 1 + 1e-12
    if edge != "lose":
        assert result.sum() == pytest.approx(1.0)
