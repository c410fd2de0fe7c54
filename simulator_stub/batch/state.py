"""State of a batch that changes from cycle to cycle, apart from random numbers."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.world.parameters import Parameters
from simulator_stub.batch.plan import SENSORS, BatchPlan
from simulator_stub.sensors.ground import NOWHERE


class Arrays:
    """A record whose fields are arrays, mostly."""

    def copy(self) -> Self:
        """Return an independent copy of all arrays."""
        arrays = {}
        for entry in fields(self):  # type: ignore[arg-type]
            value = getattr(self, entry.name)
            if isinstance(value, np.ndarray):
                arrays[entry.name] = value.copy()
        return replace(self, **arrays)  # type: ignore[type-var]


@dataclass(kw_only=True)
class BatchState(Arrays):
    """Robots, one in each world; arrays have the shape (worlds,) where nothing else is said.

    Attributes
    ----------
    time : array of int
        Simulated cycles of each world.
    x, y, heading : array
        True poses, units and radians.
    start : array, shape (worlds, 3)
        x, y in units and direction in degrees.
    left_command, right_command : array
        As clamped.
    left_output, right_output : array
        Noisy filtered powers of the last running cycle.
    moves : array of bool
        Whether the robot's run goes on: a robot that is finished keeps its place.
    collides, collision_begins : array of bool
        In the last running cycle.
    collisions : array of int
        Number of collisions that have begun.
    lab : array of int
        Number of the world's lab in the plan.
    motor_deviation, compass_deviation, obstacle_deviation, gps_deviation, beacon_deviation : array
        Standard deviations of the factor on the power, the heading (radians), the reading, the position, the
        bearing (radians).
    beacon_aperture : array
        Radians.
    line_probability : array
        Probability that an element of the line sensor is right.
    gps_offset : array, shape (worlds, 2)
        Units.
    sim_time : array of int
        Cycles of a run; 0 for no limit.
    wall_penalty : array of int
        Points for a collision.
    angles : array, shape (4,)
        Mounting angles of the IR sensors in radians.
    delays : dict of str to deque of array
        Readings under way, the oldest first, for each sensor with a latency.
    """

    time: Integers
    x: Floats
    y: Floats
    heading: Floats
    start: Floats
    left_command: Floats
    right_command: Floats
    left_output: Floats
    right_output: Floats
    moves: Booleans
    collides: Booleans
    collision_begins: Booleans
    collisions: Integers
    lab: Integers
    motor_deviation: Floats
    compass_deviation: Floats
    obstacle_deviation: Floats
    gps_deviation: Floats
    beacon_deviation: Floats
    beacon_aperture: Floats
    line_probability: Floats
    gps_offset: Floats
    sim_time: Integers
    wall_penalty: Integers
    angles: Floats
    delays: dict[str, deque[NDArray[Any]]]

    @classmethod
    def empty(cls, plan: BatchPlan) -> BatchState:
        """Create arrays for all worlds."""
        worlds = plan.worlds
        shapes: dict[str, Any] = {"start": (worlds, 3), "gps_offset": (worlds, 2)}
        types: dict[str, type] = {"Integers": np.int64, "Booleans": np.bool_, "Floats": np.float64}
        arrays: dict[str, Any] = {
            entry.name: np.zeros(shapes.get(entry.name, worlds), types[str(entry.type)])
            for entry in fields(cls)
            if str(entry.type) in types
        }
        arrays["angles"] = plan.angles
        shared = plan.shared
        latencies = {
            "infrared": (shared.obstacle_latency, np.zeros((worlds, SENSORS))),
            "compass": (shared.compass_latency, np.zeros(worlds)),
            "ground": (shared.ground_latency, np.full(worlds, NOWHERE, np.int64)),
            "collision": (shared.collision_latency, np.zeros(worlds, np.bool_)),
            "beacons": (shared.beacon_latency, np.full((worlds, plan.beacons), np.nan)),
        }
        arrays["delays"] = {
            sensor: deque([reading] * latency) for sensor, (latency, reading) in latencies.items() if latency
        }
        return cls(**arrays)

    def set_rules(self, which: Integers, rules: Sequence[Parameters]) -> None:
        """Set what worlds take from their parameters, one for each."""
        table = {
            "motor_deviation": [one.motors_noise / 100.0 for one in rules],
            "compass_deviation": [one.compass_noise * math.pi / 180.0 for one in rules],
            "obstacle_deviation": [one.obstacle_noise for one in rules],
            "gps_deviation": [one.gps_linear_noise for one in rules],
            "beacon_deviation": [one.beacon_noise * math.pi / 180.0 for one in rules],
            "beacon_aperture": [one.beacon_aperture for one in rules],
            "line_probability": [one.line_sensor_true_probability for one in rules],
            "sim_time": [one.sim_time for one in rules],
            "wall_penalty": [one.collision_wall_penalty for one in rules],
        }
        for name, values in table.items():
            getattr(self, name)[which] = values

    def begin(self, which: Integers, poses: Floats) -> None:
        """Place robots at rest on their starts, at time 0."""
        self.start[which] = poses
        self.x[which], self.y[which] = poses[:, 0], poses[:, 1]
        self.heading[which] = poses[:, 2] * math.pi / 180.0
        for array in (self.left_command, self.right_command, self.left_output, self.right_output):
            array[which] = 0.0
        self.time[which] = self.collisions[which] = 0
        self.collides[which] = self.collision_begins[which] = False
        self.moves[which] = True
        self.forget_late_readings(which)

    def copy(self) -> BatchState:
        """Return an independent copy; delayed readings are shared: they are replaced, never written to."""
        delays = {name: deque(queue) for name, queue in self.delays.items()}
        return replace(super().copy(), delays=delays)

    @property
    def over(self) -> Booleans:
        """Return where SimTime has been reached."""
        return (self.sim_time > 0) & (self.sim_time <= self.time)

    def delay(self, sensor: str, reading: NDArray[Any], robots: Integers | None) -> NDArray[Any]:
        """Append readings to their queue and return the oldest.

        Parameters
        ----------
        sensor : str
        reading : array, shape (worlds, ...)
        robots : array of int, or None
            The worlds that it is about; None for all.

        Returns
        -------
        array, shape (worlds, ...)
        """
        queue = self.delays.get(sensor)
        if queue is None:
            return reading
        if robots is None:
            queue.append(reading)
            return queue.popleft()
        oldest = queue[0].copy()
        following = [*list(queue)[1:], reading]
        self.delays[sensor] = deque(
            _replaced(array, robots, later[robots]) for array, later in zip(queue, following, strict=True)
        )
        return oldest

    def forget_late_readings(self, robots: Integers) -> None:
        """Clear the queues of some worlds."""
        empty = {"ground": NOWHERE, "beacons": np.nan}
        for sensor, queue in self.delays.items():
            nothing = empty.get(sensor, 0)
            self.delays[sensor] = deque(_replaced(array, robots, nothing) for array in queue)


def _replaced(array: NDArray[Any], robots: Integers, values: Any) -> NDArray[Any]:
    changed = array.copy()
    changed[robots] = values
    return changed
