"""A drive that others wrote: what it decides is looked at before it is sent."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from agent.drives.base import Decision, DriveSetup
from ciberrato.errors import CiberratoError, UsageError
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.plugins import failure
from ciberrato.protocol.messages import Measures


class OwnDrive:
    """Makes a drive and asks it; what it raises or returns wrongly is reported in one line.

    Parameters
    ----------
    label : str
        For messages.
    make : callable
        Function of a `DriveSetup`; returns an object with ``decide(measures, pose_filter)``, which returns a
        `Decision`, or a pair: left and right motor command in units per cycle.
    setup : DriveSetup
    """

    def __init__(self, label: str, make: Callable[[DriveSetup], Any], setup: DriveSetup) -> None:
        self._label = label
        try:
            self._drive = make(setup)
        except CiberratoError:
            raise
        except Exception as error:
            raise failure(label, error) from None
        if not callable(getattr(self._drive, "decide", None)):
            shown = f"{self._drive!r:.60}"
            raise UsageError(f"{label}: what it makes is {shown}, which has no method decide")

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        """Decide on a command, see `agent.drives.base.Drive`."""
        try:
            decision = self._drive.decide(measures, pose_filter)
        except CiberratoError:
            raise
        except Exception as error:
            raise failure(f"{self._label} at time {measures.time}", error) from None
        if isinstance(decision, Decision):
            command: Any = decision.command
        else:
            command, decision = decision, None
        try:
            left, right = (float(power) for power in command)
            if math.isfinite(left) and math.isfinite(right):
                return Decision(command=(left, right)) if decision is None else decision
        except (TypeError, ValueError):
            pass
        raise UsageError(
            f"{self._label} at time {measures.time} decided {command!r:.60}; "
            "it returns a Decision, or the commands of two motors"
        )
