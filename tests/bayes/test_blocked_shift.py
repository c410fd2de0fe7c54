"""Cell steps with walls, against a transition matrix walked entry by entry."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings

DELTA = {"east": (0, 1), "west": (0, -1), "north": (1, 0), "south": (-1, 0)}


def is_open(openings, r, c, direction):
    """Look one step's opening up, cell by cell, in the arrays as documented."""
    rows, columns = openings.shape
    if direction == "east":
        return c < openings.east.shape[1] and bool(openings.east[r, c])
    if direction == "north":
        return r < openings.north.shape[0] and bool(openings.north[r, c])
    if direction == "west":
        before = (c - 1) % columns
        return before < openings.east.shape[1] and bool(openings.east[r, before])
    before = (r - 1) % rows
    return before < openings.north.shape[0] and bool(openings.north[before, c])


def dense(openings, direction, steps, arrival, blocked):
    rows, columns = openings.shape
    matrix = np.zeros((rows * columns, rows * columns))
    for r in range(rows):
        for c in range(columns):
            for slip, probability in arrival.items():
                y, x, lost = r, c, False
                for _ in range(max(0, steps + slip)):
                    if is_open(openings, y, x, direction):
                        y, x = (y + DELTA[direction][0]) % rows, (x + DELTA[direction][1]) % columns
                    elif blocked == "lose":
                        lost = True
                if not lost:
                    matrix[r * columns + c, y * columns + x] += probability
    return matrix


@settings(max_examples=60, deadline=None)
@given(
    rows=st.integers(1, 4), columns=st.integers(1, 5), round_about=st.booleans(),
    seed=st.integers(0, 999), direction=st.sampled_from(sorted(DELTA)), steps=st.integers(0, 3),
    blocked=st.sampled_from(["stay", "lose"]),
    arrival=st.sampled_from([{0: 1.0}, {-1: 0.2, 0: 0.7, 1: 0.1}, {-2: 0.5, 2: 0.5}]),
)  # fmt: skip
def test_every_entry_equals_the_walk(rows, columns, round_about, seed, direction, steps, blocked, arrival):
    rng = np.random.default_rng(seed)
    openings = Openings(
        east=rng.random((rows, columns if round_about else columns - 1)) < 0.7,
        north=rng.random((rows if round_about else rows - 1, columns)) < 0.7,
    )
    model = BlockedShift(openings=openings, blocked=blocked, arrival=arrival)
    ours = [
        model.predict(np.eye(rows * columns)[i].reshape(rows, columns), (direction, steps)).ravel()
        for i in range(rows * columns)
    ]
    expected = dense(openings, direction, steps, arrival, blocked)
    np.testing.assert_allclose(ours, expected, atol=1e-15)
    belief = rng.dirichlet(np.ones(rows * columns))
    result = model.predict(belief.reshape(rows, columns), (direction, steps)).ravel()
    np.testing.assert_allclose(result, belief @ expected, atol=1e-15)
    assert (result >= 0).all()
    assert result.sum() == pytest.approx(1.0) if blocked == "stay" else result.sum() <= 1 + 1e-12


def test_a_direction_alone_is_one_step():
    model = BlockedShift(openings=Openings.free(2, 3))
    belief = np.array([[0.1, 0.2, 0.3], [0.4, 0.0, 0.0]])
    np.testing.assert_allclose(model.predict(belief, "east"), [[0.0, 0.1, 0.5], [0.0, 0.4, 0.0]])
    np.testing.assert_allclose(model.predict(belief, "south"), [[0.5, 0.2, 0.3], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    "make",
    [
        lambda: Openings(east=np.ones((2, 2)), north=np.ones((2, 3))[:0]),
        lambda: Openings(east=np.ones(3), north=np.ones((1, 3))),
        lambda: BlockedShift(openings=Openings.free(2, 2), blocked="bounce"),
        lambda: BlockedShift(openings=Openings.free(2, 2), arrival={0: 0.9}),
        lambda: BlockedShift(openings=Openings.free(2, 2)).predict(np.ones((3, 2)), "east"),
        lambda: BlockedShift(openings=Openings.free(2, 2)).predict(np.ones((2, 2)), "up"),
        lambda: BlockedShift(openings=Openings.free(2, 2)).predict(np.ones((2, 2)), ("east", -1)),
    ],
    ids=itertools.count(),
)
def test_what_does_not_fit_is_refused(make):
    with pytest.raises(ValueError):  # noqa: PT011  each has its own words
        make()
