"""Interfaces between a run of the agent and its localization method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

    from agent.drives.exchange import Exchange
    from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
    from ciberrato.protocol import Actions, Measures


class Responder(Protocol):
    """Interface of a controller that answers messages; see `agent.drives.right.controller.Controller`."""

    @property
    def exchange(self) -> Exchange:
        """The account of messages and answers."""

    @property
    def ended(self) -> str | None:
        """Reason why the run is over, as soon as it is."""

    def observe(
        self, measures: Measures, *, newest: bool = True, arrived: float | None = None
    ) -> tuple[Cycle, Actions | None]:
        """Process one message and decide on the answer."""
        ...

    def sent(self, time: float) -> None:
        """Record when the last answer was sent."""


class Method(Protocol):
    """Interface of a localization method; a session calls it, from top to bottom."""

    def prepare(self) -> bool:
        """Prepare the registration; return whether to go on."""
        ...

    def begin(self) -> None:
        """Start what may take long. The registration is already sent."""

    def announce(self, header: RunHeader) -> None:
        """Process what is known of the run, now that the simulator has answered."""

    def controller(self, header: RunHeader) -> Responder:
        """Return what answers the messages."""
        ...

    thinks_long: bool
    """Whether decisions may take longer than a cycle: then another process answers in time, if one can."""

    drives: bool
    """Whether the robot may drive before the method has decided anything, by its IR sensors alone."""

    log_is_whole: bool
    """Whether the log has all messages of the run; set before `finish`."""

    @property
    def failure(self) -> str | None:
        """Reason why the run cannot go on; None if it can."""

    def report(self, cycle: Cycle) -> None:
        """Report to the user what is new after a cycle."""

    def finish(self, run: RecordedRun | None, reason: str, stop: Callable[[], None]) -> int:
        """Write the belief file; return the exit status.

        Parameters
        ----------
        run : RecordedRun or None
            None if the simulator never answered.
        reason : str
            Reason for the end of the run.
        stop : callable
            Stops the robot.
        """
        ...

    def close(self) -> None:
        """Stop what was started."""
