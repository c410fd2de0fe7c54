"""What every policy gets and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ciberrato.localization.grid_filter import PoseFilter
from ciberrato.protocol.messages import Measures

Command = tuple[float, float]
STANDSTILL: Command = (0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What the robot is to do in the coming cycle.

    Attributes
    ----------
    command : (float, float)
        Left and right motor command in units a cycle.
    end_led, returning_led, visiting_led : bool or None
        LEDs to set; None leaves them.
    finished : str or None
        Why the policy has nothing more to do, as soon as that is so.
    """

    command: Command = STANDSTILL
    end_led: bool | None = None
    returning_led: bool | None = None
    visiting_led: bool | None = None
    finished: str | None = None


class Drive(Protocol):
    """A policy: a pure function of the stream of messages and of the filter that has taken them in."""

    def decide(self, measures: Measures, pose_filter: PoseFilter) -> Decision:
        """Decide what to do in answer to a message that the filter has taken in."""
        ...
