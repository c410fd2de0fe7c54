"""The line sensor: seven points across, in front of the centre, that tell painted lines from floor.

Draws seven uniforms a cycle, leftmost element first.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from simulator_stub.sensors.base import Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.noise import NoiseRoot
    from simulator_stub.robot import Robot
    from simulator_stub.world import World

AHEAD = 0.438
"""Units before the robot's centre."""

SIDEWAYS = (0.24, 0.16, 0.08, 0.0, -0.08, -0.16, -0.24)
"""Units to the left of the robot's axis, in the order of the characters."""


class LineSensor(Sensor):
    """Reads 1 where a point is inside a wall or line of whatever height (the border does not count).

    Each element is wrong with probability 1 - LineSensorTrueProb.
    """

    name = "line"

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the name in SensorRequests: it is sent anyway, but asking for it uses up a request."""
        return ("LineSensor",)

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self._right_probability = world.parameters.line_sensor_true_probability
        self.reading = "0" * len(SIDEWAYS)

    def update(self, robot: Robot, scene: Scene) -> None:
        """Look at the seven points."""
        cosine, sine = math.cos(robot.heading), math.sin(robot.heading)
        draw = self.noise[scene.running].uniform
        elements = []
        for side in SIDEWAYS:
            x = robot.x + AHEAD * cosine - side * sine
            y = robot.y + AHEAD * sine + side * cosine
            inside = self.world.floor.is_marked(x, y)
            right = draw() < self._right_probability
            elements.append("1" if inside == right else "0")
        self.reading = "".join(elements)

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report it: it is always there."""
        fields["line"] = self.reading

    def record(self, fields: dict[str, Any]) -> None:
        """Report it."""
        fields["line"] = self.reading
