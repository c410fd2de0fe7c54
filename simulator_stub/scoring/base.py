"""Interface of scoring modes: they count each robot's points, and interpret the returning LED."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World


class Scoring:
    """One scoring mode; one object serves all robots of a simulation.

    Its memory of a robot is kept under the robot's id, or in the robot's score fields.

    Parameters
    ----------
    world : World

    Attributes
    ----------
    documents : dict of str to str
        Files that the real simulator leaves in its working directory, by name. They appear when a robot
        begins at time 0, and each robot overwrites those of the one before.
    notes : list of str
        Notes for the user, a line each; the caller that reports them takes them out.
    """

    mode: ClassVar[int]
    """Number on the command line."""

    judges_returning: ClassVar[bool] = False
    """Return whether the returning LED changes a robot's state."""

    has_documents: ClassVar[bool] = False
    """Return whether there will be `documents`."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.documents: dict[str, str] = {}
        self.notes: list[str] = []

    def begin(self, robot: Robot) -> None:
        """Prepare for a robot that is about to run for the first time, at time 0."""

    def update(self, robot: Robot, time: int, robots: Sequence[Robot]) -> None:
        """Count one running cycle of a robot that is running or returning; after the sensors.

        Parameters
        ----------
        robot : Robot
            Its score fields are written.
        time : int
            Cycles, this one included.
        robots : sequence of Robot
            All robots.
        """

    def may_return(self, robot: Robot) -> bool:
        """Return whether the returning LED, lit now, begins a return; otherwise it ends the robot's run."""
        return False

    def collision_penalty(self, robot: Robot) -> int:
        """Return the penalty of a collision that begins in this cycle; 0 if none does.

        Walls and robots are paid for separately, both if both are touched.
        """
        if not robot.collides or robot.collided_before:
            return 0
        parameters = self.world.parameters
        penalty = 0
        if robot.touches_wall:
            penalty += parameters.collision_wall_penalty
        if robot.touches_robot:
            penalty += parameters.collision_robot_penalty
        return penalty
