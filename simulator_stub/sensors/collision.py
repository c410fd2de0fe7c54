"""The collision sensor: whether something stopped the robot in the last running cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from simulator_stub.sensors.base import Delay, Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


class CollisionSensor(Sensor):
    """Reads the collision flag, which stays as it was while the simulator is stopped. No noise."""

    name = "collision"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self._requestable = world.parameters.collision_requestable
        self._delay = Delay(world.parameters.collision_latency, False)
        self.reading = False

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the name in SensorRequests."""
        return ("Collision",)

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle."""
        return not self._requestable

    def update(self, robot: Robot, scene: Scene) -> None:
        """Read the flag."""
        self.reading = self._delay.pass_through(robot.collides)

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report the flag."""
        if not self._requestable or "Collision" in robot.requests:
            fields["collision"] = self.reading

    def record(self, fields: dict[str, Any]) -> None:
        """Report the flag."""
        fields["collision"] = self.reading
