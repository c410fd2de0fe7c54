"""The core of `Robot`, message by message."""

import pytest

from ciberrato.client.core import RobotCore, RunEnd
from ciberrato.errors import UsageError
from ciberrato.protocol import Acceptance, Actions, Measures
from ciberrato.world.parameters import Parameters


@pytest.fixture
def core():
    core = RobotCore("r2", angles=(0, 90, -90, 180))
    core.accept(Acceptance(parameters=Parameters(sim_time=100)))
    return core


def running(time, **more):
    return Measures(time=time, start=True, **more)


def test_motors_are_0_until_start_and_in_a_pause(core):
    core.drive(0.1, 0.05)
    assert core.take([Measures(time=0, stop=True)]) is None
    assert core.answer() == Actions(left_motor=0.0, right_motor=0.0)
    assert core.take([running(0)]) == running(0)
    assert core.answer() == Actions(left_motor=0.1, right_motor=0.05)
    assert core.take([Measures(time=1, stop=True)]) is None
    assert core.answer() == Actions(left_motor=0.0, right_motor=0.0)


def test_the_newest_measures_win_and_what_is_missing_is_counted(core):
    assert core.take([running(1), running(2), running(5)]) == running(5)
    assert (core.lost, core.skipped, core.stale) == (2, 2, 0)
    assert core.take([running(8)]) == running(8)
    assert (core.lost, core.skipped) == (4, 2)


def test_late_measures_are_ignored_and_counted(core):
    core.take([running(80)])
    assert core.take([running(79), running(0), running(20)]) is None
    assert (core.stale, core.ended, core.measures) == (3, None, running(80))
    assert core.take([running(81)]) == running(81)


def test_measures_that_come_twice_are_shown_and_answered_once(core):
    assert core.take([running(80), running(80)]) == running(80)
    assert core.take([running(80)]) is None
    assert (core.stale, core.skipped) == (2, 0)
    # Before Start the time stands still, and every message counts.
    assert core.take([Measures(time=80, stop=True)]) is None
    assert core.take([Measures(time=80, stop=True)]) is None
    assert core.stale == 2


def test_several_messages_in_a_row_have_to_say_that_a_new_run_has_begun(core):
    core.take([running(80)])
    assert core.take([running(0)]) is None
    assert core.take([running(81)]) is not None
    core.take([running(0), running(1), running(2)])
    assert core.ended is RunEnd.BEGUN_AGAIN


@pytest.mark.parametrize(
    ("measures", "end"),
    [
        (running(5, end_led=True), RunEnd.FINISHED),
        (running(100), RunEnd.TIME_UP),
        (Measures(time=95), RunEnd.OVER),
    ],
)
def test_what_ends_a_run(core, measures, end):
    core.drive(0.1, 0.1)
    assert core.take([running(4 if measures.time < 50 else 94)]) is not None
    assert core.take([measures]) is None
    assert core.ended is end
    assert core.answer().left_motor == 0.0


def test_what_lasts_one_cycle_goes_out_once(core):
    core.take([running(1)])
    core.set_led("visiting_led", True)
    core.say("here")
    core.request("Compass")
    wanted = Actions(left_motor=0.0, right_motor=0.0, visiting_led=True, say="here", requests=("Compass",))
    assert core.answer() == wanted
    core.take([running(2)])
    assert core.answer() == Actions(left_motor=0.0, right_motor=0.0)


def test_sensors_on_request_are_asked_for_in_turn():
    core = RobotCore("r2")
    parameters = Parameters(obstacle_requestable=True, ground_requestable=True, requests_per_cycle=2)
    core.accept(Acceptance(parameters=parameters))
    asked = []
    for time in range(5):
        core.take([running(time)])
        asked += core.answer().requests
    assert asked == [*("IRSensor0", "IRSensor1", "IRSensor2", "IRSensor3", "Ground") * 2]


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: RobotCore("a\nb"), "printable"),
        (lambda: RobotCore("x" * 201), "200"),
        (lambda: RobotCore("r2", position=-1), "position -1"),
        (lambda: RobotCore("r2", position=1.5), "position 1.5"),
        (lambda: RobotCore("r2", angles=(0, 60, 120)), r"\(0, 60, 120\): four angles"),
        (lambda: RobotCore("r2", angles=(0, 60, -60, float("nan"))), r"nan\): four angles"),
        (lambda: RobotCore("r2", angles=5), "angles 5: four angles"),
        (lambda: RobotCore("r2").drive("fast", 0), "left motor: 'fast'"),
        (lambda: RobotCore("r2").drive(0, float("nan")), "right motor: nan"),
        (lambda: RobotCore("r2").say("x" * 101), "at most 100"),
    ],
)
def test_what_cannot_be_used_is_named(make, what):
    with pytest.raises(UsageError, match=what):
        make()


def test_a_time_beyond_the_run_is_a_corrupted_message(core):
    assert core.take([running(1), running(2**31 - 1)]) == running(1)
    assert (core.ended, core.stale, core.lost) == (None, 1, 0)
    assert core.take([running(2)]) == running(2)
    assert core.take([running(60), running(3)]) == running(3)
    assert (core.stale, core.lost) == (2, 0)
    assert core.take([running(100), running(101)]) is None
    assert core.ended is RunEnd.TIME_UP
