"""The compass: the heading in whole degrees. Draws one normal a cycle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ciberrato.geometry.angles import wrap_once
from simulator_stub.sensors.base import Delay, Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


class CompassSensor(Sensor):
    """Reads heading plus Gaussian noise, wrapped once and rounded half up: -180 to 180, both included."""

    name = "compass"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        parameters = world.parameters
        self._present = parameters.compass_sensor
        self._requestable = parameters.compass_requestable
        self._deviation = parameters.compass_noise * math.pi / 180.0
        self._delay = Delay(parameters.compass_latency, 0.0)
        self.reading = 0.0

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the name in SensorRequests."""
        return ("Compass",)

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle."""
        return self._present and not self._requestable

    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure the heading in degrees."""
        angle = wrap_once(robot.heading + self._deviation * self.noise[scene.running].normal())
        self.reading = self._delay.pass_through(float(math.floor(angle * 180.0 / math.pi + 0.5)))

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report it if the parameters give the robot a compass."""
        if self._present and (not self._requestable or "Compass" in robot.requests):
            fields["compass"] = self.reading

    def record(self, fields: dict[str, Any]) -> None:
        """Report it, even where the robot has no compass."""
        fields["compass"] = self.reading
