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
from ciberrato.localization.filtering.stage import common_codes
from ciberrato.localization.records import FilterSettings, FilterStep
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


CORRIDOR = [(1.0 + 0.8 * k, 1.0) for k in range(8)]
"""Places on a line: a challenger that has them all knows no pose yet."""


def spread_out(lab, tables, places):
    """Return a filter that takes some places for possible."""
    one = GridFilter(lab, tables, PARAMETERS)
    states(one.belief, *places)
    return one


def took_in(one, step, foretold):
    one.last_step, one.foretold = step, foretold
    return one


def test_what_a_belief_foretells_is_the_mean_likelihood_of_its_states(small_lab, coarse_tables, step):
    one = spread_out(small_lab, coarse_tables, [TRUE, WRONG, WRONG_TOO])
    belief, settings = one.belief, FilterSettings()
    belief.weight[:] = 0.5, 0.3, 0.2
    codes = common_codes(PARAMETERS, settings)
    mean = 0.0
    for state, weight in enumerate((0.5, 0.3, 0.2)):
        likelihood = 1.0
        for sensor, reading in enumerate(step.infrared):
            view = coarse_tables.view(sensor, belief.heading_offset)
            code = view[int(belief.bin[state]), int(belief.square[state])]
            likelihood *= math.exp(codes.log_likelihood(reading)[code])
        mean += weight * likelihood
    assert one.stage.log_evidence(step, codes) == pytest.approx(math.log(mean), abs=1e-6)
    assert one.stage.log_evidence(step._replace(infrared=(None,) * 4), codes) is None
    one.belief.set_uniform()
    assert one.stage.log_evidence(step, codes) is None


def test_a_champion_that_foretells_much_worse_is_refuted_before_the_pose_is_known(
    small_lab, coarse_tables, step
):
    duel = HypothesisTest(
        spread_out(small_lab, coarse_tables, CORRIDOR),
        PoseScore(small_lab, RADIANS, PARAMETERS.obstacle_noise, 0.0),
    )
    champion = spread_out(small_lab, coarse_tables, [WRONG_TOO])
    assert estimate(champion.belief).certain
    assert estimate(duel.challenger.belief).probability < 0.2
    took_in(champion, step, -5.0)
    took_in(duel.challenger, step, -1.0)
    duel.compare_forecasts(champion)
    assert duel.forecasts == pytest.approx(2.0)
    assert duel.judge(estimate(champion.belief), step, champion.belief) is None
    for _ in range(3):
        duel.compare_forecasts(champion)
    assert duel.judge(estimate(champion.belief), step, champion.belief) is True


@pytest.mark.parametrize(
    ("place", "foretold", "exponent"),
    [
        (CORRIDOR[4], (-5.0, -1.0), 0.4),  # the challenger has the champion's pose among others
        (WRONG_TOO, (-1.0, -5.0), 0.4),  # the champion foretells better
        (WRONG_TOO, (-5.0, -1.0), 0.0),  # a robot at rest repeats one error
        (WRONG_TOO, (-5.0, None), 0.4),  # the challenger has all poses yet
    ],
)
def test_a_champion_is_not_refuted_by_forecasts_that_say_nothing(
    small_lab, coarse_tables, step, place, foretold, exponent
):
    duel = HypothesisTest(
        spread_out(small_lab, coarse_tables, CORRIDOR),
        PoseScore(small_lab, RADIANS, PARAMETERS.obstacle_noise, 0.0),
    )
    step = step._replace(exponent=exponent)
    champion = took_in(spread_out(small_lab, coarse_tables, [place]), step, foretold[0])
    took_in(duel.challenger, step, foretold[1])
    for _ in range(10):
        duel.compare_forecasts(champion)
        assert duel.judge(estimate(champion.belief), step, champion.belief) in (None, False)
