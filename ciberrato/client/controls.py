"""Commands and requests of a robot's program, for all carriers of messages."""

from __future__ import annotations

import contextlib
import math
import time
from typing import TYPE_CHECKING

from ciberrato.client.channel import Channel
from ciberrato.client.core import RobotCore, RunEnd
from ciberrato.client.errors import fell_silent
from ciberrato.client.pace import Pace
from ciberrato.client.run_recorder import RunRecorder
from ciberrato.net.link import LinkError

if TYPE_CHECKING:
    from ciberrato.localization import Estimate
    from ciberrato.protocol.messages import Acceptance, Measures
    from ciberrato.world.parameters import Parameters

_SILENT_CYCLES = 3
"""A simulator is not silent before it has missed so many cycles."""


class Controls:
    """The part that `ciberrato.client.Robot` and `ciberrato.client.AsyncRobot` share.

    Parameters
    ----------
    core : RobotCore
    channel : Channel
    recorder : RunRecorder
    timeout : float
        Seconds without Measures after which the simulator is taken to be gone.
    """

    def __init__(self, core: RobotCore, channel: Channel, recorder: RunRecorder, timeout: float) -> None:
        self._core = core
        self._channel = channel
        self._recorder = recorder
        self._timeout = timeout
        self._unanswered: Measures | None = None
        self._closed = False
        self._pace = Pace(0.0)
        self._waits_since = 0.0
        self._next_stop = math.inf
        self._stops = 0

    # --- what the robot does -------------------------------------------------------------------------

    def drive(self, left: float, right: float) -> None:
        """Set the motor commands; they hold until changed.

        They go out with the one message of this cycle, and count only while the simulator runs.

        Parameters
        ----------
        left, right : float
            Units per cycle; the simulator clamps them to ±0.15.

        Raises
        ------
        UsageError
            If one is not a finite number.
        """
        self._core.drive(left, right)

    def stop(self) -> None:
        """Set both motor commands to 0."""
        self._core.drive(0.0, 0.0)

    def visiting_led(self, on: bool = True) -> None:
        """Switch the Visiting LED, which says that the robot is at a target."""
        self._core.set_led("visiting_led", on)

    def returning_led(self, on: bool = True) -> None:
        """Switch the Returning LED, which says that the robot drives home."""
        self._core.set_led("returning_led", on)

    def finish(self) -> None:
        """Switch the End LED on: the run is over for this robot, and so is the loop over its Measures."""
        self._core.set_led("end_led", True)

    def say(self, text: str) -> None:
        """Broadcast a text of at most 100 characters to the robots within 8 units (this one included)."""
        self._core.say(text)

    def request(self, *names: str) -> None:
        """Request sensors that come on request only; see `RobotCore.request`.

        Without it every sensor that needs asking is asked for, in turn where the limit is lower.
        """
        self._core.request(*names)

    # --- what it knows -------------------------------------------------------------------------------

    @property
    def measures(self) -> Measures | None:
        """The newest Measures, those of cycles that the program does not see included."""
        return self._core.measures

    @property
    def parameters(self) -> Parameters:
        """The simulation's parameters, as announced."""
        assert self._core.acceptance is not None
        return self._core.acceptance.parameters

    @property
    def n_beacons(self) -> int:
        """Number of beacons in the lab."""
        assert self._core.acceptance is not None
        return self._core.acceptance.n_beacons

    @property
    def pose(self) -> Estimate | None:
        """The live filter's estimate (with ``localize=``); None until its tables are there."""
        return self._recorder.pose

    @property
    def ended(self) -> RunEnd | None:
        """Reason why the run is over; None while it is not."""
        return self._core.ended

    @property
    def lost(self) -> int:
        """Number of simulated cycles whose Measures did not arrive."""
        return self._core.lost

    @property
    def skipped(self) -> int:
        """Number of Measures that the program did not see, as it was slow and newer ones were waiting."""
        return self._core.skipped

    @property
    def stale(self) -> int:
        """Number of Measures that came behind newer ones, or twice, and were ignored."""
        return self._core.stale

    @property
    def stops(self) -> int:
        """Number of times the robot was stopped because no message came for three cycles (real time only)."""
        return self._stops

    def __repr__(self) -> str:
        state = "running" if self.ended is None else self.ended.name.lower()
        time = "-" if self.measures is None else self.measures.time
        return f"<{type(self).__name__} {self._core.registration.name!r} {state} at time {time}>"

    def close(self) -> None:
        """Stop the robot and leave the simulator; again is harmless."""
        if self._closed:
            return
        self._closed = True
        over = self._core.ended is not None
        self._core.ended = self._core.ended or RunEnd.STOPPED_BY_PROGRAM  # from now on motors are 0
        try:
            if not over:
                with contextlib.suppress(LinkError):  # then the simulator is out of reach
                    self._channel.send(self._core.answer())
        finally:
            self._recorder.close()
            self._channel.close()

    # --- for the shells ------------------------------------------------------------------------------

    def _begin(self, acceptance: Acceptance) -> None:
        self._core.accept(acceptance)
        self._recorder.begin(self._core)
        self._pace = Pace(acceptance.parameters.cycle_time, lockstep=acceptance.lockstep)
        self._begin_to_wait()
        self._timeout = max(self._timeout, _SILENT_CYCLES * acceptance.parameters.cycle_time / 1000.0)

    def _abandon(self) -> None:
        """Close what is open after a registration that failed."""
        self._closed = True
        self._recorder.close()
        self._channel.close()

    @property
    def _goes_on(self) -> bool:
        return not self._closed and self._core.ended is None

    def _take(self, messages: list[Measures]) -> Measures | None:
        """Process messages; return the one for the program, or answer in its place."""
        if not messages:
            self._hear_nothing()
            return None
        self._begin_to_wait()
        command = self._core.sent
        shown = self._core.take(messages)
        for measures in self._core.fresh:
            if measures.start:
                self._pace.heard(time.monotonic(), measures.time)
            self._recorder.observe(measures, command)
        if self._core.fresh:
            self._unanswered = self._core.fresh[-1]
        if shown is None:
            self._answer()
        return shown

    def _answer(self) -> None:
        """Send the one message of this cycle, unless it is out or the run is over."""
        measures, self._unanswered = self._unanswered, None
        if measures is not None and self._goes_on:
            actions = self._core.answer()
            self._recorder.record(measures, actions)
            self._channel.send(actions)
        self._begin_to_wait()

    def _begin_to_wait(self) -> None:
        self._waits_since = now = time.monotonic()
        self._next_stop = now + (self._pace.patience if self._core.sent != (0.0, 0.0) else math.inf)

    @property
    def _patience(self) -> float:
        """Seconds to wait for Measures before `_take` is called without any."""
        return max(min(self._waits_since + self._timeout, self._next_stop) - time.monotonic(), 0.0)

    def _hear_nothing(self) -> None:
        """Stop the robot, which would go on blindly; after a longer time the simulator is gone."""
        now = time.monotonic()
        if now >= self._next_stop:
            self._stops += self._core.sent != (0.0, 0.0)
            self._channel.send(self._core.standstill())
            self._next_stop = now + self._pace.seconds
        if now - self._waits_since >= self._timeout or not self._channel.waits:
            newest = None if self.measures is None else self.measures.time
            raise fell_silent(self._channel.place, self._timeout, newest)
