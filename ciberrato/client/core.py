"""Cycle of a robot's program, without input and output: Measures in, one Actions out.

The shells around it (`ciberrato.client.robot`, `ciberrato.client.async_robot`) carry the messages. In every
cycle they pass all messages that wait to `RobotCore.take`, in order, let the user's code run if it returns
Measures, and send what `RobotCore.answer` returns: exactly one message a cycle, so that runs in lockstep
repeat.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import Enum

from ciberrato.client.requests import RequestRota
from ciberrato.errors import UsageError
from ciberrato.protocol.limits import SAY_LIMIT
from ciberrato.protocol.messages import Acceptance, Actions, Measures
from ciberrato.protocol.order import MessageOrder, News
from ciberrato.protocol.registrations import DEFAULT_SENSOR_ANGLES, RobotRegistration


class RunEnd(Enum):
    """Reasons for the end of a run; the value is a phrase for people."""

    FINISHED = "EndLed is on: the robot has finished"
    TIME_UP = "the run's time is up"
    OVER = "the simulation is over"
    BEGUN_AGAIN = "the simulator has begun again"
    STOPPED_BY_PROGRAM = "the program has stopped the robot"


class RobotCore:
    """A robot's side of the protocol.

    Parameters
    ----------
    name : str
        Printable, at most 200 bytes (the real simulator dies of names much longer).
    position : int
        Position in the start grid, from 1; 0 = the first free one.
    angles : sequence of four float, or None
        Mounting angles of the IR sensors in degrees, counter-clockwise from the front; None = 0, 60, -60,
        180.
    every_cycle : bool
        Whether the program also sees the Measures of cycles in which the simulator does not run (before
        Start, while stopped). Motors are held at 0 in these all the same.

    Raises
    ------
    UsageError
        If one of them cannot be used.
    """

    def __init__(
        self,
        name: str,
        *,
        position: int = 0,
        angles: Iterable[float] | None = None,
        every_cycle: bool = False,
    ) -> None:
        if not isinstance(name, str):
            raise UsageError(f"name {name!r} is not a text")
        if len(name.encode(errors="replace")) > 200 or not name.isprintable():
            raise UsageError(f"name {name!r}: a robot's name has at most 200 printable characters")
        if isinstance(position, bool) or not isinstance(position, int) or position < 0:
            raise UsageError(f"position {position!r} is not a whole number, 1 or more, or 0 for any free one")
        if not isinstance(every_cycle, bool):
            raise UsageError(f"every_cycle {every_cycle!r} is neither True nor False")
        self.angles = _four_angles(DEFAULT_SENSOR_ANGLES if angles is None else angles)
        self.registration = RobotRegistration(
            name=name, robot_id=position, sensor_angles=tuple(enumerate(self.angles))
        )
        self.acceptance: Acceptance | None = None
        self.measures: Measures | None = None
        """The newest ones."""
        self.fresh: list[Measures] = []
        """Those of the last call of `take` that were not older than what was known."""
        self.ended: RunEnd | None = None
        self.lost = 0
        """Simulated cycles whose Measures never came."""
        self.skipped = 0
        """Measures that were not shown to the program, as newer ones were waiting."""
        self.motors = (0.0, 0.0)
        """Motor command of the program, for while the simulator runs."""
        self.sent = (0.0, 0.0)
        """Motor commands of the last answer."""
        self._every_cycle = every_cycle
        self._order = MessageOrder()
        self._leds: dict[str, bool] = {}
        self._requests: list[str] = []
        self._say: str | None = None
        self._rota: RequestRota | None = None

    def accept(self, acceptance: Acceptance) -> None:
        """Register that the simulator has accepted the robot."""
        self.acceptance = acceptance
        self._order = MessageOrder(acceptance.parameters.sim_time)
        self._rota = RequestRota(acceptance.parameters, n_beacons=acceptance.n_beacons, ground=True)

    @property
    def stale(self) -> int:
        """Measures that came too late, behind newer ones, twice, or with spoilt digits; they are ignored."""
        return self._order.stale

    # --- what the program wants ----------------------------------------------------------------------

    def drive(self, left: float, right: float) -> None:
        """Set the motor commands; they hold until changed.

        Parameters
        ----------
        left, right : float
            Units per cycle; the simulator clamps them to ±0.15.

        Raises
        ------
        UsageError
            If one is not a finite number.
        """
        self.motors = (_power("left", left), _power("right", right))

    def set_led(self, name: str, on: bool) -> None:
        """Switch a LED with the next message.

        Parameters
        ----------
        name : {"end_led", "returning_led", "visiting_led"}
        on : bool
        """
        self._leds[name] = bool(on)

    def say(self, text: str) -> None:
        """Broadcast a text to the robots within 8 units, with the next message.

        Raises
        ------
        UsageError
            If it is longer than 100 characters: the simulator would ignore it.
        """
        if len(text) > SAY_LIMIT:
            raise UsageError(f"a robot says at most {SAY_LIMIT} characters, not {len(text)}")
        self._say = text

    def request(self, *names: str) -> None:
        """Request sensors that come on request only, with the next message; replaces the automatic requests.

        Parameters
        ----------
        *names : str
            As on the wire: ``IRSensor0``, ``Beacon1``, ``Compass``, ``Ground``, ``Collision``.
        """
        self._requests += names

    # --- a cycle -------------------------------------------------------------------------------------

    def take(self, messages: Iterable[Measures]) -> Measures | None:
        """Process the messages that have arrived, oldest first.

        Parameters
        ----------
        messages : iterable of Measures
            All that wait.

        Returns
        -------
        Measures or None
            The newest, if the program is to see it; None if none came, the simulator does not run, or the
            run is over (`ended`).
        """
        self.fresh = []
        for measures in messages:
            news = self._order.judge(measures)
            if news is News.BEGUN_AGAIN:
                self.ended = RunEnd.BEGUN_AGAIN
            if news is not News.FRESH:
                continue
            if self.measures is not None:
                self.lost += max(measures.time - self.measures.time - 1, 0)
            self.measures = measures
            self.fresh.append(measures)
        if self.ended is not None or not self.fresh:
            return None
        self.skipped += len(self.fresh) - 1
        newest = self.fresh[-1]
        self._check_end(newest)
        if self.ended is not None or not (newest.start or self._every_cycle):
            return None
        return newest

    def standstill(self) -> Actions:
        """Return the message that stops the robot while nothing is heard; the program's motors stay set."""
        self.sent = (0.0, 0.0)
        return Actions(left_motor=0.0, right_motor=0.0)

    def answer(self) -> Actions:
        """Return the one message of this cycle, and forget what lasts one cycle only."""
        assert self._rota is not None
        running = self.measures is not None and self.measures.start and self.ended is None
        self.sent = self.motors if running else (0.0, 0.0)
        automatic = self._rota.next()
        actions = Actions(
            left_motor=self.sent[0],
            right_motor=self.sent[1],
            requests=tuple(self._requests) or automatic,
            say=self._say,
            **self._leds,
        )
        self._requests.clear()
        self._leds.clear()
        self._say = None
        return actions

    def _check_end(self, measures: Measures) -> None:
        assert self.acceptance is not None
        sim_time = self.acceptance.parameters.sim_time
        if measures.end_led:
            self.ended = RunEnd.FINISHED
        elif 0 < sim_time <= measures.time:
            self.ended = RunEnd.TIME_UP
        elif measures.time > 0 and not measures.start and not measures.stop:
            self.ended = RunEnd.OVER


def _four_angles(angles: Iterable[float]) -> tuple[float, float, float, float]:
    try:
        values = [float(angle) for angle in angles]
    except (TypeError, ValueError):
        values = []
    if len(values) != 4 or not all(math.isfinite(value) for value in values):
        raise UsageError(
            f"angles {angles!r}: four angles of IR sensors in degrees are wanted, as (0, 60, -60, 180)"
        )
    return values[0], values[1], values[2], values[3]


def _power(side: str, value: float) -> float:
    try:
        power = float(value)
    except (TypeError, ValueError):
        power = math.nan
    if not math.isfinite(power):
        raise UsageError(
            f"{side} motor: {value!r} is not a finite number; powers are units per cycle, up to 0.15"
        )
    return power
