"""The line sensor: seven points across, in front of the centre, that distinguish painted lines from floor.

Draws seven uniforms a cycle, leftmost element first.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from simulator_stub.sensors.base import Scene, Sensor
from simulator_stub.world.floor import inside_any

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot, Stream
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

AHEAD = 0.438
"""Units before the robot's centre."""

SIDEWAYS = (0.24, 0.16, 0.08, 0.0, -0.08, -0.16, -0.24)
"""Units to the left of the robot's axis, in the order of the characters."""


BITS = np.array([64, 32, 16, 8, 4, 2, 1])
"""Weights of the elements in a number that stands for a reading."""

TEXTS = tuple(f"{marks:07b}" for marks in range(128))
"""The readings by that number."""

CYCLES_DRAWN = 64
"""Of no influence on the numbers."""


class LineSensor(Sensor):
    """Reads 1 where a point is inside a wall or line of whatever height (the border does not count).

    Each element is wrong with probability 1 - LineSensorTrueProb.

    Attributes
    ----------
    wrong : (list of int, list of int)
        Elements that are going to be wrong, as `BITS`, the next cycle last: while the simulator does not
        run, and while it runs.
    """

    name = "line"

    @property
    def request_names(self) -> tuple[str, ...]:
        """Return the name in SensorRequests: it is sent anyway, but asking for it uses up a request."""
        return ("LineSensor",)

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self._right_probability = world.parameters.line_sensor_true_probability
        self.wrong: tuple[list[int], list[int]] = ([], [])
        self.reading = TEXTS[0]

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle."""
        return True

    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure at the seven points."""
        cosine, sine = math.cos(robot.heading), math.sin(robot.heading)
        ahead_x, ahead_y = robot.x + AHEAD * cosine, robot.y + AHEAD * sine
        marks = 0
        outlines = self.world.floor.around(ahead_x, ahead_y)
        if outlines:
            for side in SIDEWAYS:
                marks = 2 * marks + inside_any(outlines, ahead_x - side * sine, ahead_y + side * cosine)
        wrong = self.wrong[scene.running]
        if not wrong:
            wrong += self._draw_wrong(self.noise[scene.running])
        self.reading = TEXTS[marks ^ wrong.pop()]

    def peek(self, cycles: int) -> list[int]:
        """Return which elements are going to be wrong in so many running cycles, the next one first."""
        wrong = self.wrong[True]
        while len(wrong) < cycles:
            wrong[:0] = self._draw_wrong(self.noise[True])
        return wrong[: -cycles - 1 : -1]

    def _draw_wrong(self, noise: Stream) -> list[int]:
        """Draw for many cycles which elements are wrong, the first cycle last."""
        numbers = noise.uniforms(CYCLES_DRAWN * len(SIDEWAYS)).reshape(CYCLES_DRAWN, len(SIDEWAYS))
        masks: list[int] = ((numbers >= self._right_probability) @ BITS).tolist()
        return masks[::-1]

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report it: it is always there."""
        fields["line"] = self.reading

    def record(self, fields: dict[str, Any]) -> None:
        """Report it."""
        fields["line"] = self.reading
