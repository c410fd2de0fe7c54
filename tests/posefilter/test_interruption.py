"""A gap in which the robot may have been stopped: the mixture against what is counted one by one."""

import math
from collections import Counter

import numpy as np
import pytest

from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.interruption import SURE, Interruption, doubtful_cycles
from ciberrato.localization.tables.pose_tables import build_tables
from ciberrato.physics.kinematics import advance
from ciberrato.protocol import Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

ROOM = Lab(name="room", width=20.0, height=4.0, walls=())
STILL = Parameters(motors_noise=0.0, compass_sensor=False)
POWER = 0.1


@pytest.fixture(scope="module")
def tables():
    return build_tables(ROOM, (0.0,), 0.2)


def follow(tables, commands, gap, **last):
    grid = GridFilter(ROOM, tables, STILL, start="3,2,0")
    grid.observe(Measures(time=0, start=True), None)
    for time, command in enumerate(commands, start=1):
        grid.observe(Measures(time=time, start=True, collision=False), command)
    grid.observe(Measures(time=len(commands) + gap, start=True, **last), commands[-1])
    return grid


def spread(grid):
    """Share of each x, to a tenth."""
    bins, squares, weights = grid.belief.listed()
    x, _ = grid.belief.places(bins, squares)
    shares = Counter()
    for place, weight in zip(np.round(x, 1), weights / weights.sum(), strict=True):
        shares[float(place)] += float(weight)
    return Counter({x: share for x, share in shares.items() if share > 0.003})


def counted(cycles_driven):
    """Where a robot is that drove so many cycles and came to rest, by the wheels' filter."""
    x, wheel = 3.0, 0.0
    for _ in range(cycles_driven):
        wheel = (wheel + POWER) / 2.0
        x, _, _ = advance(x, 2.0, 0.0, wheel, wheel)
    return x


def mean(shares):
    return sum(x * share for x, share in shares.items()) / sum(shares.values())


def enumerated(tables, before, gap):
    """The mean over all moments of the stop, each driven to, heard in every cycle, on its own."""
    shares = Interruption(gap - SURE, collided=False)._shares
    assert shares.sum() == pytest.approx(1.0)
    total = 0.0
    for stopped, share in enumerate(shares):
        cycles = before + SURE + stopped
        total += float(share) * mean(spread(follow(tables, [(POWER, POWER)] * (cycles - 1), 1)))
    return total


@pytest.mark.parametrize("gap", [SURE + 1, SURE + 2, 12, 30])
def test_the_place_after_a_gap_is_spread_over_all_moments_of_the_stop(tables, gap):
    shares = spread(follow(tables, [(POWER, POWER)] * 10, gap))
    assert mean(shares) == pytest.approx(enumerated(tables, 10, gap), abs=0.06)
    for driven in (SURE, gap):  # stopped at once, and never
        there = counted(10 + driven)
        assert sum(share for x, share in shares.items() if abs(x - there) < 0.45) > 0.3


@pytest.mark.parametrize("gap", [1, 2, SURE])
def test_shorter_gaps_are_driven_through(tables, gap):
    assert doubtful_cycles(gap, [(POWER, POWER)]) == 0
    shares = spread(follow(tables, [(POWER, POWER)] * 10, gap))
    assert sum(x * share for x, share in shares.items()) == pytest.approx(counted(10 + gap), abs=0.06)


def test_a_robot_that_stood_is_where_it_was(tables):
    assert doubtful_cycles(100, [(0.0, 0.0), (0.0, 0.0)]) == 0
    shares = spread(follow(tables, [(POWER, POWER)] * 10 + [(0.0, 0.0)] * 30, 100))
    assert max(shares) - min(shares) < 1.3


def test_the_last_command_may_have_been_lost(tables):
    """It was told to drive on, then to turn; if only the first came, it is far away."""
    grid = follow(tables, [(POWER, POWER)] * 10, 1)
    grid.observe(Measures(time=51, start=True), (-POWER, POWER))
    shares = spread(grid)
    far = sum(share for x, share in shares.items() if x > 6.0)
    assert 0.05 < far < 0.25


def test_the_heading_is_spread_too(tables):
    grid = follow(tables, [(0.0, 0.0)] * 3 + [(-POWER, POWER)] * 2, 10)
    headings = Counter()
    for bin_number, weight in enumerate(grid.belief.bin_weights()):
        headings[round(math.degrees(grid.belief.headings()[bin_number]))] += weight
    likely = [heading for heading, weight in headings.items() if weight > 0.01]
    assert len(likely) >= 5
    assert max(likely) - min(likely) > 45


def test_a_collision_says_that_it_was_not_stopped(tables):
    shares = spread(follow(tables, [(POWER, POWER)] * 10, 30, collision=True))
    free = spread(follow(tables, [(POWER, POWER)] * 10, 30))
    assert max(shares.values()) > 0.0
    early = counted(10 + SURE + 1)
    assert sum(w for x, w in shares.items() if abs(x - early) < 0.3) < 0.5 * sum(
        w for x, w in free.items() if abs(x - early) < 0.3
    )
