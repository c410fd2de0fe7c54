"""Follows the robot from cell to cell, by dead reckoning that compass and walls correct.

`CellTracker` is a pure function of the stream of Measures and of the commands in effect: fed with a recorded
stream it finds the same crossings of cell centres as in the run itself.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from agent.drives.right.row_ekf import Explanation, Pose, RowKalmanFilter
from agent.drives.right.wall_cues import WallAhead, clutter, reading_variance, side_explanations
from ciberrato.files.run_records import Readings
from ciberrato.geometry.angles import short_turn
from ciberrato.physics.kinematics import STANDSTILL, Command
from ciberrato.protocol.messages import Measures
from ciberrato.world.lab import CELL_SIZE
from ciberrato.world.parameters import Parameters

_DEGREE = math.pi / 180.0
_ALIGNED = 1.0 * _DEGREE
_AT_REST = 0.001  # units per cycle
_STOPPED_SHORT = 0.3  # units before a centre at which a robot at rest counts as being there
_OLDEST_READING = 5  # cycles; how old a reading on request may be and still belong to a crossing
_PATIENCE = 10  # messages to wait at the start for readings on request
_SETTLED = 60  # cycles at rest after which the compass is not listened to any longer


@dataclass(frozen=True, slots=True)
class Crossing:
    """The robot is at the centre of a cell.

    Attributes
    ----------
    index : int
        0 = start cell, k = k-th cell entered.
    time : int
        Simulated cycles at the Measures that carry the readings.
    readings : tuple of four (float or None)
        IR readings taken there; None where the simulator sent none.
    pose : Pose
        Pose of the robot at the readings.
    """

    index: int
    time: int
    readings: Readings
    pose: Pose


class CellTracker:
    """Follows the robot from cell to cell.

    The start cell's reading is taken from the first message whose readings are valid, provided that the
    robot looks to the right; otherwise as soon as it does and stands. A further reading is taken at the
    message nearest to each cell centre, counted from the first in steps of one cell.

    Parameters
    ----------
    parameters : Parameters
        As announced: noise levels, latencies, what is sent on request only.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees. Those at 0 and ±90 help to correct the dead reckoning.
    """

    def __init__(self, parameters: Parameters, angles: tuple[float, float, float, float]) -> None:
        self.parameters = parameters
        self._roles = tuple(_role(angle) for angle in angles)
        self._variance = reading_variance(parameters.obstacle_noise)
        self._compass_variance = (parameters.compass_noise**2 + 1.0 / 12.0) * _DEGREE**2
        memory = max(parameters.obstacle_latency, parameters.compass_latency)
        self._filter = RowKalmanFilter(parameters.motors_noise, memory)
        self._ahead = WallAhead(parameters.obstacle_noise)
        self._front: float | None = None
        self._compass_sum = 0.0
        self._compass_first: float | None = None
        self._compass_count = 0
        self._surprises: deque[float] = deque(maxlen=16)
        self._newest: list[tuple[float, int] | None] = [None] * 4
        self._moved = False
        self._collided = False
        self._rest = 0
        self._messages = 0
        self._step = 0
        self._time: int | None = None

    @property
    def next_step(self) -> int:
        """Number of the crossing to come."""
        return self._step

    @property
    def pose(self) -> Pose:
        """Current pose of the robot."""
        return self._filter.pose()

    @property
    def deviations(self) -> tuple[float, float, float]:
        """Standard deviations along, lateral (units) and of the heading (radians)."""
        return self._filter.deviations()

    @property
    def speed(self) -> float:
        """Units per cycle, according to the commands."""
        return self._filter.speed

    @property
    def turn(self) -> float:
        """Radians per cycle, according to the commands."""
        return self._filter.turn

    @property
    def at_rest(self) -> bool:
        """Return whether the robot stands, as far as the commands say."""
        return max(abs(self._filter.left), abs(self._filter.right)) < _AT_REST

    @property
    def rest(self) -> int:
        """Messages in a row since which the robot stands."""
        return self._rest

    @property
    def distance_left(self) -> float:
        """Units to drive to the last cell centre before a wall; infinite while no wall is seen ahead."""
        if not self._ahead.certain:
            return math.inf
        left = CELL_SIZE * self._ahead.cell - self.pose.along
        if self._front is not None and self._front > 1.5:
            # The wall is nearer than a wall between cells would be: leave some room.
            left = min(left, 1.0 / self._front - 0.2)
        return left

    @property
    def aligned(self) -> bool:
        """Whether the robot heads to the right, as far as the estimate is certain."""
        if abs(self.pose.heading) > _ALIGNED:
            return False
        return not self._moved or self.deviations[2] < 0.7 * _DEGREE or self._rest > _SETTLED

    def observe(self, measures: Measures, command_in_effect: Command | None) -> Crossing | None:
        """Process one message.

        Parameters
        ----------
        measures : Measures
            Not older than the one before.
        command_in_effect : (float, float) or None
            Motor command that was in effect since the message before: the last one sent in answer to it or
            to an earlier one; None if none was sent yet.

        Returns
        -------
        Crossing or None
            The step that this message's readings belong to, if the robot is at a cell's centre.
        """
        self._advance(measures, command_in_effect or STANDSTILL)
        self._messages += 1
        self._listen_to_compass(measures.compass)
        self._look_at_walls(measures)
        return self._crossing(measures)

    def _advance(self, measures: Measures, command: Command) -> None:
        cycles = 0 if self._time is None else measures.time - self._time
        self._time = measures.time
        collided, self._collided = self._collided, bool(measures.collision)
        for remaining in range(cycles, 0, -1):
            # Of cycles whose messages were lost: a robot that collided before and after did so in between.
            self._filter.move(command, blocked=self._collided and (collided or remaining == 1))
        if cycles == 0:
            self._filter.stand()
        self._moved = self._moved or not self.at_rest
        self._rest = self._rest + 1 if self.at_rest else 0

    def _listen_to_compass(self, degrees: float | None) -> None:
        latency = self.parameters.compass_latency
        if degrees is None or self._messages <= latency:
            return
        if not self._moved:
            self._find_start_heading(degrees)
            return
        innovation = short_turn(degrees * _DEGREE - self._filter.pose(latency).heading)
        self._surprises.append(innovation / math.sqrt(self.deviations[2] ** 2 + self._compass_variance))
        mean = sum(self._surprises) / len(self._surprises)
        if len(self._surprises) == self._surprises.maxlen and abs(mean) > 1.25:
            # Five standard deviations off: the start heading counted as a right angle, but is none.
            self._filter.widen_heading(mean**2 * self._compass_variance)
            self._surprises.clear()
        self._filter.correct([Explanation(1.0, innovation, (0.0, 0.0, 1.0), self._compass_variance)])

    def _find_start_heading(self, degrees: float) -> None:
        """Average the compass until the robot moves; a right angle in reach counts as the true heading."""
        if self._compass_first is None:
            self._compass_first = degrees
        self._compass_count += 1
        self._compass_sum += short_turn((degrees - self._compass_first) * _DEGREE)
        mean = short_turn(self._compass_first * _DEGREE + self._compass_sum / self._compass_count)
        deviation = math.sqrt(self._compass_variance / self._compass_count)
        right_angle = round(mean / (math.pi / 2.0)) * math.pi / 2.0
        noisy = 1.0 if self.parameters.motors_noise > 0.0 else 0.0
        if abs(mean - right_angle) <= 3.0 * deviation + _DEGREE:
            heading, deviation = short_turn(right_angle), 0.5 * _DEGREE * noisy
        else:
            heading = mean
        self._filter.place(Pose(0.0, 0.0, heading), (0.0, 0.02 * noisy, deviation))

    def _look_at_walls(self, measures: Measures) -> None:
        latency = self.parameters.obstacle_latency
        if self._messages <= latency:
            return
        assert self._time is not None
        for sensor, reading in enumerate(measures.infrared):
            if reading is None:
                continue
            self._newest[sensor] = (reading, self._time)
            role = self._roles[sensor]
            pose = self._filter.pose(latency)
            if role in (1, -1):
                self._filter.correct(side_explanations(reading, role, pose, self._variance), clutter(reading))
            elif role == 0:
                self._front = reading
                self._ahead.observe(reading, pose, self.deviations)

    def _crossing(self, measures: Measures) -> Crossing | None:
        if self._messages <= self.parameters.obstacle_latency:
            return None
        pose = self._filter.pose(self.parameters.obstacle_latency)
        readings = self._readings()
        if self._step == 0:
            if not (self.at_rest and self.aligned):
                return None
            if None in readings and self._messages <= self.parameters.obstacle_latency + _PATIENCE:
                return None
        else:
            missing = CELL_SIZE * self._step - pose.along
            here = missing <= _STOPPED_SHORT if self.at_rest else missing <= self.speed / 2.0
            if not here:
                return None
        crossing = Crossing(self._step, measures.time, readings, pose)
        self._step += 1
        return crossing

    def _readings(self) -> Readings:
        assert self._time is not None
        first, second, third, fourth = (
            entry[0] if entry is not None and self._time - entry[1] <= _OLDEST_READING else None
            for entry in self._newest
        )
        return first, second, third, fourth


def _role(angle: float) -> int | None:
    """Return where a sensor looks: 0 ahead, 1 to the left, -1 to the right, None elsewhere."""
    turned = math.remainder(angle, 360.0)
    for role, axis in ((0, 0.0), (1, 90.0), (-1, -90.0)):
        if abs(turned - axis) < 0.5:
            return role
    return None
