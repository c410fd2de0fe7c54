from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import cast

import pytest

from simulator_stub.robot_transitions import next_state
from simulator_stub.scoring import Scoring
from simulator_stub.world.robot import Robot
from simulator_stub.world.robot_state import RobotState
from simulator_stub.world.simulator_state import SimulatorEvent, SimulatorState, SimulatorStateMachine

S, E, R = SimulatorState, SimulatorEvent, RobotState


def machine_in(state: SimulatorState) -> SimulatorStateMachine:
    machine = SimulatorStateMachine()
    road = {
        S.READY: (),
        S.STOPPED: (E.CLIENT_ACCEPTED,),
        S.RUNNING: (E.CLIENT_ACCEPTED, E.START),
        S.FINISHED: (E.CLIENT_ACCEPTED, E.START, E.TIME_UP),
    }
    for event in road[state]:
        machine.handle(event)
        machine.close_cycle()
    assert machine.current is state
    return machine


@pytest.mark.parametrize(("state", "event"), list(itertools.product(S, E)))
def test_every_event_in_every_state(state: SimulatorState, event: SimulatorEvent) -> None:
    expected = {
        (S.READY, E.CLIENT_ACCEPTED): S.STOPPED,
        (S.STOPPED, E.START): S.RUNNING,
        (S.RUNNING, E.STOP): S.STOPPED,
        (S.RUNNING, E.TIME_UP): S.FINISHED,
    }.get((state, event), state)
    machine = machine_in(state)
    machine.handle(event)
    assert machine.current is state, "a state lasts to the end of its cycle"
    assert machine.coming is expected
    machine.close_cycle()
    assert machine.current is expected


def test_of_start_and_stop_in_one_cycle_the_one_that_counts_in_the_current_state_wins() -> None:
    for first, second in ((E.START, E.STOP), (E.STOP, E.START)):
        stopped, running = machine_in(S.STOPPED), machine_in(S.RUNNING)
        for machine in (stopped, running):
            machine.handle(first)
            machine.handle(second)
        assert stopped.coming is S.RUNNING
        assert running.coming is S.STOPPED


def test_the_end_of_time_wins_over_a_stop() -> None:
    machine = machine_in(S.RUNNING)
    machine.handle(E.STOP)
    machine.handle(E.TIME_UP)
    assert machine.coming is S.FINISHED


def test_robots_may_register_in_every_state_but_running() -> None:
    assert [machine_in(state).registrations_open for state in S] == [True, True, False, True]


def robot(state: RobotState, **changes: object) -> Robot:
    fields: dict[str, object] = {
        "state": state,
        "remembered_state": R.RUNNING,
        "removal_requested": False,
        "end_led": False,
        "returning_led": False,
    }
    return cast(Robot, SimpleNamespace(**fields | changes))


def scoring(*, judges: bool = False, may_return: bool = False) -> Scoring:
    return cast(Scoring, SimpleNamespace(judges_returning=judges, may_return=lambda robot: may_return))


@pytest.mark.parametrize(
    ("state", "simulator", "changes", "expected"),
    [
        (R.STOPPED, S.STOPPED, {}, R.STOPPED),
        (R.STOPPED, S.RUNNING, {}, R.RUNNING),
        (R.STOPPED, S.RUNNING, {"remembered_state": R.RETURNING}, R.RETURNING),
        (R.STOPPED, S.FINISHED, {}, R.RUNNING),
        (R.STOPPED, S.STOPPED, {"end_led": True}, R.STOPPED),
        (R.STOPPED, S.STOPPED, {"removal_requested": True}, R.REMOVED),
        (R.RUNNING, S.RUNNING, {}, R.RUNNING),
        (R.RUNNING, S.FINISHED, {}, R.RUNNING),
        (R.RUNNING, S.STOPPED, {"end_led": True}, R.STOPPED),
        (R.RUNNING, S.RUNNING, {"end_led": True}, R.FINISHED),
        (R.RUNNING, S.FINISHED, {"end_led": True}, R.FINISHED),
        (R.RUNNING, S.STOPPED, {"removal_requested": True}, R.REMOVED),
        (R.RUNNING, S.RUNNING, {"returning_led": True}, R.RUNNING),
        (R.RETURNING, S.RUNNING, {"end_led": True}, R.FINISHED),
        (R.RETURNING, S.STOPPED, {"end_led": True}, R.STOPPED),
        (R.RETURNING, S.RUNNING, {"returning_led": True}, R.RETURNING),
        (R.FINISHED, S.STOPPED, {}, R.FINISHED),
        (R.FINISHED, S.RUNNING, {"end_led": False}, R.FINISHED),
        (R.FINISHED, S.RUNNING, {"removal_requested": True}, R.REMOVED),
        (R.REMOVED, S.RUNNING, {}, R.REMOVED),
    ],
)
def test_robot_states(
    state: RobotState, simulator: SimulatorState, changes: dict[str, object], expected: RobotState
) -> None:
    assert next_state(robot(state, **changes), simulator, scoring()) is expected


def test_where_scoring_judges_it_the_returning_led_begins_a_return_or_ends_the_run() -> None:
    lit = robot(R.RUNNING, returning_led=True)
    assert next_state(lit, S.RUNNING, scoring(judges=True, may_return=True)) is R.RETURNING
    assert next_state(lit, S.RUNNING, scoring(judges=True, may_return=False)) is R.FINISHED
    both = robot(R.RUNNING, returning_led=True, end_led=True)
    assert next_state(both, S.RUNNING, scoring(judges=True, may_return=True)) is R.FINISHED
