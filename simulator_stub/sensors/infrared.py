"""The four IR obstacle sensors. Draw four normals a cycle, in order of their ids."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ciberrato.infrared.exact import exact_distance, hangs_on_rounding
from ciberrato.infrared.model import CONTACT, SATURATION, SENSOR_OFFSET, other_robot_distance
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.sensors.base import Delay, Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

SENSORS = 4
INFINITE = math.inf

REACH = SENSOR_OFFSET + ROBOT_RADIUS + 1e-6
"""Units from a robot's centre to its sensors, and from the other's centre to its rim; and for rounding."""


class InfraredSensors(Sensor):
    """Reads 1/distance to walls and other robots, plus Gaussian noise, rounded to 0.1 and not clamped.

    Attributes
    ----------
    axes : tuple of float
        Mounting angles in radians.
    """

    name = "infrared"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        parameters = world.parameters
        self._requestable = parameters.obstacle_requestable
        self._deviation = parameters.obstacle_noise
        self.axes = tuple(angle / 180.0 * math.pi for angle in robot.angles)
        self._delay = Delay(parameters.obstacle_latency, (0.0,) * SENSORS)
        self.reading: tuple[float, ...] = (0.0,) * SENSORS

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the names in SensorRequests."""
        return tuple(f"IRSensor{number}" for number in range(SENSORS))

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle."""
        return not self._requestable

    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure the distances and turn them into readings."""
        x, y, heading = robot.x, robot.y, robot.heading
        directions = [heading + angle for angle in self.axes]
        distances = self.world.distances(x, y, directions)
        if self._deviation == 0.0:
            for number, distance in enumerate(distances):
                if hangs_on_rounding(distance):
                    place = x, y, directions[number]
                    distances[number] = exact_distance(self.world.walls, *place, SENSOR_OFFSET)
        if len(scene.robots) > 1:
            farthest = max(distances)
            reach = farthest + REACH
            for other in scene.robots:
                # No part of the other is nearer to any sensor than this: mostly a wall is.
                dx = other.x - x
                if -reach < dx < reach and other is not robot:
                    least = math.hypot(dx, other.y - y) - REACH
                    if least < farthest:
                        for number, direction in enumerate(directions):
                            if least < distances[number]:
                                seen = other_robot_distance(x, y, direction, other.x, other.y)
                                distances[number] = min(distances[number], seen)
                        farthest = max(distances)
                        reach = farthest + REACH
        deviation, floor = self._deviation, math.floor
        self.reading = self._delay.pass_through(
            tuple(
                [
                    # As `ideal_reading` and `round_reading` do, without their calls.
                    floor(
                        10.0 * ((1.0 / d if CONTACT < d < INFINITE else SATURATION) + deviation * draw) + 0.5
                    )
                    / 10.0
                    for d, draw in zip(distances, self.noise[scene.running].normals(SENSORS), strict=True)
                ]
            )
        )

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report all four, or those requested."""
        if not self._requestable:
            fields["infrared"] = self.reading
        else:
            fields["infrared"] = tuple(
                reading if f"IRSensor{number}" in robot.requests else None
                for number, reading in enumerate(self.reading)
            )

    def record(self, fields: dict[str, Any]) -> None:
        """Report all four."""
        fields["infrared"] = self.reading
