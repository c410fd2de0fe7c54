"""Commands that a program hands to a simulation; the error for a robot that is not there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from ciberrato.errors import CiberratoError
from ciberrato.protocol import Actions

Wanted = Actions | Iterable[Actions] | tuple[float, float]
_WANTED = "Actions, a list of them, or two motor commands (left, right)"


class UnknownRobotError(CiberratoError, KeyError):
    """There is no robot of that id; a KeyError, too."""

    def __init__(self, robot_id: object, known: Iterable[int]) -> None:
        ids = ", ".join(str(one) for one in known)
        there = f"there are {ids}" if ids else "none has registered"
        super().__init__(f"there is no robot {robot_id!r:.40}; {there}")

    def __str__(self) -> str:
        return str(self.args[0])  # a KeyError would show it in quotes


Record = TypeVar("Record")


def robot_of(robots: Mapping[int, Record], robot_id: int) -> Record:
    """Return the record of a robot; UnknownRobotError if there is none."""
    try:
        return robots[robot_id]
    except (KeyError, TypeError):
        raise UnknownRobotError(robot_id, robots) from None


def messages_of(robot_id: int, wanted: Any) -> Iterable[Actions]:
    """Return the messages of a robot, in order.

    Parameters
    ----------
    robot_id : int
        For the error.
    wanted : Actions, iterable of Actions, or (float, float)
        Two numbers are left and right motor command in units per cycle.

    Returns
    -------
    iterable of Actions

    Raises
    ------
    TypeError
        If it is something else.
    """
    if isinstance(wanted, Actions):
        return (wanted,)
    try:
        parts = tuple(wanted)
    except TypeError:
        parts = (None,)
    if all(isinstance(part, Actions) for part in parts):
        return parts
    if len(parts) == 2 and not isinstance(wanted, str | bytes):
        try:
            left, right = (float(part) for part in parts)
        except (TypeError, ValueError):
            pass
        else:
            if not (math.isnan(left) or math.isnan(right)):
                return (Actions(left_motor=left, right_motor=right),)
    raise TypeError(f"actions of robot {robot_id!r:.20}: {wanted!r:.60} is not {_WANTED}")
