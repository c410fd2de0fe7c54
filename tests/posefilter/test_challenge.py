from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, round_reading, sensor_distances
from ciberrato.localization.belief.estimate import estimate
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.symmetry import PoseScore
from ciberrato.localization.filtering.challenge import HypothesisTest
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.records import FilterStep
from ciberrato.world.parameters import Parameters

RADIANS = tuple(math.radians(angle) for angle in (0.0, 60.0, -60.0, 180.0))
PARAMETERS = Parameters(compass_sensor=False)
TRUE, WRONG, WRONG_TOO = (3.0, 1.0), (7.0, 3.0), (1.0, 5.0)


def states(belief, *places):
    """Take the given places for possible, all with heading 0."""
    lattice = belief.lattice
    squares = [int(np.hypot(lattice.x - x, lattice.y - y).argmin()) for x, y in places]
    belief.set_states(np.zeros(len(squares), np.int64), np.array(squares))


@pytest.fixture
def duel(small_lab, coarse_tables):
    challenger = GridFilter(small_lab, coarse_tables, PARAMETERS)
    states(challenger.belief, TRUE)
    return HypothesisTest(challenger, PoseScore(small_lab, RADIANS, PARAMETERS.obstacle_noise, 0.0))


@pytest.fixture
def step(small_lab):
    """Return what is read at the true pose."""
    distances = sensor_distances(WallMap.from_lab(small_lab), *TRUE, np.array(RADIANS))
    readings = tuple(float(r) for r in round_reading(ideal_reading(distances)))
    return FilterStep(motions=(), infrared=readings, compass=None, ground=None, exponent=0.4, time=0)


def verdict(duel, belief, step):
    for _ in range(60):
        won = duel.judge(estimate(belief), step, belief)
        if won is not None:
            return won
    return None


@pytest.mark.parametrize("places", [(WRONG,), (WRONG, WRONG_TOO)])
def test_the_true_pose_wins_whether_the_champion_is_certain_or_not(coarse_tables, duel, step, places):
    champion = PoseBelief(coarse_tables.lattice)
    states(champion, *places)
    assert estimate(champion).certain == (len(places) == 1)
    assert verdict(duel, champion, step) is True


def test_a_champion_that_has_the_pose_among_others_is_left_in_peace(coarse_tables, duel, step):
    champion = PoseBelief(coarse_tables.lattice)
    states(champion, WRONG, WRONG_TOO, TRUE)
    assert verdict(duel, champion, step) in (None, False)
    assert duel.evidence == 0.0


def test_a_challenger_at_a_wrong_place_loses(coarse_tables, duel, step):
    states(duel.challenger.belief, WRONG)
    champion = PoseBelief(coarse_tables.lattice)
    states(champion, TRUE)
    assert verdict(duel, champion, step) is False


def test_a_challenger_of_the_same_pose_goes(coarse_tables, duel, step):
    champion = PoseBelief(coarse_tables.lattice)
    states(champion, TRUE)
    assert duel.judge(dataclasses.replace(estimate(champion)), step, champion) is False
