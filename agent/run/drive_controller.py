"""From Measures to commands by a drive that asks the pose filter."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from agent.drives.base import Decision
from agent.drives.by_sensors import SensorDrive
from agent.drives.exchange import Exchange
from agent.drives.throttle import Throttle
from ciberrato.files.run_records import Cycle
from ciberrato.physics.kinematics import STANDSTILL, Command
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.protocol.order import News

if TYPE_CHECKING:
    from agent.drives.base import Drive
    from ciberrato.localization.pose_filter import PoseFilter
    from ciberrato.world.coordinates import SensorAngles
    from ciberrato.world.parameters import Parameters


BEHIND = 2
"""Messages not weighed yet, at most, with which a drive decides where another process answers if need be."""


class DriveController:
    """Lets a drive decide, message by message.

    Parameters
    ----------
    parameters : Parameters
        As announced.
    drive : Drive
    localizer : PoseFilter
        It has taken each message in before the controller does.
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    cruise : float
        Motor command for driving straight on, in units per cycle.
    exit_when_finished : bool
        Whether the run is over when the drive has nothing more to do.
    """

    def __init__(
        self,
        parameters: Parameters,
        drive: Drive,
        localizer: PoseFilter,
        *,
        angles: SensorAngles,
        cruise: float,
        exit_when_finished: bool = False,
    ) -> None:
        self.exchange = Exchange(parameters)
        self.ended: str | None = None
        """Reason for the end of the run, as soon as there is one."""
        self.finished: str | None = None
        """Reason why the drive has nothing more to do, as soon as there is one."""
        self._drive = drive
        self._localizer = localizer
        # Until the filter has tables, and has caught up with what was driven without them.
        self._throttle = Throttle()
        self._first = SensorDrive(angles, parameters.obstacle_noise, cruise=cruise)
        self._exit_when_finished = exit_when_finished
        self._name = type(drive).__name__.removesuffix("Drive").lower()

    def observe(
        self, measures: Measures, *, newest: bool = True, arrived: float | None = None
    ) -> tuple[Cycle, Actions | None]:
        """Process one message and decide on the answer.

        Parameters
        ----------
        measures : Measures
        newest : bool
            Whether no newer message is waiting: only the newest is answered.
        arrived : float or None
            Time of its arrival; see `Exchange.under_way`.

        Returns
        -------
        cycle : Cycle
            For the log.
        actions : Actions or None
            The answer; None to a message that is not the newest.
        """
        news = self.exchange.judge(measures)
        if news is News.FRESH:
            self.exchange.take(measures)
            if measures.end_led:  # set by the drive itself: it has arrived
                self.ended = self.finished or "EndLed is on"
            else:
                self.ended = self.exchange.end_of_time(measures) or self.ended
        elif news is News.BEGUN_AGAIN:
            self.ended = "the simulator has begun again"
        # While nothing moves every message is answered, however many there are: a seed then gives one log.
        answered = (newest or not measures.start) and self.ended is None and news is News.FRESH
        if measures.start and not newest and news is News.FRESH:
            self.exchange.overtake()
        actions = self._answer(measures, self.exchange.under_way(arrived)) if answered else None
        return self._record(measures, self.exchange.command, actions is not None), actions

    def sent(self, time: float) -> None:
        """Record when the last answer was sent; see `Exchange.sent`."""
        self.exchange.sent(time)

    def _answer(self, measures: Measures, under_way: int) -> Actions | None:
        if not measures.start:
            return self.exchange.answer(STANDSTILL)
        live = self._localizer.live
        grid = live.filter
        if self.exchange.answers_itself and (not live.is_ready or live.lag > BEHIND):
            return None  # what would be decided for a place where the robot is no more
        if grid is None or not live.is_ready:
            decision = self._first.decide(measures)
        else:
            decision = self._drive.decide(measures, grid)
        decision = self._throttle.slow(decision, measures.time, under_way)
        if decision.finished is not None:
            self.finished = decision.finished
            # Not before the answer that switches the LEDs on has come back.
            if self._exit_when_finished and decision.end_led is None:
                self.ended = decision.finished
        return self._with_leds(decision)

    def _with_leds(self, decision: Decision) -> Actions:
        return dataclasses.replace(
            self.exchange.answer(decision.command),
            end_led=decision.end_led,
            returning_led=decision.returning_led,
            visiting_led=decision.visiting_led,
        )

    def _record(self, measures: Measures, command: Command | None, answered: bool) -> Cycle:
        return Cycle(
            time=measures.time,
            start=measures.start,
            stop=measures.stop,
            collision=measures.collision,
            compass=measures.compass,
            ground=measures.ground,
            infrared=measures.infrared,
            leds=(measures.end_led, measures.returning_led, measures.visiting_led),
            command=command,
            answered=answered,
            phase=self._name,
        )
