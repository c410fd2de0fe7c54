from __future__ import annotations

import math

import numpy as np
import pytest

from ciberrato.localization.belief.estimate import estimate, modes, probability_near, spread
from ciberrato.localization.belief.lattice import Lattice, build_lattice
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.filtering.stage import transfer
from ciberrato.physics.kinematics import advance
from ciberrato.world.lab import Lab


@pytest.fixture(scope="module")
def plain() -> Lattice:
    return build_lattice(Lab(width=12.0, height=12.0), 0.1)


def at(belief: PoseBelief, x: float, y: float, row: int) -> None:
    square = int(np.hypot(belief.lattice.x - x, belief.lattice.y - y).argmin())
    belief.set_states(np.array([row]), np.array([square]))


def poses(belief: PoseBelief) -> np.ndarray:
    bins, squares, weights = belief.listed()
    x = belief.lattice.x[squares] + belief.offset[bins, 0]
    y = belief.lattice.y[squares] + belief.offset[bins, 1]
    return np.stack([x, y, belief.headings()[bins], weights])


def test_a_state_follows_the_wheel_model_exactly_and_does_not_spread(plain):
    belief = PoseBelief(plain)
    at(belief, 6.0, 6.0, 9)
    pose = (6.0, 6.0, math.radians(45.0))
    generator = np.random.default_rng(1)
    for _ in range(120):
        left, right = generator.uniform(-0.05, 0.15, 2)
        belief.drive((left + right) / 2.0, stay_if_blocked=False)
        belief.turn(right - left)
        pose = advance(*pose, left, right)
    x, y, heading, weights = poses(belief)
    assert len(weights) == 1
    assert (x[0], y[0]) == pytest.approx(pose[:2], abs=1e-9)
    assert math.remainder(heading[0] - pose[2], 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_dense_and_listed_beliefs_move_alike(plain):
    generator = np.random.default_rng(2)
    dense, sparse = PoseBelief(plain), PoseBelief(plain)
    chosen = generator.integers(plain.size, size=400), generator.integers(72, size=400)
    sparse.set_weighted(chosen[1], chosen[0], np.ones(400), heading_offset=0.0)
    dense.dense[:] = 0.0
    np.add.at(dense.dense, (chosen[1], chosen[0]), 1.0 / 400)
    for belief in (dense, sparse):
        for _ in range(6):
            belief.drive(0.13, stay_if_blocked=True)
            belief.turn(0.07)
        belief.diffuse_heading(0.01**2)
        belief.diffuse_place(0.05**2, vertical=False)
        belief.diffuse_place(0.05**2, vertical=True)
    table = np.zeros_like(dense.dense, dtype=np.float64)
    np.add.at(table, (sparse.bin, sparse.square), sparse.weight)
    assert np.abs(table - dense.dense).max() < 1e-8
    assert dense.offset == pytest.approx(sparse.offset)


def test_blocked_states_stay_or_go(plain):
    for stay, left in ((True, 1.0), (False, 0.0)):
        belief = PoseBelief(plain)
        at(belief, 11.4, 6.0, 0)
        for _ in range(4):
            belief.drive(0.1, stay_if_blocked=stay)
        assert belief.weight.sum() == left


@pytest.mark.parametrize("vertical", [False, True])
def test_spreading_has_the_variance_asked_for(plain, vertical):
    belief = PoseBelief(plain)
    at(belief, 6.0, 6.0, 0)
    for _ in range(20):
        belief.diffuse_place(0.03**2, vertical=vertical)
    x, y, _, weights = poses(belief)
    along, across = (y, x) if vertical else (x, y)
    assert weights.sum() == pytest.approx(1.0, abs=1e-6)
    assert float((weights * (along - 6.0) ** 2).sum()) == pytest.approx(20 * 0.03**2, rel=1e-4)
    assert np.ptp(across) < 1e-9


def test_spreading_the_heading_has_the_variance_asked_for_and_moves_nothing(plain):
    belief = PoseBelief(plain)
    at(belief, 6.0, 6.0, 18)
    for _ in range(7):
        belief.drive(0.137, stay_if_blocked=False)  # the bins now have offsets of their own
    before = poses(belief)
    for _ in range(10):
        belief.diffuse_heading(math.radians(1.0) ** 2)
    x, y, heading, weights = poses(belief)
    turned = math.degrees(1.0) * (heading - before[2][0])
    assert float((weights * turned**2).sum()) == pytest.approx(10.0, rel=1e-4)
    assert math.sqrt(float((weights * (x - before[0][0]) ** 2).sum())) < 0.04
    assert float((weights * x).sum()) == pytest.approx(before[0][0], abs=0.02)
    assert float((weights * y).sum()) == pytest.approx(before[1][0], abs=0.02)


def test_pruning_gives_up_no_more_than_it_says(plain):
    belief = PoseBelief(plain, prune=1e-3)
    generator = np.random.default_rng(4)
    belief.dense[:, :-1] = generator.lognormal(0.0, 6.0, belief.dense[:, :-1].shape)
    belief.normalize()
    belief.prune()
    assert belief.dense is None
    assert 0.0 < belief.given_up <= 1e-3
    assert belief.weight.sum() == pytest.approx(1.0 - belief.given_up, abs=1e-5)


def test_nothing_left_is_everything_again(plain):
    belief = PoseBelief(plain)
    at(belief, 6.0, 6.0, 0)
    belief.weight[:] = 0.0
    assert belief.normalize() == 0.0
    assert belief.states == 72 * plain.size


def test_an_estimate_is_the_mean_around_the_best_state_and_counts_what_is_near(plain):
    belief = PoseBelief(plain)
    size = plain.size
    rows, squares, weights = [], [], []
    for x, y, row, weight in (
        (3.0, 3.0, 0, 0.4),
        (3.2, 3.0, 0, 0.2),
        (3.0, 3.0, 1, 0.1),
        (9.0, 9.0, 36, 0.3),
    ):
        rows.append(row)
        squares.append(int(np.hypot(plain.x - x, plain.y - y).argmin()))
        weights.append(weight)
    assert max(squares) < size
    belief.set_weighted(np.array(rows), np.array(squares), np.array(weights), heading_offset=0.0)
    found = estimate(belief)
    assert (found.x, found.y) == pytest.approx((3.0 + 0.04 / 0.7, 3.0), abs=1e-5)
    assert math.degrees(found.heading) == pytest.approx(5.0 * 0.1 / 0.7, abs=1e-4)
    assert found.probability == pytest.approx(0.7, abs=1e-6)
    assert found.cell == (1, 1)
    assert not found.certain
    both = modes(belief)
    assert [mode.probability for mode in both] == pytest.approx([0.7, 0.3], abs=1e-6)
    assert probability_near(belief, 9.1, 9.0, math.pi) == pytest.approx(0.3, abs=1e-6)
    # Around the first the places are 3.0, 3.0 and 3.2, the headings 0, 5 and 0, weighted by 4, 1 and 2.
    place, turn = spread(belief, found)
    variance = 0.2**2 * (2.0 / 7.0) * (5.0 / 7.0)  # of one axis; none along the other
    assert place == pytest.approx(math.sqrt(variance / 2.0), abs=1e-5)
    assert math.degrees(turn) == pytest.approx(5.0 * math.sqrt((1.0 / 7.0) * (6.0 / 7.0)), abs=1e-3)
    assert spread(belief, both[1]) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_belief_goes_over_to_a_finer_lattice_with_its_mean_and_weight():
    lab = Lab(width=12.0, height=12.0)
    coarse, fine = build_lattice(lab, 2.0 / 9.0), build_lattice(lab, 0.1)
    source, target = PoseBelief(coarse), PoseBelief(fine, uniform=False)
    at(source, 5.0, 7.0, 4)
    source.turn(0.02)
    source.drive(0.09, stay_if_blocked=False)
    transfer(source, target)
    before, after = poses(source), poses(target)
    assert after[3].sum() == pytest.approx(1.0, abs=1e-6)
    assert (after[:2] * after[3]).sum(axis=1) == pytest.approx(before[:2, 0], abs=0.06)
    assert after[2] == pytest.approx(before[2, 0])
    assert np.abs(after[0] - before[0, 0]).max() <= 1.0 / 9.0 + 0.05
