"""The GPS: the robot's place, shifted by an unknown offset. Draws two normals a cycle, x first."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from simulator_stub.sensors.base import Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


class GpsSensor(Sensor):
    """Reads x and y plus the offset plus Gaussian noise, rounded half up to 0.1; never the heading.

    It cannot be made to wait for requests, and has no latency. Asking for it uses up a request all the same.
    """

    name = "gps"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self._present = world.parameters.gps
        self._deviation = world.parameters.gps_linear_noise
        self.reading = (0.0, 0.0)

    @property
    def is_present(self) -> bool:
        """Whether the parameters give the robot one."""
        return self._present

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the name in SensorRequests."""
        return ("GPS",)

    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure, if the parameters give the robot a GPS."""
        if self._present:
            draw = self.noise[scene.running].normal
            offset_x, offset_y = scene.gps_offset
            self.reading = (
                _to_tenths(robot.x + self._deviation * draw() + offset_x),
                _to_tenths(robot.y + self._deviation * draw() + offset_y),
            )

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report it if it is there."""
        if self._present:
            fields["gps"] = self.reading

    def record(self, fields: dict[str, Any]) -> None:
        """Report it if it is there."""
        if self._present:
            fields["gps"] = self.reading


def _to_tenths(length: float) -> float:
    return math.floor(length * 10.0 + 0.5) / 10.0
