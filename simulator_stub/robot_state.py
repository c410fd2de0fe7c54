"""The states of a robot, and everything that leads from one to another.

Nothing but `next_state` chooses a robot's state. It is asked once a cycle, at the very end, after the
messages have gone out: a change shows in the messages of the next cycle.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING

from simulator_stub.simulator_state import SimulatorState

if TYPE_CHECKING:
    from simulator_stub.robot import Robot
    from simulator_stub.scoring import Scoring


class RobotState(Enum):
    """What a robot is doing; the value is the word on the wire."""

    STOPPED = "Stopped"
    RUNNING = "Running"
    WAITING = "Waiting"
    """Belongs to a way of scoring that cannot be chosen; never reached."""
    RETURNING = "Returning"
    FINISHED = "Finished"
    REMOVED = "Removed"

    # That of the name, which Enum takes, is computed in Python, several times a cycle.
    __hash__ = object.__hash__


MOVING = (RobotState.RUNNING, RobotState.RETURNING)
"""The states in which motors move a robot and scores count."""

Condition = Callable[["Robot", SimulatorState, "Scoring"], bool]


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
    for condition, chosen in TRANSITIONS[robot.state]:
        if condition(robot, simulator, scoring):
            return robot.remembered_state if chosen is None else chosen
    return robot.state
