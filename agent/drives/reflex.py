"""Commands that are safe although there is no time to think: for the process that answers every message.

The simulator keeps the last command while it hears of no other. A command is therefore safe only if the
robot may follow it for as long as the next answer may take. How long that is, is learnt from how late answers
were lately; the free distance that the IR sensors show, divided by that time, bounds the speed. With answers
in time and decisions that are fresh nothing is bounded: then the drive has its say alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from agent.drives.by_sensors import SensorDrive
from agent.drives.safety import STOP_SHORT, Bumper
from ciberrato.physics.kinematics import STANDSTILL, Command, filter_wheels
from ciberrato.protocol.messages import Measures

_AT_FIRST = 3.0
"""Cycles that an answer may take, before any was given."""
_MEMORY = 0.98  # of the lateness, from answer to answer
_MARGIN = 2.5
"""Delays as long as this times the longest one lately are reckoned with."""
_IN_TIME = 1.5  # cycles; jitter of the clocks included
_LATE = 2.0
"""Cycles from which on a robot drives no faster than one without decisions: it, too, is stopped late."""
_MOST_TURN = 1.5
"""Radians that a robot may turn before the next answer."""
_SIDE = 1.5
"""Fraction of the free distance to the side that may be driven: walls beside are mostly driven along."""
_HOLD = 3  # cycles for which a decision holds at least when no other comes
_LONGEST_HOLD = 10
_REST = 20
"""Cycles without a decision after which the robot goes on by its IR sensors alone."""
_ROAMING = 0.6
"""Of the cruising speed, without the belief: a corner between two cones is seen when it is very near only."""
_EPSILON = 1e-3


class Reflex:
    """Turns the drive's latest decision, however old, into a command that is safe now.

    Parameters
    ----------
    angles : sequence of float
        Mounting angles of the IR sensors in degrees.
    noise : float
        Standard deviation of an IR reading.
    cruise : float
        Motor command for driving straight on, in units per cycle.
    roams : bool
        Whether to drive by the IR sensors alone where there is no decision; otherwise the robot stands.
    """

    def __init__(self, angles: Sequence[float], noise: float, *, cruise: float, roams: bool) -> None:
        self._angles, self._noise, self._cruise, self._roams = angles, noise, cruise, roams
        self._bumper = Bumper(angles, noise, remembers=True)
        self._roamer: SensorDrive | None = None
        self._wheels: Command = STANDSTILL
        self._command: Command = STANDSTILL
        self._motion = (0.0, 0.0)
        self._late = _AT_FIRST
        self._measures: Measures | None = None
        self._decided: Command | None = None
        self._decided_for = self._decided_at = 0
        self._interval = 1.0

    @property
    def cycles(self) -> float:
        """Cycles for which a command sent now may act."""
        return self._late

    def observe(self, measures: Measures) -> None:
        """Update what is known with a message."""
        passed = 1 if self._measures is None else min(max(measures.time - self._measures.time, 0), 10)
        way = turn = 0.0
        for _ in range(passed):
            left, right = self._wheels = filter_wheels(self._command, self._wheels)
            way, turn = way + (left + right) / 2.0, turn + right - left
        self._motion = way, turn
        self._bumper.move(way, turn)
        self._measures = measures
        self._bumper.observe(measures.infrared)

    def stop(self) -> None:
        """Register that the robot was told to stand, as nothing was heard of it."""
        self._command = STANDSTILL

    def answered(self, cycles: float) -> None:
        """Learn how late an answer is.

        Parameters
        ----------
        cycles : float
            Since the answer before, or, if that is more, since the message that it answers came, plus one.
        """
        late = 1.0 + _MARGIN * max(cycles - _IN_TIME, 0.0)
        self._late = max(late, 1.0 + _MEMORY * (self._late - 1.0))

    def decide(self, command: Command, time: int) -> None:
        """Replace the decision that holds by one of the drive.

        Parameters
        ----------
        command : (float, float)
            Of the left and the right motor.
        time : int
            Of the message that it answers, in simulated cycles.
        """
        now = time if self._measures is None else self._measures.time
        if self._decided is not None:
            self._interval = max(float(now - self._decided_at), 0.9 * self._interval)
        self._decided, self._decided_for, self._decided_at = command, time, now
        self._roamer = None

    def command(self) -> Command:
        """Return the command that answers the last message."""
        measures = self._measures
        assert measures is not None
        held = measures.time - self._decided_at
        if self._decided is None:
            chosen = self._roam(measures)
        elif held <= min(max(_HOLD, self._interval), _LONGEST_HOLD):
            chosen = self._decided
        else:
            chosen = self._roam(measures) if held > _REST else STANDSTILL
        self._command = self._bound(chosen, measures, 0 if self._decided is None or self._roamer else held)
        return self._command

    def _roam(self, measures: Measures) -> Command:
        if not self._roams:
            return STANDSTILL
        if self._roamer is None:
            self._roamer = SensorDrive(self._angles, self._noise, cruise=_ROAMING * self._cruise)
        return self._roamer.decide(measures, self._motion).command

    def _bound(self, command: Command, measures: Measures, held: int) -> Command:
        """Return a command that does no harm for as long as it may act."""
        cycles = max(self._late, 1.0 + held)
        stale = self._roamer is None and self._decided_for != measures.time
        if cycles <= _IN_TIME and not stale:
            return command
        power, turn = (command[0] + command[1]) / 2.0, command[1] - command[0]
        moving = (self._wheels[0] + self._wheels[1]) / 2.0
        if power > 0.0:
            if (stale and measures.collision) or self._bumper.brushes:
                # Decided without knowing of it, or for a robot that is heard sooner. The wheels run on: the
                # opposite command stops them in one cycle.
                power = -max(moving, 0.0)
            free = min(
                1.0 / max(self._bumper.ahead + self._noise, _EPSILON) - STOP_SHORT,
                _SIDE / max(self._bumper.left, self._bumper.right, _EPSILON),
            )
            if cycles > _LATE:
                power = min(power, _ROAMING * self._cruise)
            power = min(power, max(free - moving, 0.0) / (cycles + 1.0))
        elif power < 0.0:
            free = 1.0 / max(self._bumper.behind + self._noise, _EPSILON) - STOP_SHORT
            power = -min(-power, max(free + moving, 0.0) / (cycles + 1.0))
        turn = min(max(turn, -_MOST_TURN / cycles), _MOST_TURN / cycles)
        return round(power - turn / 2.0, 4), round(power + turn / 2.0, 4)
