"""The score sensor: the robot's own score, as views receive it. No noise."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ciberrato.protocol import ScoreReading
from simulator_stub.sensors.base import Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


class ScoreSensor(Sensor):
    """Reads the score after this cycle has been counted, signed."""

    name = "score"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self._present = world.parameters.score_sensor
        self._targets = len(world.lab.targets)

    @property
    def is_present(self) -> bool:
        """Whether the parameters give the robot one."""
        return self._present

    def update(self, robot: Robot, scene: Scene) -> None:
        """Do nothing: scores are counted after the sensors."""

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report it if the parameters give the robot the sensor."""
        if self._present:
            fields["score"] = ScoreReading(
                score=robot.score,
                arrival_time=robot.arrival_time,
                returning_time=robot.returning_time,
                collisions=robot.collisions,
                collision=robot.collides,
                visited_mask=robot.visited_mask(self._targets),
            )
