"""``goto:X,Y``: finds out where it is, plans the shortest safe path, drives it, and says so with its LEDs."""

from __future__ import annotations

import heapq
import math
from enum import StrEnum

import numpy as np

from agent.drives.active import ActiveDrive
from agent.drives.base import Decision, DriveSetup
from agent.drives.clearance import clearance
from agent.drives.safety import Bumper
from ciberrato.arrays import Floats
from ciberrato.errors import UsageError
from ciberrato.geometry.angles import short_turn
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.physics.kinematics import STANDSTILL, Command, filter_wheels
from ciberrato.protocol.messages import Measures

ARRIVED_WITHIN = 0.15
"""Units from the goal at which the robot stops."""
_LEAST_CLEARANCE = 0.58
_AMPLE = 0.85  # units; steps nearer to walls count as longer
_LOOK_AHEAD = 1.0
_BACK_OFF = 5  # cycles
_TURN_IN_PLACE = math.radians(25.0)


class GotoPhase(StrEnum):
    """Activities of the robot."""

    LOCALIZING = "localizing"
    DRIVING = "driving"
    ARRIVED = "arrived"


def make(setup: DriveSetup) -> GotoDrive:
    """Create the drive."""
    return GotoDrive(setup.argument, setup.angles, setup.parameters.obstacle_noise, cruise=setup.cruise)


class GotoDrive:
    """Drives to a place from wherever the robot is.

    Parameters
    ----------
    goal : (float, float)
        Units.
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    obstacle_noise : float
    cruise : float
    """

    def __init__(
        self,
        goal: tuple[float, float],
        angles: tuple[float, ...],
        obstacle_noise: float,
        *,
        cruise: float = 0.1,
    ) -> None:
        self._goal = goal
        self._active = ActiveDrive(angles, obstacle_noise, cruise=cruise, stop=True)
        self._bumper = Bumper(angles, obstacle_noise)
        self._cruise = cruise
        self._costs: Floats | None = None
        self._wheels: Command = (0.0, 0.0)
        self._last: Command = (0.0, 0.0)
        self._backing = 0
        self.phase = GotoPhase.LOCALIZING

    def decide(self, measures: Measures, pose_filter: GridFilter) -> Decision:
        """Decide on a command, see `agent.drives.base.Drive`."""
        self._bumper.observe(measures.infrared)
        self._wheels = filter_wheels(self._last, self._wheels)
        if self.phase is GotoPhase.ARRIVED:
            return Decision(end_led=True, visiting_led=False, finished="arrived")
        if measures.collision:
            self._backing = _BACK_OFF
        if self._backing > 0:
            # Off the wall the way it came; what blocks it is not where the map or the belief has it.
            self._backing -= 1
            self._last = (-0.06, -0.06)
            return Decision(command=self._last)
        decision = self._active.decide(measures, pose_filter)
        self.phase = GotoPhase.DRIVING if self._active.localized else GotoPhase.LOCALIZING
        if self.phase is GotoPhase.DRIVING:
            decision = self._drive(pose_filter)
        self._last = decision.command
        return decision

    def _drive(self, pose_filter: GridFilter) -> Decision:
        lattice = pose_filter.planning_tables.lattice
        if self._costs is None:
            self._costs = costs_to(lattice, *self._goal)
        found = pose_filter.estimate()
        away = math.hypot(found.x - self._goal[0], found.y - self._goal[1])
        if away < ARRIVED_WITHIN:
            self.phase = GotoPhase.ARRIVED
            return Decision(command=STANDSTILL, visiting_led=True)
        if math.isinf(self._cost(_nearest(lattice, found.x, found.y))):
            return Decision(finished=f"there is no way to {self._goal[0]:g},{self._goal[1]:g}")
        x, y = self._carrot(lattice, found.x, found.y)
        bearing = short_turn(math.atan2(y - found.y, x - found.x) - found.heading)
        turning = self._wheels[1] - self._wheels[0]
        if abs(bearing) > _TURN_IN_PLACE:
            rate = min(max(bearing - turning, -0.2), 0.2)
            return Decision(command=(round(-rate / 2.0, 4), round(rate / 2.0, 4)))
        speed = self._cruise * max(self._bumper.speed, 0.2) * min(1.0, 0.3 + away)
        rate = min(max(0.5 * (bearing - turning), -0.1), 0.1) + self._bumper.steer * 0.5
        return Decision(command=(round(speed - rate / 2.0, 4), round(speed + rate / 2.0, 4)))

    def _carrot(self, lattice: Lattice, x: float, y: float) -> tuple[float, float]:
        """Find the farthest place ahead on the path to which the robot can drive straight on."""
        assert self._costs is not None
        square = _nearest(lattice, x, y)
        reached = (x, y)
        least = min(_LEAST_CLEARANCE, float(lattice.clearance[square]) - 0.01)
        for _ in range(round(_LOOK_AHEAD / lattice.resolution)):
            around = [int(lattice.neighbours(dx, dy)[square]) for dx, dy in _STEPS]
            best = min(around, key=lambda other: self._cost(other))
            if self._cost(best) >= self._cost(square):
                return self._goal
            square = best
            place = float(lattice.x[square]), float(lattice.y[square])
            share = np.linspace(0.1, 1.0, 10)
            line_x, line_y = x + share * (place[0] - x), y + share * (place[1] - y)
            if reached != (x, y) and clearance(lattice, line_x, line_y).min() < least:
                return reached
            reached = place
        return reached

    def _cost(self, square: int) -> float:
        assert self._costs is not None
        return float(self._costs[square]) if square < len(self._costs) else math.inf


_STEPS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)]


def _nearest(lattice: Lattice, x: float, y: float) -> int:
    return int(((lattice.x - x) ** 2 + (lattice.y - y) ** 2).argmin())


def costs_to(lattice: Lattice, x: float, y: float) -> Floats:
    """Compute the length of the shortest path from every square to a place; near walls lengths count more.

    Parameters
    ----------
    lattice : Lattice
    x, y : float
        Units.

    Returns
    -------
    array, shape (squares,)
        Units, infinite where there is no way.

    Raises
    ------
    UsageError
        If a robot cannot stand there.
    """
    goal = _nearest(lattice, x, y)
    if math.hypot(lattice.x[goal] - x, lattice.y[goal] - y) > lattice.resolution:
        raise UsageError(f"goto:{x:g},{y:g}: a robot cannot stand there")
    usable = np.append(lattice.clearance >= min(_LEAST_CLEARANCE, lattice.clearance[goal]), False)
    factor = 1.0 + 4.0 * np.maximum(_AMPLE - lattice.clearance, 0.0)
    steps = [(lattice.neighbours(dx, dy), lattice.resolution * math.hypot(dx, dy)) for dx, dy in _STEPS]
    costs = np.full(lattice.size, math.inf)
    costs[goal] = 0.0
    queue = [(0.0, goal)]
    while queue:
        cost, square = heapq.heappop(queue)
        if cost > costs[square]:
            continue
        for neighbours, length in steps:
            other = int(neighbours[square])
            if not usable[other]:
                continue
            total = cost + length * float(factor[other])
            if total < costs[other]:
                costs[other] = total
                heapq.heappush(queue, (total, other))
    # Squares too close to walls lead to their cheapest neighbour.
    for neighbours, length in steps:
        outside = np.isinf(costs)
        padded = np.append(costs, math.inf)
        costs[outside] = np.minimum(costs[outside], padded[neighbours[outside]] + 3.0 * length)
    return costs
