"""Angles brought in, against exact fractions of a turn; the wheel filter on a pair, against that on one."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ciberrato.geometry.angles import short_turn, short_turns, wrap_each_once, wrap_once
from ciberrato.physics.kinematics import MAX_POWER, filter_power, filter_wheels, wrap_angle

angles = st.floats(-60.0, 60.0)


def by_fractions(angle):
    """Take all whole turns off exactly, for the turn that `math.pi` is."""
    turn = 2 * Fraction(math.pi)
    return float(Fraction(angle) - turn * round(Fraction(angle) / turn))


@given(angles)
def test_a_short_turn_is_what_is_left_of_all_whole_turns(angle):
    assert short_turn(angle) == by_fractions(angle)
    assert short_turns(np.array([angle]))[0] == pytest.approx(by_fractions(angle), abs=1e-13)


@given(st.floats(-math.pi, math.pi))
def test_what_is_within_half_a_turn_stays_as_it_is(angle):
    assert short_turn(angle) == angle == short_turns(np.array([angle]))[0]
    assert wrap_once(angle) == angle == wrap_each_once(np.array([angle]))[0]


@given(st.lists(angles, max_size=5))
def test_arrays_are_wrapped_once_as_numbers_are_to_the_last_bit(some):
    one_by_one = [wrap_once(angle).hex() for angle in some]
    assert [angle.hex() for angle in wrap_each_once(np.array(some)).tolist()] == one_by_one
    assert [angle.hex() for angle in wrap_angle(np.array(some)).tolist()] == one_by_one


def test_two_turns_take_two_cycles_to_come_in():
    assert wrap_once(math.radians(720.0)) == pytest.approx(2 * math.pi)
    assert short_turn(math.radians(720.0)) == pytest.approx(0.0, abs=1e-15)


@given(*[st.floats(-1.0, 1.0)] * 2, *[st.floats(-MAX_POWER, MAX_POWER)] * 2)
def test_a_pair_of_wheels_is_two_wheels_and_commands_are_clamped(left, right, left_before, right_before):
    found = filter_wheels((left, right), (left_before, right_before))
    clamped = [sorted((-MAX_POWER, command, MAX_POWER))[1] for command in (left, right)]
    assert found == (filter_power(clamped[0], left_before), filter_power(clamped[1], right_before))
