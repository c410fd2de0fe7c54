"""When a robot that hears nothing is to be stopped, and where no clock may have a say."""

import math

import pytest

from ciberrato.client.pace import LOCKSTEP_VARIABLE, Pace


def heard(seconds_a_cycle, cycles=30, cycle_time=50.0, **told):
    pace = Pace(cycle_time, **told)
    for cycle in range(cycles):
        pace.heard(100.0 + cycle * seconds_a_cycle, cycle)
    return pace


@pytest.mark.parametrize(
    ("seconds", "is_real_time"),
    [(0.0, False), (0.002, False), (0.02, False), (0.03, True), (0.05, True), (0.09, True), (0.2, False)],
)
def test_the_pace_tells_real_time_from_lockstep(seconds, is_real_time):
    pace = heard(seconds)
    assert pace.is_real_time is is_real_time
    assert pace.patience == pytest.approx(0.15 if is_real_time else math.inf)


def test_too_few_messages_tell_nothing():
    assert not heard(0.05, cycles=3).is_real_time
    assert heard(0.05, cycles=4).is_real_time


def test_a_burst_after_a_cut_is_still_real_time():
    pace = heard(0.05)
    for cycle in range(30, 40):
        pace.heard(102.0, cycle)
    assert pace.is_real_time


def test_lockstep_can_be_told(monkeypatch):
    monkeypatch.setenv(LOCKSTEP_VARIABLE, "1")
    assert not heard(0.05).is_real_time


def test_what_the_simulator_says_counts_from_the_first_message_on():
    for cycles in (0, 1, 30):
        assert not heard(0.05, cycles, lockstep=True, presumed=True).is_real_time
        assert heard(0.05, cycles, lockstep=True).is_known
        assert heard(0.05, cycles, presumed=True).is_real_time
    assert heard(0.001, 3, presumed=True).is_real_time
    assert not heard(0.001, 4, presumed=True).is_real_time
