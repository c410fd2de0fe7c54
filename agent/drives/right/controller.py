"""From Measures to commands: the agent without its network, clock and files."""

from __future__ import annotations

import math

from agent.drives.right.phases import TRANSITIONS, Event, Phase
from agent.drives.right.pilot import Pilot
from agent.drives.right.tracker import STANDSTILL, CellTracker, Command, Crossing
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.protocol.messages import Actions, Measures
from ciberrato.world.parameters import Parameters

_STUCK = 40  # colliding cycles in a row after which the way is given up
_STANDING = 8  # cycles at rest before a wall in which it may still turn out that there is none
_NEAR_THE_STOP = 0.1  # units
_COMMANDS_KEPT = 20  # the newest; an older one cannot be the last before a message
_LONGEST_STEP_BACK = 50  # cycles; a time farther back than a late message can be is that of a new simulation


class Controller:
    """Decides, message by message, what the robot does.

    Parameters
    ----------
    header : RunHeader
        What is known of the run: parameters, sensor angles, cruising speed.
    exit_at_wall : bool
        Whether the run is over when the robot stands before a wall.
    """

    def __init__(self, header: RunHeader, *, exit_at_wall: bool = False) -> None:
        self.tracker = CellTracker(header.parameters, header.sensor_angles)
        self.phase = Phase.WAITING
        self.ended: str | None = None
        """Why the run is over, as soon as it is."""
        self.lost = 0
        """Simulated cycles whose Measures never came."""
        self.unanswered = 0
        """Measures that were overtaken by a newer one before they were answered."""
        self._parameters = header.parameters
        self._pilot = Pilot(header.cruise)
        self._exit_at_wall = exit_at_wall
        self._requests = _RequestRota(header.parameters)
        self._command: Command | None = None
        self._sent: list[tuple[float, Command]] = []
        self._time: int | None = None
        self._colliding = 0

    def sent(self, time: float) -> None:
        """Note when the last answer left.

        Parameters
        ----------
        time : float
            Seconds, by the clock that stamps the arrivals.
        """
        if self._command is not None:
            self._sent = [*self._sent[-_COMMANDS_KEPT:], (time, self._command)]

    def command_in_effect(self, arrived: float | None) -> Command | None:
        """Tell which command moved the robot in the cycle that a message is about.

        Parameters
        ----------
        arrived : float or None
            When the message arrived; None = not known, taken to be after the last answer.

        Returns
        -------
        (float, float) or None
            The last one that had left before the message was there. An answer that leaves later, because this
            process had no time, acts in a later cycle.
        """
        if arrived is None or not self._sent:
            return self._command
        earlier = [command for time, command in self._sent if time < arrived]
        return earlier[-1] if earlier else None

    def observe(
        self, measures: Measures, *, newest: bool = True, arrived: float | None = None
    ) -> tuple[Cycle, Actions | None]:
        """Take in one message and decide on the answer.

        Parameters
        ----------
        measures : Measures
        newest : bool
            Whether no newer message is waiting: only the newest is answered.
        arrived : float or None
            When it arrived; see `command_in_effect`.

        Returns
        -------
        cycle : Cycle
            For the log.
        actions : Actions or None
            The answer; None to a message that is not the newest.
        """
        crossing = None
        if self._time is None or measures.time >= self._time:
            crossing = self._take_in(measures, arrived)
        elif self._time - measures.time > _LONGEST_STEP_BACK or measures.time == 0:
            self.ended = "the simulator has begun again"
        answered = newest and self.ended is None
        self.unanswered += not newest
        actions = None
        if answered:
            self._command = self._decide(measures)
            actions = Actions(
                left_motor=self._command[0], right_motor=self._command[1], requests=self._requests.next()
            )
        return self._record(measures, crossing, answered), actions

    def _take_in(self, measures: Measures, arrived: float | None) -> Crossing | None:
        if self._time is not None:
            self.lost += max(measures.time - self._time - 1, 0)
        crossing = self.tracker.observe(measures, self.command_in_effect(arrived))
        if measures.time != self._time:
            self._colliding = self._colliding + 1 if measures.collision else 0
        self._time = measures.time
        if measures.start:
            self._happen(Event.STARTED)
        if self.tracker.next_step > 0:
            self._happen(Event.START_CELL_READ)
        if self._colliding >= _STUCK:
            self._happen(Event.STUCK)
        elif self.tracker.rest >= _STANDING and self.tracker.way_left < _NEAR_THE_STOP:
            self._happen(Event.WALL_AHEAD)
        self._check_end(measures)
        return crossing

    def _happen(self, event: Event) -> None:
        self.phase = TRANSITIONS.get((self.phase, event), self.phase)

    def _check_end(self, measures: Measures) -> None:
        if measures.end_led:
            self.ended = "EndLed is on"
        elif measures.time > 0 and not measures.start and not measures.stop:
            self.ended = "the simulation is over"
        elif 0 < self._parameters.sim_time <= measures.time:
            self.ended = "the run's time is up"
        elif self.phase is Phase.HOLDING and self._exit_at_wall:
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
            command=self._command,
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
    """Put a message, and what became of it, on record.

    Parameters
    ----------
    measures : Measures
    tracker : CellTracker
        Which has observed them.
    crossing : Crossing or None
        What it found.
    command : (float, float) or None
        In effect from now on.
    answered : bool
        Whether it was sent in answer.
    phase : str
        What the robot is doing.

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


class _RequestRota:
    """Asks for the sensors that come on request only; in turn, if not all may be asked for at once."""

    def __init__(self, parameters: Parameters) -> None:
        names = [f"IRSensor{sensor}" for sensor in range(4)] if parameters.obstacle_requestable else []
        names += ["Compass"] if parameters.compass_requestable and parameters.compass_sensor else []
        names += ["Collision"] if parameters.collision_requestable else []
        self._names = names
        self._at_once = min(parameters.requests_per_cycle, len(names))

    def next(self) -> tuple[str, ...]:
        """Return the names to ask for now."""
        now = tuple(self._names[: self._at_once])
        self._names = [*self._names[self._at_once :], *now]
        return now
