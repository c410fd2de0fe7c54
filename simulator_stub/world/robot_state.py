"""The states of a robot; `simulator_stub.robot_transitions` has what leads from one to another."""

from __future__ import annotations

from enum import Enum


class RobotState(Enum):
    """States of a robot; the value is the word on the wire."""

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

OUT = (RobotState.FINISHED, RobotState.REMOVED)
"""The states from which a robot does not come back, and in which it is not waited for."""
