"""Brings together what was sensed at one time: readings that come late, and the motions between messages.

Some sensors report what they sensed some cycles ago (their latency). The filter takes in each moment when the
last of its readings that matter has come, and carries its pose on from there by dead reckoning.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.filtering.interruption import doubtful_cycles
from ciberrato.localization.records import Motion
from ciberrato.physics.kinematics import STANDSTILL, Command, advance, clamp_power, filter_power, wrap_angle
from ciberrato.protocol.messages import BeaconReading, Measures
from ciberrato.reprs import short_repr
from ciberrato.world.parameters import Parameters


class _Tick(NamedTuple):
    """One message: the commands of the cycles before it, and what it says."""

    commands: tuple[Command, ...]
    measures: Measures
    former: Command
    """In effect before the message before."""

    def __repr__(self) -> str:
        return short_repr(self)


class Moment(NamedTuple):
    """The motions up to one time, and what was sensed then, whenever it was reported.

    `time` is that of the message with which the last of it came.
    """

    motions: tuple[Motion, ...]
    infrared: tuple[float | None, ...]
    compass: float | None
    ground: int | None
    beacons: tuple[BeaconReading, ...]
    gps: tuple[float, float] | None
    time: int
    doubtful: int = 0
    """Number of last motions that may not have been: see `ciberrato.localization.filtering.interruption`."""
    otherwise: tuple[Motion, ...] = ()
    """Motions if the last command never reached the robot, after a gap."""

    @property
    def moved(self) -> float:
        """Return the units driven."""
        return sum(abs(motion.left + motion.right) / 2.0 for motion in self.motions)

    @property
    def turned(self) -> float:
        """Return the radians turned."""
        return sum(abs(motion.right - motion.left) for motion in self.motions)

    def __repr__(self) -> str:
        return short_repr(self)


class MessageAlignment:
    """Turns messages and commands into moments.

    Parameters
    ----------
    parameters : Parameters
        As announced: the sensors' latencies.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.lag = max(
            parameters.obstacle_latency,
            parameters.compass_latency,
            parameters.beacon_latency if parameters.beacon_sensor else 0,
        )
        """Messages that a moment waits for its readings."""
        self.wheels: Command = (0.0, 0.0)
        """Motion of the wheels in the last cycle taken in, in units, as far as the commands say."""
        self.time: int | None = None
        """Of the last message, in simulated cycles."""
        self.command: Command = (0.0, 0.0)
        """In effect in the cycles before the last message."""
        self._ticks: deque[_Tick] = deque(maxlen=self.lag + 1)
        self._messages = 0

    def begin_at(self, wheels: Command, time: int | None) -> None:
        """Begin in the middle of a run, with the last motion of the wheels and the last message's time."""
        self.wheels, self.time = wheels, time

    def take(self, measures: Measures, command: Command | None) -> Moment | None:
        """Process a message.

        Parameters
        ----------
        measures : Measures
            Not older than the one before.
        command : (float, float) or None
            In effect since the message before; None if none was sent yet.

        Returns
        -------
        Moment or None
            The oldest one whose readings are all there; None in the first `lag` messages.
        """
        cycles = 0 if self.time is None else max(measures.time - self.time, 0)
        former, self.command = self.command, command or STANDSTILL
        self.time = measures.time
        self._messages += 1
        self._ticks.append(_Tick((self.command,) * cycles, measures, former))
        return self._oldest(measures.time) if self._messages > self.lag else None

    def _oldest(self, time: int) -> Moment:
        oldest, parameters = self._ticks[0], self._parameters
        # Of these two sensors, whose readings matter less, nothing waits for what is later than the others.
        blocked = self._late(parameters.collision_latency)
        floor = self._late(parameters.ground_latency)
        collision = None if blocked is None else blocked.collision
        cycles = len(oldest.commands)
        doubtful = doubtful_cycles(cycles, (*oldest.commands[:1], oldest.former))
        otherwise: list[Motion] = []
        if doubtful and oldest.former != oldest.commands[0]:
            otherwise, _ = _motions((oldest.former,) * cycles, self.wheels, collision)
        motions, self.wheels = _motions(oldest.commands, self.wheels, collision)
        moment = Moment(
            motions=tuple(motions),
            infrared=self._ticks[parameters.obstacle_latency].measures.infrared,
            compass=self._ticks[parameters.compass_latency].measures.compass,
            ground=None if floor is None else floor.ground,
            beacons=self._ticks[parameters.beacon_latency].measures.beacons
            if parameters.beacon_sensor
            else (),
            gps=oldest.measures.gps,
            time=time,
            doubtful=doubtful,
            otherwise=tuple(otherwise),
        )
        if doubtful:  # half way between what wheels give that were stopped and that were not
            self.wheels = self.wheels[0] / 2.0, self.wheels[1] / 2.0
        # The floor below a robot that stands brings nothing new.
        return moment if moment.moved > 0.0 or self._messages < 3 else moment._replace(ground=None)

    def _late(self, latency: int) -> Measures | None:
        """Return the message with the readings made at the time of the oldest, if it has come."""
        return self._ticks[latency].measures if latency < len(self._ticks) else None

    def carry_on(self, found: PoseEstimate) -> PoseEstimate:
        """Add the motions of the messages after the last moment, by dead reckoning."""
        if self.lag == 0 or not self._ticks:
            return found
        return dead_reckoned(
            found, self.wheels, [command for tick in list(self._ticks)[1:] for command in tick.commands]
        )


def _motions(
    commands: tuple[Command, ...], wheels: Command, collision: bool | None
) -> tuple[list[Motion], Command]:
    """Return the motions of the wheels in the cycles between two messages, and the last of them."""
    motions = []
    for number, command in enumerate(commands, start=1):
        wheels = left, right = wheels_after(command, wheels)
        if left != 0.0 or right != 0.0:
            # Of cycles whose messages never came it is not known whether a wall was in the way.
            motions.append(Motion(left, right, collision if number == len(commands) else None))
    return motions, wheels


def wheels_after(command: Command, wheels: Command) -> Command:
    """Return the motion of the wheels in a cycle, from the command in effect and their motion before."""
    left, right = (filter_power(clamp_power(c), w) for c, w in zip(command, wheels, strict=True))
    return left, right


def dead_reckoned(found: PoseEstimate, wheels: Command, commands: list[Command]) -> PoseEstimate:
    """Move an estimate by commands, one per cycle.

    Parameters
    ----------
    found : PoseEstimate
    wheels : (float, float)
        Motion of the wheels in the cycle before the first command.
    commands : list of (float, float)

    Returns
    -------
    PoseEstimate
        With the same probability.
    """
    pose = (found.x, found.y, found.heading)
    for command in commands:
        wheels = wheels_after(command, wheels)
        pose = advance(*pose, *wheels)
    x, y, heading = pose
    return found.moved_to(x, y, wrap_angle(heading))
