"""The four IR obstacle sensors. Draw four normals a cycle, in order of their ids."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ciberrato.infrared import CONTACT, HALF_APERTURE, SATURATION, SENSOR_OFFSET, sensor_distances
from ciberrato.kinematics import ROBOT_RADIUS
from simulator_stub.sensors.base import Delay, Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.noise import NoiseRoot
    from simulator_stub.robot import Robot
    from simulator_stub.world import World

SENSORS = 4


class InfraredSensors(Sensor):
    """Reads 1/distance to walls and other robots, plus Gaussian noise, rounded to 0.1 and not clamped."""

    name = "infrared"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        parameters = world.parameters
        self._requestable = parameters.obstacle_requestable
        self._deviation = parameters.obstacle_noise
        self._angles = tuple(angle / 180.0 * math.pi for angle in robot.angles)
        self._delay = Delay(parameters.obstacle_latency, (0.0,) * SENSORS)
        self.reading: tuple[float, ...] = (0.0,) * SENSORS

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the names in SensorRequests."""
        return tuple(f"IRSensor{number}" for number in range(SENSORS))

    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure the distances and turn them into readings."""
        directions = [robot.heading + angle for angle in self._angles]
        distances = sensor_distances(self.world.walls, robot.x, robot.y, directions).tolist()
        for other in scene.robots:
            if other is not robot:
                for number, direction in enumerate(directions):
                    seen = other_robot_distance(robot.x, robot.y, direction, other.x, other.y)
                    distances[number] = min(distances[number], seen)
        draw = self.noise[scene.running].normal
        self.reading = self._delay.pass_through(
            tuple(_rounded(_ideal(distance) + self._deviation * draw()) for distance in distances)
        )

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report all four, or those asked for."""
        if not self._requestable:
            fields["infrared"] = self.reading
        else:
            fields["infrared"] = tuple(
                reading if f"IRSensor{number}" in robot.requests else None
                for number, reading in enumerate(self.reading)
            )


def other_robot_distance(x: float, y: float, direction: float, other_x: float, other_y: float) -> float:
    """Distance that an IR sensor takes to another robot, which walls neither hide nor are hidden by.

    Parameters
    ----------
    x, y : float
        Centre of the robot with the sensor, in units.
    direction : float
        Axis of the sensor in the lab's frame, in radians.
    other_x, other_y : float
        Centre of the other robot.

    Returns
    -------
    float
        Units from the sensor; 0 where the sensor is inside the other robot, infinite where it is not seen.
        With its centre in the cone the nearest point of the disc counts, wherever that is; with the centre
        outside, the point where the edge of the cone enters the disc.
    """
    dx = other_x - (x + SENSOR_OFFSET * math.cos(direction))
    dy = other_y - (y + SENSOR_OFFSET * math.sin(direction))
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= ROBOT_RADIUS:
        return 0.0
    beyond = abs(math.remainder(math.atan2(dy, dx) - direction, 2.0 * math.pi)) - HALF_APERTURE
    if beyond <= 0.0:
        return distance - ROBOT_RADIUS
    aside = distance * math.sin(beyond)
    if beyond >= math.pi / 2.0 or aside > ROBOT_RADIUS:
        return math.inf
    return distance * math.cos(beyond) - math.sqrt(ROBOT_RADIUS * ROBOT_RADIUS - aside * aside)


# The same as ideal_reading and round_reading in ciberrato.infrared, which are slow for single numbers.


def _ideal(distance: float) -> float:
    return 1.0 / distance if CONTACT < distance < math.inf else SATURATION


def _rounded(value: float) -> float:
    return math.floor(10.0 * value + 0.5) / 10.0
