"""The beacon sensors: the bearings of the lab's beacons, where no wall hides them.

Draw one normal a beacon and cycle, in order of the beacons, whether the beacon is hidden or not.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ciberrato.geometry.angles import bearing
from ciberrato.infrared.on_face import ray_distance_by_angles
from ciberrato.physics.kinematics import wrap_angle
from ciberrato.protocol import BeaconReading
from simulator_stub.sensors.base import Delay, Scene, Sensor

if TYPE_CHECKING:
    from ciberrato.world.lab import Beacon
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


ON_A_WALL = 1e-9
"""Units: a beacon this near to a wall that may hide it stands on it."""


class BeaconSensors(Sensor):
    """Read bearings from the robot's heading in whole degrees, plus Gaussian noise; nothing if not visible.

    A beacon is visible if no wall at least as high as the beacon, border included, stands before it, and its
    *noisy* bearing is within the aperture. Other robots hide nothing, and distance does not matter. There is
    a sensor for each beacon that was there when the robot registered.
    """

    name = "beacons"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        parameters = world.parameters
        self._present = parameters.beacon_sensor
        self._requestable = parameters.beacon_requestable
        self._deviation = parameters.beacon_noise * math.pi / 180.0
        self._aperture = parameters.beacon_aperture
        self._beacons = robot.beacons_known
        hidden: tuple[float | None, ...] = (None,) * len(self._beacons)
        self._delay = Delay(parameters.beacon_latency, hidden)
        self.bearings = hidden

    @property
    def is_present(self) -> bool:
        """Whether the parameters give the robot one."""
        return self._present

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the names in SensorRequests."""
        return tuple(f"Beacon{number}" for number in range(len(self._beacons)))

    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure the beacons, if the parameters give the robot the sensors."""
        if self._present:
            draw = self.noise[scene.running].normal
            self.bearings = self._delay.pass_through(
                tuple(self._look(robot, beacon, draw()) for beacon in self._beacons)
            )

    def _look(self, robot: Robot, beacon: Beacon, deviate: float) -> float | None:
        direction = bearing(robot.x, robot.y, beacon.x, beacon.y)
        angle = wrap_angle(wrap_angle(direction - robot.heading) + self._deviation * deviate)
        if abs(angle) > self._aperture or self._is_hidden(robot, beacon, direction):
            return None
        return float(math.floor(angle * 180.0 / math.pi + 0.5))

    def _is_hidden(self, robot: Robot, beacon: Beacon, direction: float) -> bool:
        walls = self.world.walls_hiding(beacon.height)
        if not walls.touches(beacon.x, beacon.y, ON_A_WALL):
            return bool(walls.blocked(robot.x, robot.y, beacon.x, beacon.y))
        # The last bit decides, as with the carried beacon, which stands on the border: ask the real rules.
        distance = math.sqrt((robot.x - beacon.x) ** 2 + (robot.y - beacon.y) ** 2)
        return ray_distance_by_angles(walls.nearby, robot.x, robot.y, direction) < distance

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report all, or those requested."""
        if self._present:
            fields["beacons"] = tuple(
                BeaconReading(beacon=number, bearing=angle)
                for number, angle in enumerate(self.bearings)
                if not self._requestable or f"Beacon{number}" in robot.requests
            )

    def record(self, fields: dict[str, Any]) -> None:
        """Report all."""
        if self._present:
            fields["beacons"] = tuple(
                BeaconReading(beacon=number, bearing=angle) for number, angle in enumerate(self.bearings)
            )
