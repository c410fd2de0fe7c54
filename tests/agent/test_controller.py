"""The controller: phases, buttons, what ends a run, and what it asks for."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from agent.drives.right.controller import Controller
from agent.drives.right.phases import TRANSITIONS, Event, Phase
from ciberrato.files.run_records import RunHeader
from ciberrato.protocol import Actions, Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

HeaderFor = Callable[..., RunHeader]
PARAMETERS = Parameters(motors_noise=0.0)
OPEN = (0.6, 2.5, 2.5, 0.6)


@pytest.fixture
def controller(header_for: HeaderFor) -> Controller:
    return Controller(header_for(PARAMETERS, (0.0, 90.0, -90.0, 180.0), 0.1))


def measures(time: int, *, start: bool = True, stop: bool = False, **values: Any) -> Measures:
    return Measures(time=time, start=start, stop=stop, **{"compass": 0.0, "infrared": OPEN, **values})


def test_it_waits_for_start_then_drives(controller: Controller) -> None:
    cycle, actions = controller.observe(measures(0, start=False, stop=True))
    assert actions == Actions(left_motor=0.0, right_motor=0.0)
    assert controller.phase is Phase.WAITING
    assert cycle.step == 0
    _, actions = controller.observe(measures(0))
    assert actions == Actions(left_motor=0.1, right_motor=0.1)
    assert controller.phase is Phase.DRIVING


def test_stop_stops_it_and_start_lets_it_go_on(controller: Controller) -> None:
    for time in range(5):
        controller.observe(measures(time))
    _, actions = controller.observe(measures(5, start=False, stop=True))
    assert actions == Actions(left_motor=0.0, right_motor=0.0)
    for _ in range(10):
        controller.observe(measures(5, start=False, stop=True))
    place = controller.tracker.pose.along
    _, actions = controller.observe(measures(5))
    assert controller.tracker.pose.along == place
    assert actions is not None
    assert actions.left_motor == pytest.approx(0.1, abs=0.005)
    # The wheels' filter was kept, too: the next cycle is driven with 0.1 on top of what they gave before.
    speed = controller.tracker.speed
    controller.observe(measures(6))
    assert controller.tracker.speed == pytest.approx((speed + (actions.left_motor or 0.0)) / 2.0)


def test_only_the_newest_message_is_answered(controller: Controller) -> None:
    cycle, actions = controller.observe(measures(0), newest=False)
    assert actions is None
    assert not cycle.answered
    assert cycle.command is None
    cycle, actions = controller.observe(measures(1))
    assert actions is not None
    assert cycle.answered
    assert controller.exchange.unanswered == 1


def test_lost_cycles_are_counted(controller: Controller) -> None:
    for time in (0, 0, 1, 4, 5, 9):
        controller.observe(measures(time))
    assert controller.exchange.lost == 2 + 3


def test_a_message_that_comes_late_is_logged_and_nothing_else(controller: Controller) -> None:
    for time in (0, 1, 2):
        controller.observe(measures(time))
    before = controller.tracker.pose
    cycle, _ = controller.observe(measures(1), newest=False)
    assert cycle.time == 1
    assert controller.tracker.pose == before
    assert controller.ended is None
    controller.observe(measures(3))
    assert controller.exchange.lost == 0


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (measures(7, end_led=True), "EndLed is on"),
        (measures(7, start=False, stop=False), "the simulation is over"),
    ],
)
def test_what_ends_a_run(controller: Controller, message: Measures, reason: str) -> None:
    for time in range(6):
        controller.observe(measures(time))
    assert controller.ended is None
    cycle, actions = controller.observe(message)
    assert controller.ended == reason
    assert actions is None
    assert not cycle.answered


def test_time_is_up(controller: Controller) -> None:
    controller.observe(measures(1799))
    assert controller.ended is None
    assert controller.observe(measures(1800))[1] is None
    assert controller.ended == "the run's time is up"


def test_several_messages_have_to_say_that_another_run_has_begun(controller: Controller) -> None:
    controller.observe(measures(90))
    for time in (0, 91, 3, 1, 92, 0, 1):
        controller.observe(measures(time))
        assert controller.ended is None
    assert (controller.exchange.time, controller.exchange.stale) == (92, 5)
    controller.observe(measures(2))
    assert controller.ended == "the simulator has begun again"


def test_a_leap_ahead_has_to_be_confirmed(controller: Controller) -> None:
    controller.observe(measures(5))
    assert controller.observe(measures(57))[1] is None
    controller.observe(measures(6))
    assert controller.exchange.time == 6
    controller.observe(measures(70))
    controller.observe(measures(71))
    exchange = controller.exchange
    assert (exchange.time, exchange.lost, exchange.longest_gap, exchange.stale) == (71, 64, 64, 1)


def test_before_the_start_both_buttons_off_do_not_end_it(controller: Controller) -> None:
    controller.observe(measures(0, start=False, stop=False))
    assert controller.ended is None


def test_a_run_without_time_limit_does_not_end(header_for: HeaderFor) -> None:
    controller = Controller(header_for(replace(PARAMETERS, sim_time=0), (0.0, 90.0, -90.0, 180.0), 0.1))
    controller.observe(measures(0))
    controller.observe(measures(5000))
    assert controller.ended is None


@pytest.mark.parametrize("exit_at_wall", [True, False])
def test_before_a_wall_it_stands_in_the_centre(
    drive: Any, corridors: Lab, header_for: HeaderFor, exit_at_wall: bool
) -> None:
    (run,) = drive(corridors, [(21.0, 7.0, 0.0)], PARAMETERS, seed=1)
    assert run.controller.ended == "a wall is ahead"
    assert run.controller.phase is Phase.HOLDING
    assert run.steps == 4
    assert run.truth[-1] == pytest.approx((6.0, 0.0, 0.0), abs=1e-3)
    assert run.collisions == 0
    if not exit_at_wall:
        stays = Controller(header_for(PARAMETERS, (0.0, 90.0, -90.0, 180.0), 0.1))
        for cycle in run.cycles:
            _, actions = stays.observe(
                measures(cycle.time, infrared=cycle.infrared, compass=cycle.compass, stop=cycle.stop)
            )
        for number in range(1, 51):
            _, actions = stays.observe(measures(cycle.time + number, infrared=cycle.infrared))
            assert actions == Actions(left_motor=0.0, right_motor=0.0)
        assert stays.phase is Phase.HOLDING
        assert stays.ended is None


def test_it_gives_up_when_stuck(header_for: HeaderFor) -> None:
    controller = Controller(header_for(PARAMETERS, (0.0, 90.0, -90.0, 180.0), 0.1), exit_at_wall=True)
    for time in range(100):
        controller.observe(measures(time, collision=time > 10))
        if controller.ended is not None:
            break
    assert controller.ended == "stuck"
    assert 45 < time < 55


def test_readings_on_request_are_asked_for_in_turn(header_for: HeaderFor) -> None:
    parameters = replace(
        PARAMETERS, obstacle_requestable=True, compass_requestable=True, requests_per_cycle=2
    )
    controller = Controller(header_for(parameters, (0.0, 90.0, -90.0, 180.0), 0.1))
    asked = []
    for time in range(5):
        _, actions = controller.observe(measures(time))
        assert actions is not None
        assert len(actions.requests) == 2
        asked += actions.requests
    assert sorted(asked) == sorted(2 * [*(f"IRSensor{sensor}" for sensor in range(4)), "Compass"])


@pytest.mark.parametrize("allowed", [0, 9])
def test_requests_stay_within_what_is_allowed_and_needed(header_for: HeaderFor, allowed: int) -> None:
    parameters = replace(PARAMETERS, compass_requestable=True, requests_per_cycle=allowed)
    controller = Controller(header_for(parameters, (0.0, 90.0, -90.0, 180.0), 0.1))
    for time in range(3):
        _, actions = controller.observe(measures(time, compass=None))
        assert actions is not None
        assert actions.requests == (("Compass",) if allowed else ())


def test_the_same_messages_give_the_same_run(drive: Any, standard: Lab) -> None:
    first, second = (drive(standard, [(5.0, 7.0, 0.0)], Parameters(), seed=3)[0] for _ in range(2))
    assert first.cycles == second.cycles


def test_every_phase_can_be_left_but_the_last() -> None:
    assert {phase for phase, _ in TRANSITIONS} == set(Phase) - {Phase.HOLDING}
    assert {event for _, event in TRANSITIONS} == set(Event)


def test_a_command_acts_in_the_first_cycle_whose_message_came_after_it_had_left(controller):
    controller.observe(measures(0))
    controller.sent(10.0)
    first = controller.exchange.command_in_effect(None)
    assert controller.exchange.command_in_effect(9.999) is None
    assert controller.exchange.command_in_effect(10.001) == first
    controller.observe(measures(1), arrived=10.05)
    controller.sent(10.2)  # this process had no time: two more cycles were simulated meanwhile
    second = controller.exchange.command_in_effect(None)
    assert controller.exchange.command_in_effect(10.1) == first
    assert controller.exchange.command_in_effect(10.25) == second
