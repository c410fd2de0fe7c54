"""Hearing of the robots: the messages of this cycle from all robots around, themselves included."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ciberrato.protocol import HeardMessage
from simulator_stub.sensors.base import Scene, Sensor

if TYPE_CHECKING:
    from simulator_stub.world.noise import NoiseRoot
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

REACH = 8.0
"""Units between the robots' centres at which nothing is heard any more."""


class Hearing(Sensor):
    """Hears every robot nearer than `REACH` after the move, in order of their ids; walls do not matter.

    Robots that were removed are still heard, from where they were.

    Attributes
    ----------
    heard : tuple of HeardMessage
        In this cycle.
    """

    name = "hearing"

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        super().__init__(world, robot, noise)
        self.heard: tuple[HeardMessage, ...] = ()

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle."""
        return True

    def update(self, robot: Robot, scene: Scene) -> None:
        """Deliver the messages heard."""
        if not (scene.speakers or self.heard):
            return
        self.heard = tuple(
            HeardMessage(sender=speaker.robot_id, text=speaker.said)
            for speaker in scene.speakers
            if speaker.said is not None and math.hypot(speaker.x - robot.x, speaker.y - robot.y) < REACH
        )

    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Report what was said."""
        if self.heard:
            fields["messages"] = self.heard
