"""From Measures to commands: the agent without its network, clock and files."""

from __future__ import annotations

import math

from agent.drives.exchange import Exchange
from agent.drives.right.phases import TRANSITIONS, Event, Phase
from agent.drives.right.pilot import Pilot
from agent.drives.right.tracker import CellTracker, Crossing
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.physics.kinematics import STANDSTILL, Command
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.protocol.order import News

_STUCK = 40  # colliding cycles in a row after which the way is given up
_STANDING = 8  # cycles at rest before a wall in which it may still turn out that there is none
_NEAR_THE_STOP = 0.1  # units


class Controller:
    """Decides, message by message, what the robot does.

    Parameters
    ----------
    header : RunHeader
        Facts of the run: parameters, sensor angles, cruising speed.
    exit_at_wall : bool
        Whether the run is over when the robot stands before a wall.
    """

    def __init__(self, header: RunHeader, *, exit_at_wall: bool = False) -> None:
        self.tracker = CellTracker(header.parameters, header.sensor_angles)
        self.phase = Phase.WAITING
        self.ended: str | None = None
        """Reason for the end of the run, as soon as there is one."""
        self.exchange = Exchange(header.parameters)
        self._pilot = Pilot(header.cruise)
        self._exit_at_wall = exit_at_wall
        self._colliding = 0

    def sent(self, time: float) -> None:
        """Record when the last answer was sent; see `Exchange.sent`."""
        self.exchange.sent(time)

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
            Time of its arrival; see `Exchange.command_in_effect`.

        Returns
        -------
        cycle : Cycle
            For the log.
        actions : Actions or None
            The answer; None to a message that is not the newest.
        """
        crossing = None
        news = self.exchange.judge(measures)
        if news is News.FRESH:
            crossing = self._take_in(measures, arrived)
        elif news is News.BEGUN_AGAIN:
            self.ended = "the simulator has begun again"
        # While nothing moves every message is answered, however many there are: a seed then gives one log.
        answered = (newest or not measures.start) and self.ended is None and news is News.FRESH
        if measures.start and not newest and news is News.FRESH:
            self.exchange.overtake()
        actions = self.exchange.answer(self._decide(measures)) if answered else None
        return self._record(measures, crossing, answered), actions

    def _take_in(self, measures: Measures, arrived: float | None) -> Crossing | None:
        crossing = self.tracker.observe(measures, self.exchange.command_in_effect(arrived, measures.time))
        if measures.time != self.exchange.time:
            self._colliding = self._colliding + 1 if measures.collision else 0
        self.exchange.take(measures)
        if measures.start:
            self._happen(Event.STARTED)
        if self.tracker.next_step > 0:
            self._happen(Event.START_CELL_READ)
        if self._colliding >= _STUCK:
            self._happen(Event.STUCK)
        elif self.tracker.rest >= _STANDING and self.tracker.distance_left < _NEAR_THE_STOP:
            self._happen(Event.WALL_AHEAD)
        self._check_end(measures)
        return crossing

    def _happen(self, event: Event) -> None:
        self.phase = TRANSITIONS.get((self.phase, event), self.phase)

    def _check_end(self, measures: Measures) -> None:
        self.ended = "EndLed is on" if measures.end_led else self.exchange.end_of_time(measures) or self.ended
        if self.ended is None and self.phase is Phase.HOLDING and self._exit_at_wall:
            self.ended = "stuck" if self._colliding >= _STUCK else "a wall is ahead"

    def _decide(self, measures: Measures) -> Command:
        if not measures.start:
            return STANDSTILL
        if self.phase is Phase.ALIGNING:
            return self._pilot.align(self.tracker)
        if self.phase is Phase.DRIVING:
            return self._pilot.drive(self.tracker)
        return STANDSTILL

    def _record(self, measures: Measures, crossing: Crossing | None, answered: bool) -> Cycle:
        return make_cycle(
            measures,
            self.tracker,
            crossing,
            command=self.exchange.command,
            answered=answered,
            phase=self.phase.value,
        )


def make_cycle(
    measures: Measures,
    tracker: CellTracker,
    crossing: Crossing | None,
    *,
    command: Command | None,
    answered: bool,
    phase: str,
) -> Cycle:
    """Record a message and its outcome.

    Parameters
    ----------
    measures : Measures
    tracker : CellTracker
        Tracker that has observed them.
    crossing : Crossing or None
        Crossing that it found.
    command : (float, float) or None
        In effect from now on.
    answered : bool
        Whether it was sent in answer.
    phase : str
        Activity of the robot.

    Returns
    -------
    Cycle
        Estimates rounded to a millionth of a unit and a ten-thousandth of a degree.
    """
    pose = tracker.pose if crossing is None else crossing.pose
    along, lateral, heading = tracker.deviations
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
        displacement=round(pose.along, 6),
        lateral=round(pose.lateral, 6),
        heading=round(math.degrees(pose.heading), 4),
        spread=(round(along, 6), round(lateral, 6), round(math.degrees(heading), 4)),
        phase=phase,
        step=None if crossing is None else crossing.index,
        readings=None if crossing is None else crossing.readings,
    )
