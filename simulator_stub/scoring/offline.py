"""Modes 5 and 6 count alike: cycles off the lines. The number rises, and is meant to stay low."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ciberrato.geometry.walls import WallMap
from simulator_stub.scoring.base import Scoring

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

OFF_LINE = 10
"""For each cycle off the lines."""
NEAR = math.nextafter(0.5, 1.0)
"""Nearer than this, so at most half a unit from its sides, is on a line."""


class OffLineScoring(Scoring):
    """Adds 10 for each cycle off all lines and walls; takes the penalties of collisions away.

    The signs are those of the real simulator.

    Parameters
    ----------
    world : World
    """

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._everything = WallMap.from_lab(world.lab, at_least=-math.inf)
        self._counts: dict[int, int] = {}

    def update(self, robot: Robot, time: int, robots: Sequence[Robot]) -> None:
        """Count one cycle."""
        count = self._counts.get(robot.robot_id, 0) - self.collision_penalty(robot)
        if not self._everything.touches(robot.x, robot.y, NEAR):
            count += OFF_LINE
        self._counts[robot.robot_id] = robot.score = count
