"""Modes 0, 2 and 3 count alike: targets to visit, and a way back. Low is good."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ciberrato.geometry.shortest_paths import PathsFrom, disc_paths
from ciberrato.physics.kinematics import ROBOT_RADIUS
from simulator_stub.scoring.base import Scoring
from simulator_stub.world.robot_state import RobotState

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

TARGET_REWARD = 100
"""For each target, and for signalling the return. The parameters of that name are not looked at."""
AWAY_PENALTY = 5
"""For each cycle with the visiting LED on and no target below."""
NOT_FINISHED_PENALTY = 15
"""For a return that the end of time cuts short."""
FAR = 2**31 - 1
"""Most that a score shows, however much farther than at the beginning a robot is from its start."""


@dataclass(slots=True)
class _Account:
    """Account of one robot.

    Attributes
    ----------
    points : int
        Points that stay: penalties, less the points of targets.
    arrival_distance : float
        Shortest way from the start to the place where the return began; 0 before.
    departure : int
        Time at which the return began.
    paths : PathsFrom or None
        Shortest ways from the robot's start position; None until they are needed.
    """

    points: int
    arrival_distance: float = 0.0
    departure: int = 0
    paths: PathsFrom | None = None


class TargetScoring(Scoring):
    """Counts targets visited with the visiting LED, and the way back after the returning LED.

    Parameters
    ----------
    world : World
    """

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._accounts: dict[int, _Account] = {}

    def start_value(self) -> int:
        """Return the points that a robot has before it does anything."""
        return 0

    def may_return(self, robot: Robot) -> bool:
        """Return whether it is inside a target, and has visited all."""
        return self._all_visited(robot) and self._target_below(robot) is not None

    def update(self, robot: Robot, time: int, robots: Sequence[Robot]) -> None:
        """Count one cycle."""
        account = self._accounts.get(robot.robot_id)
        if account is None:
            account = self._accounts[robot.robot_id] = _Account(self.start_value())
        if robot.touches_wall or robot.touches_robot:
            account.points += self.collision_penalty(robot)
        if robot.state is RobotState.RETURNING:
            self._update_returning(robot, account, time)
        else:
            self._update_running(robot, account, time)

    def _update_running(self, robot: Robot, account: _Account, time: int) -> None:
        shown = 0
        if robot.end_led and self.may_return(robot):
            account.arrival_distance = self._way_home(robot, account)
            robot.arrival_time = time
            shown = self._share_of_way(robot, account)
        elif robot.returning_led and self.may_return(robot):
            account.points -= TARGET_REWARD
            account.arrival_distance = self._way_home(robot, account)
            account.departure = time
            shown = self._share_of_way(robot, account)
        elif robot.visiting_led:
            self._visit(robot, account)
            shown = TARGET_REWARD
        robot.score = account.points + shown
        if not robot.visited:
            robot.arrival_time = time

    def _update_returning(self, robot: Robot, account: _Account, time: int) -> None:
        if time == self.world.parameters.sim_time and not robot.end_led:
            account.points += NOT_FINISHED_PENALTY
        robot.returning_time = time - account.departure
        if "returning_led" in robot.received and robot.returning_led and self.may_return(robot):
            account.arrival_distance = self._way_home(robot, account)
            account.departure = time
        elif robot.visiting_led:
            self._visit(robot, account)
        robot.score = min(account.points + self._share_of_way(robot, account), FAR)

    def _visit(self, robot: Robot, account: _Account) -> None:
        target = self._target_below(robot)
        if target is None:
            account.points += AWAY_PENALTY
        elif target not in robot.visited:
            robot.visited.add(target)
            account.points -= TARGET_REWARD

    def _all_visited(self, robot: Robot) -> bool:
        return len(robot.visited) == len(self.world.lab.targets)

    def _target_below(self, robot: Robot) -> int | None:
        """Find the first target that the whole robot is in."""
        for number, target in enumerate(self.world.lab.targets):
            if math.hypot(robot.x - target.x, robot.y - target.y) <= target.radius - ROBOT_RADIUS:
                return number
        return None

    def _share_of_way(self, robot: Robot, account: _Account) -> int:
        return share_of_way(self._way_home(robot, account), account.arrival_distance)

    def _way_home(self, robot: Robot, account: _Account) -> float:
        if account.paths is None:
            start = self.world.grid.positions[robot.robot_id - 1]
            account.paths = disc_paths(self.world.lab, ROBOT_RADIUS).paths_from(start.x, start.y)
        return account.paths.length_to(robot.x, robot.y)


def share_of_way(way: float, arrival_distance: float) -> int:
    """Compute the path home in percent of its length when the return began, rounded down.

    The real simulator keeps the way, and a hundred times it, in single precision, but not what it divides
    that by, so that the share may be 99 at the very place where the return began. It is 0 where the return
    began at the start position, and where there is no way.

    Parameters
    ----------
    way, arrival_distance : float
        Now, and when the return began; units.

    Returns
    -------
    int
    """
    if not 0.0 < arrival_distance < math.inf or way == math.inf:
        return 0
    hundredfold = float(np.float32(100.0 * float(np.float32(way))))
    return int(min(hundredfold / arrival_distance, FAR))
