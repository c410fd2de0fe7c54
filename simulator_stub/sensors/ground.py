"""The ground sensor: which target area the whole robot is in. No noise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.sensors.base import Delay, Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

NOWHERE = -1


class GroundSensor(Sensor):
    """Reads the number of the target that contains the robot; with several the last one, -1 with none."""

    name = "ground"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self._requestable = world.parameters.ground_requestable
        self._delay = Delay(world.parameters.ground_latency, NOWHERE)
        self.reading = NOWHERE

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the name in SensorRequests."""
        return ("Ground",)

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle."""
        return not self._requestable

    def update(self, robot: Robot, scene: Scene) -> None:
        """Find the target."""
        found = NOWHERE
        for number, target in enumerate(self.world.lab.targets):
            if math.hypot(robot.x - target.x, robot.y - target.y) <= target.radius - ROBOT_RADIUS:
                found = number
        self.reading = self._delay.pass_through(found)

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report the number."""
        if not self._requestable or "Ground" in robot.requests:
            fields["ground"] = self.reading

    def record(self, fields: dict[str, Any]) -> None:
        """Report the number."""
        fields["ground"] = self.reading
