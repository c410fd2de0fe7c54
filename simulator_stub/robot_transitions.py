"""Everything that leads a robot from one state to another, in one table.

Nothing but `next_state` chooses a robot's state. It is asked once a cycle, at the very end, after the
messages have gone out: a change shows in the messages of the next cycle.
"""

from __future__ import annotations

from collections.abc import Callable

from simulator_stub.scoring.base import Scoring
from simulator_stub.world.robot import Robot
from simulator_stub.world.robot_state import RobotState
from simulator_stub.world.simulator_state import SimulatorState

Condition = Callable[[Robot, SimulatorState, Scoring], bool]


def _removed(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> bool:
    return robot.removal_requested


def _stopped(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> bool:
    return simulator is SimulatorState.STOPPED


def _going_on(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> bool:
    return simulator is not SimulatorState.STOPPED


def _end_led(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> bool:
    return robot.end_led


def _returns(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> bool:
    return robot.returning_led and scoring.judges_returning and scoring.may_return(robot)


def _returns_wrongly(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> bool:
    return robot.returning_led and scoring.judges_returning


# For each state the conditions are tried in this order; the first that holds decides. None stands for the
# state that the robot had before it was stopped.
TRANSITIONS: dict[RobotState, tuple[tuple[Condition, RobotState | None], ...]] = {
    RobotState.STOPPED: ((_removed, RobotState.REMOVED), (_going_on, None)),
    RobotState.RUNNING: (
        (_removed, RobotState.REMOVED),
        (_stopped, RobotState.STOPPED),
        (_end_led, RobotState.FINISHED),
        (_returns, RobotState.RETURNING),
        (_returns_wrongly, RobotState.FINISHED),
    ),
    RobotState.RETURNING: (
        (_removed, RobotState.REMOVED),
        (_stopped, RobotState.STOPPED),
        (_end_led, RobotState.FINISHED),
    ),
    RobotState.FINISHED: ((_removed, RobotState.REMOVED),),
    RobotState.WAITING: ((_removed, RobotState.REMOVED),),
    RobotState.REMOVED: (),
}


def next_state(robot: Robot, simulator: SimulatorState, scoring: Scoring) -> RobotState:
    """Choose the state of a robot for the next cycle.

    Parameters
    ----------
    robot : Robot
        Its LEDs, its removal flag and the state that it remembers are looked at.
    simulator : SimulatorState
        The simulator's state in the next cycle.
    scoring : Scoring
        Decides what the returning LED means.

    Returns
    -------
    RobotState
    """
    state = robot.state
    if (
        (state is RobotState.RUNNING or state is RobotState.RETURNING)
        and simulator is SimulatorState.RUNNING
        and not (robot.removal_requested or robot.end_led or robot.returning_led)
    ):
        return state  # no condition holds: so it is in nearly every cycle
    for condition, chosen in TRANSITIONS[state]:
        if condition(robot, simulator, scoring):
            return robot.remembered_state if chosen is None else chosen
    return state
