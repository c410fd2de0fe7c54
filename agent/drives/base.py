"""Interface of all drives: arguments and decisions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from ciberrato.physics.kinematics import STANDSTILL, Command

if TYPE_CHECKING:
    # A process that only answers drives without the filter, and starts faster without numpy.
    from ciberrato.localization.filtering.grid_filter import GridFilter
    from ciberrato.protocol.messages import Measures
    from ciberrato.world.lab import Lab
    from ciberrato.world.parameters import Parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Decision of a drive for the coming cycle.

    Attributes
    ----------
    command : (float, float)
        Left and right motor command in units per cycle.
    end_led, returning_led, visiting_led : bool or None
        LEDs to set; None leaves them.
    finished : str or None
        Reason why the policy has nothing more to do, as soon as there is one.
    """

    command: Command = STANDSTILL
    end_led: bool | None = None
    returning_led: bool | None = None
    visiting_led: bool | None = None
    finished: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSetup:
    """Arguments of a drive's factory.

    Attributes
    ----------
    lab : Lab
    parameters : Parameters
        As announced.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    argument : object
        Value read by the drive's `agent.drives.registry.DriveKind.argument`; None if it takes nothing.
    cruise : float
        Motor command for driving straight on, in units per cycle.
    stop_when_localized : bool
        Whether a drive that seeks the pose stands still once it is known.
    """

    lab: Lab
    parameters: Parameters
    angles: tuple[float, float, float, float]
    argument: Any = None
    cruise: float = 0.1
    stop_when_localized: bool = True


class Drive(Protocol):
    """A policy: a pure function of the stream of messages and of the filter that has taken them in."""

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        """Decide what to do in answer to a message that the filter has taken in."""
        ...
