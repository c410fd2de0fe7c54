"""Scripts of the examiner, one for each row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ciberrato.grading.conformance.desk import Desk, Fault, Gone
from ciberrato.grading.conformance.rows import CYCLES, LONG, MOST_UNASKED, QUIET, STOPPED, Ending
from ciberrato.protocol import Measures, RobotRegistration
from ciberrato.reprs import short_repr

WHILE_STOPPED = 0.05
"""Seconds that a stopped cycle takes, CycleTime; agents need not answer these."""

_AFTER_RESTART = 5
"""Measures of a new run that an agent may take to notice it."""

_DOUBT = 0.5
"""Seconds that an answer is waited for which need not come."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Observation that is no fault.

    Attributes
    ----------
    text : str
    ending : {"any", "itself", "clean"}
        Required end of the agent.
    """

    __repr__ = short_repr

    text: str
    ending: Ending = "any"


class Examination:
    """One row.

    Parameters
    ----------
    desk : Desk
    patience : float
        Seconds that an answer may take.
    registered : callable
        Called when the agent has registered.
    """

    def __init__(self, desk: Desk, patience: float, registered: Callable[[str], None]) -> None:
        self.desk = desk
        self._patience = patience
        self._registered = registered

    def examine(self, row: str) -> Seen:
        """Check one row.

        Parameters
        ----------
        row : str
            Its name.

        Returns
        -------
        Seen

        Raises
        ------
        Fault
            If the agent has failed.
        """
        script: Callable[[], Seen] = getattr(self, "_" + row.replace("-", "_"))
        self._last: Measures | None = None
        try:
            return script()
        except Gone:
            when = "when it registered" if self._last is None else f"at time {self._last.time}"
            raise Fault(f"it was gone {when}") from None

    # --- rows -------------------------------------------------------------------------------------

    def _register(self) -> Seen:
        registration = self.desk.await_registration()
        self._registered(repr(registration.name))
        if not registration.name:
            raise Fault("the registration has no Name")
        self._deliver(self.desk.accept(registration))
        self._start()
        self._run(CYCLES)
        others = self.desk.registrations()
        if others:
            raise Fault(f"it has registered {1 + len(others)} robots, not one")
        place = f"position {registration.robot_id}" if registration.robot_id else "the first free position"
        return Seen(f"registered as {registration.name!r} at {place}, and drove {CYCLES} cycles")

    def _refused(self) -> Seen:
        registration = self.desk.await_registration()
        self._registered(repr(registration.name))
        self.desk.refuse()
        return Seen("refused", "itself")

    def _answers(self) -> Seen:
        self._begin()
        self._run(LONG)
        return Seen(f"answered {LONG} of {LONG} cycles")

    def _unasked(self) -> Seen:
        self._begin()
        self._run(CYCLES)
        # What belongs to the last answer is given a cycle's time.
        self.desk.take(WHILE_STOPPED, until_first=False)
        count = self.desk.take(QUIET, until_first=False)
        if count > MOST_UNASKED:
            raise Fault(f"it sent more than {MOST_UNASKED} messages in {QUIET:g} s without Measures")
        self._run(CYCLES)
        return Seen(f"waited for {QUIET:g} s, and answered {CYCLES} more cycles")

    def _stop_start(self) -> Seen:
        self._deliver(self.desk.accept(self._registration()))
        self._pause(STOPPED)
        self._start()
        drove = self._run(CYCLES)
        self.desk.simulation.stop()
        self._pause(STOPPED)
        self._start()
        drives = self._run(2 * CYCLES)
        if drove and not drives:
            raise Fault(f"it answers after the pause, but its motors stay at 0 for {2 * CYCLES} cycles")
        return Seen(f"answered all {3 * CYCLES} running cycles" + ", and drove on after the pause" * drove)

    def _lost(self) -> Seen:
        self._begin()
        self._run(CYCLES)
        for number in range(CYCLES):
            measures = self.desk.compute()
            if number % 3:
                self._ask(measures)
        for _ in range(10):
            self.desk.compute()
        # After such a leap an agent may wait for a second message: digits of the first may be spoilt.
        measures = self.desk.compute()
        self._deliver(measures)
        self.desk.answer(min(self._patience, _DOUBT), measures)
        self._run(CYCLES)
        return Seen(f"answered all Measures that were not lost, and {CYCLES} cycles afterwards")

    def _doubled(self) -> Seen:
        self._begin()
        self._run(CYCLES)
        for _ in range(STOPPED):
            measures = self.desk.compute()
            self._ask(measures, measures)
        self._run(CYCLES)
        return Seen(f"took {STOPPED} doubled Measures, and answered {CYCLES} cycles afterwards")

    def _late(self) -> Seen:
        self._begin()
        self._run(CYCLES)
        for _ in range(5):
            older, newer = self.desk.compute(), self.desk.compute()
            self._ask(newer, older)
            self._run(1)
        self._run(CYCLES)
        return Seen(f"took 5 Measures that came late, and answered {CYCLES} cycles afterwards")

    def _restart(self) -> Seen:
        self._begin()
        self._run(LONG)
        self.desk.simulation.restart()
        try:
            for number in range(CYCLES):
                measures = self.desk.compute()
                if number < _AFTER_RESTART:
                    self._deliver(measures)
                    self.desk.answer(min(self._patience, _DOUBT), measures)
                else:
                    self._ask(measures)
        except Gone:
            return Seen("ended when the run began again", "clean")
        return Seen("answered when the run began again")

    def _silence(self) -> Seen:
        self._begin()
        self._run(CYCLES)
        return Seen(f"answered {CYCLES} cycles; then the simulator was gone", "itself")

    def _end(self) -> Seen:
        self._begin()
        self._run(LONG - 1)
        try:
            for _ in range(4):
                measures = self.desk.compute()
                self._deliver(measures)
                self.desk.take(WHILE_STOPPED, measures)
        except Gone:
            return Seen("ended when the time was up", "clean")
        return Seen("was there when the time was up", "clean")

    # --- parts of them ----------------------------------------------------------------------------

    def _registration(self) -> RobotRegistration:
        registration = self.desk.await_registration()
        self._registered(repr(registration.name))
        return registration

    def _begin(self) -> None:
        """Wait for the agent's registration, and start."""
        self._deliver(self.desk.accept(self._registration()))
        self._start()

    def _start(self) -> None:
        """Press Start: send Measures of the current time, with the button on."""
        self._pause(1)
        self.desk.simulation.start()
        self._ask(self.desk.compute())

    def _pause(self, cycles: int) -> None:
        """Run cycles of a stopped simulator, in which agents need not answer."""
        for _ in range(cycles):
            measures = self.desk.compute()
            self._deliver(measures)
            self.desk.take(WHILE_STOPPED, measures)

    def _run(self, cycles: int) -> bool:
        """Run answered cycles; return whether the agent drove in one of them."""
        drove = False
        for _ in range(cycles):
            self._ask(self.desk.compute())
            drove = drove or self.desk.driving
        return drove

    def _deliver(self, *measures: Measures) -> None:
        self.desk.deliver(*measures)
        self._last = measures[0]

    def _ask(self, *measures: Measures) -> None:
        """Send Measures, and wait for an answer."""
        self._deliver(*measures)
        if not self.desk.answer(self._patience, measures[0]):
            raise Fault(f"no answer to the Measures of time {measures[0].time} within {self._patience:g} s")
