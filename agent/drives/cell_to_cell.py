"""From cell to cell, once the pose is known: from centre to centre, turning in place.

The robot goes to the nearest cell that it has not been in, and when it has been in all, to the one where
it was longest ago. The estimate keeps it on the line between the centres; what the IR sensors say ahead
and beside limits its speed, whatever the belief says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.drives.cell_graph import (
    LEAST_CLEARANCE,
    Beginning,
    CellGraph,
    Edge,
    centre,
    find_stands,
    join_cells,
    turning_cycles,
)
from agent.drives.clearance import SAFE_CLEARANCE
from agent.drives.detour import is_clear, shortest_detour
from agent.drives.safety import STOP_SHORT, Bumper
from ciberrato.geometry.angles import short_turn
from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.physics.kinematics import MAX_POWER, Command, advance, filter_wheels
from ciberrato.protocol.messages import Measures
from ciberrato.world.coordinates import Cell, Pose
from ciberrato.world.lab import CELL_SIZE, Lab

_HOLD = 5  # cycles for which the pose must be known before
_LOST_AFTER = 6  # cycles without a claim after which it is not
_CLEARANCE = 0.57
"""Units that a path which is not one between neighbours keeps from walls."""
_NEAR = 2.3  # units within which a cell's centre may be the first
_AHEAD = 0.45
"""Units before a centre at which the robot must know whether it goes straight on."""
_THERE = 0.05
_NEAR_ENOUGH = 0.3
"""Units before a place at which the robot is there, if it can get no nearer."""
_ALIGNED = math.radians(4.0)
_ASTRAY = math.radians(25.0)
_OFF_LINE = 0.4
_DRIFT = 0.4  # units between estimate and dead reckoning over a leg
_DRIFT_TURN = math.radians(30.0)
_BLOCKED_FOR = 4  # cycles
_LONGEST_TURN = 22  # cycles; half a turn takes 13
_BARRED_FOR = 200
_SHORT_TIME = 60
_IN_THE_WAY = 2.4
"""Reading ahead from which on all of the cone is in the robot's way."""
_REMEMBERED = 8  # cycles
_BACK_OFF = 3
_BACKWARDS: Command = (-0.1, -0.1)
_PAUSE = 30
"""Cycles of free legs after failures in a row."""


class _Stop(NamedTuple):
    """A place on the way, and the cell whose centre it is."""

    x: float
    y: float
    cell: Cell | None


class CellDrive:
    """Drives from cell to cell while it knows where the robot is.

    Parameters
    ----------
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    obstacle_noise : float
    speed : float
        Motor command for driving straight on, in units per cycle.
    """

    def __init__(self, angles: tuple[float, ...], obstacle_noise: float, *, speed: float = MAX_POWER) -> None:
        self._bumper = Bumper(angles, obstacle_noise)
        self._speed = min(speed, MAX_POWER)
        self._lattice: Lattice | None = None
        self._tick = 0
        self._known = self._unknown = 0
        self._restarts = 0
        self._pose: Pose | None = None
        self._reckoned: Pose | None = None
        """The pose by dead reckoning since the leg began."""
        self._wheels: Command = (0.0, 0.0)
        self._begin: tuple[float, float] = (0.0, 0.0)
        self._path: list[_Stop] = []
        self._turning = False
        self._blocked = self._backing = self._pause = self._turned = 0
        self._failed = -_SHORT_TIME
        self._clear, self._clear_until = math.inf, 0
        self._barred: dict[Edge, int] = {}
        self._enclosed = self._beyond = False
        self._seen: NDArray[np.float64] = np.zeros((0, 0))

    def _prepare(self, pose_filter: GridFilter) -> None:
        lab: Lab = pose_filter.lab
        self._lattice = pose_filter.planning_tables.lattice
        self._graph: CellGraph = join_cells(self._lattice, lab.rows, lab.columns)
        self._stands = find_stands(self._lattice, lab.columns)
        self._walls = WallMap.from_lab(lab)
        self._forget_visits()

    def _forget_visits(self) -> None:
        self._seen = np.full(self._graph.free.shape, -math.inf)
        self._enclosed = self._beyond = False
        self._barred.clear()

    # --- every cycle ------------------------------------------------------------------------------------

    def observe(self, measures: Measures, pose_filter: GridFilter, last: Command | None) -> None:
        """Process a message, also where another drive decides on the answer.

        Parameters
        ----------
        measures : Measures
        pose_filter : GridFilter
            Has taken it in.
        last : (float, float) or None
            The command given before; None if that is not known.
        """
        self._tick += 1
        self._bumper.observe(measures.infrared)
        if last is None:
            self._wheels = pose_filter.wheels
        else:
            self._wheels = filter_wheels(last, self._wheels)
        if last is None or measures.collision:
            self._reckoned = None  # it did not move as the commands say
        elif self._reckoned is not None:
            self._reckoned = advance(*self._reckoned, *self._wheels)
        found = pose_filter.estimate()
        if len(pose_filter.restarts) > self._restarts:
            self._restarts = len(pose_filter.restarts)
            self._known = 0
            self._lose()
            if self._lattice is not None:
                self._forget_visits()  # some of them were made elsewhere
        if not (found.certain or (found.likely and self._pose is not None)):
            self._unknown += 1
            self._known = 0
            if self._unknown >= _LOST_AFTER:
                self._lose()
            elif self._pose is not None:
                self._pose = advance(*self._pose, *self._wheels)
            return
        if self._lattice is None:
            self._prepare(pose_filter)
        self._known, self._unknown = self._known + 1, 0
        if self._known >= _HOLD or self._pose is not None:
            self._take_pose((found.x, found.y, found.heading))
        row, column = found.cell
        if 0 <= row < self._seen.shape[0] and 0 <= column < self._seen.shape[1]:
            if self._seen[row, column] == -math.inf:
                self._enclosed = self._beyond = False
            self._seen[row, column] = self._tick

    def _take_pose(self, pose: Pose) -> None:
        """Adopt an estimate; one that does not move as the wheels do is not trusted for a while."""
        if self._pose is None or self._reckoned is None:
            self._reckoned = pose
        x, y, heading = self._reckoned
        turned = abs(short_turn(heading - pose[2]))
        if math.hypot(x - pose[0], y - pose[1]) > _DRIFT or turned > _DRIFT_TURN:
            self._pause = 2 * _PAUSE
            self._reckoned = None
        self._pose = pose

    def _lose(self) -> None:
        self._pose, self._reckoned, self._path = None, None, []

    def decide(self, measures: Measures) -> Command | None:
        """Decide what to do.

        Parameters
        ----------
        measures : Measures
            As observed before.

        Returns
        -------
        (float, float) or None
            None while the pose is not known, or there is no path to any cell: then others are to decide.
        """
        if self._pose is None or self._pause > 0:
            self._pause = max(self._pause - 1, 0)
            self._path, self._reckoned = [], None
            return None
        if measures.collision and self._backing == 0 and sum(self._wheels) >= 0.0:
            self._backing = _BACK_OFF
            self._fail()
        if self._backing > 0:
            self._backing -= 1
            return _BACKWARDS
        if not self._path and not self._set_out():
            self._pause = _PAUSE
            return None
        command = self._follow()
        if command is None:
            self._fail()
            return 0.0, 0.0
        return round(command[0], 4), round(command[1], 4)

    def _fail(self) -> None:
        """Block the path that the robot was on; after two failures in short time leave it to others."""
        if self._tick - self._failed < _SHORT_TIME:
            self._pause = _PAUSE
        self._failed = self._tick
        if self._path:
            cell = self._path[0].cell
            if cell is not None:
                until = self._tick + _BARRED_FOR
                self._barred[_cell_of(*self._begin), cell] = until
                if self._pose is not None:
                    self._barred[_cell_of(*self._pose[:2]), cell] = until
            else:
                self._give_up()
        self._path = []
        self._blocked = 0

    def _give_up(self) -> None:
        """Mark the cell at the end of the path as seen."""
        cell = _cell_of(*self._path[-1][:2])
        if cell in self._stands:
            self._seen[cell] = self._tick

    def _closed(self, edge: Edge) -> bool:
        return self._barred.get(edge, 0) > self._tick

    # --- where to ---------------------------------------------------------------------------------------

    def _set_out(self) -> bool:
        """Find a path from where the robot is; say whether there is one."""
        assert self._pose is not None
        x, y, heading = self._pose
        beginnings = []
        here = _cell_of(x, y)
        rows, columns = self._graph.free.shape
        for row in range(max(here[0] - 1, 0), min(here[0] + 2, rows)):
            for column in range(max(here[1] - 1, 0), min(here[1] + 2, columns)):
                cell = row, column
                there = centre(cell)
                away = math.hypot(there[0] - x, there[1] - y)
                if not self._graph.free[cell] or away > _NEAR or self._closed((here, cell)):
                    continue
                if not is_clear(self._walls, (x, y), there, _CLEARANCE):
                    continue
                bearing = math.atan2(there[1] - y, there[0] - x) if away > _THERE else heading
                cycles = away / self._speed + turning_cycles(bearing - heading)
                beginnings.append(Beginning(cell, cycles, bearing))
        self._path = self._plan(beginnings, (x, y))
        self._start_leg((x, y))
        return bool(self._path)

    def _plan(self, beginnings: Sequence[Beginning], place: tuple[float, float]) -> list[_Stop]:
        assert self._lattice is not None
        cells = self._graph.quickest(beginnings, self._seen, self._closed)
        if cells and self._seen[cells[-1]] == -math.inf:
            return [_Stop(*centre(cell), cell) for cell in cells]
        # Nothing new can be reached from centre to centre.
        if not (beginnings and self._enclosed):
            detour = shortest_detour(
                self._lattice, self._walls, place, self._ends(beginnings), LEAST_CLEARANCE
            )
            if detour:
                goal = _cell_of(*detour[-1])
                last = _Stop(*detour[-1], goal if math.dist(detour[-1], centre(goal)) < _THERE else None)
                return [*(_Stop(*corner, None) for corner in detour[:-1]), last]
            self._enclosed = bool(beginnings)
            self._beyond = self._enclosed and bool(
                shortest_detour(self._lattice, self._walls, place, self._ends(beginnings), SAFE_CLEARANCE)
            )
        return [_Stop(*centre(cell), cell) for cell in cells]

    def _ends(self, beginnings: Sequence[Beginning]) -> list[tuple[float, float]]:
        """List where a detour may end: in cells not seen yet, or, far from all centres, at any centre."""
        if beginnings:
            return [stand for cell, stand in self._stands.items() if self._seen[cell] == -math.inf]
        return [centre((int(row), int(column))) for row, column in np.argwhere(self._graph.free)]

    def _extend(self) -> None:
        """Extend the path from its last place, in time to go straight on there."""
        last = self._path[-1]
        if last.cell is None or self._beyond:
            return
        self._seen[last.cell] = self._tick
        on = self._plan([Beginning(last.cell, 0.0, self._direction(last))], last[:2])
        self._path += on[1:] if on and on[0].cell == last.cell else on

    # --- along the way ----------------------------------------------------------------------------------

    def _direction(self, stop: _Stop) -> float:
        return math.atan2(stop.y - self._begin[1], stop.x - self._begin[0])

    def _start_leg(self, begin: tuple[float, float]) -> None:
        self._begin = begin
        self._reckoned = self._pose
        self._clear_until = 0
        self._turning = True
        self._blocked = self._turned = 0

    def _follow(self) -> Command | None:
        """Return the command for the leg that the robot is on; None if it is blocked."""
        assert self._pose is not None
        x, y, heading = self._pose
        moved = (self._wheels[0] + self._wheels[1]) / 2.0
        for _ in range(4):  # places that the robot is at already
            stop = self._path[0]
            direction = self._direction(stop)
            if math.hypot(stop.x - self._begin[0], stop.y - self._begin[1]) < _THERE:
                direction = heading
            cosine, sine = math.cos(direction), math.sin(direction)
            left = (stop.x - x) * cosine + (stop.y - y) * sine
            if left > _AHEAD:
                break
            there = left - moved <= _THERE or (self._blocked > _BLOCKED_FOR and left <= _NEAR_ENOUGH)
            if len(self._path) == 1:
                self._extend()
            if len(self._path) == 1:
                if not there:
                    break
                self._give_up()
                self._path = []
                # Free legs may get through where there is less clearance than a detour asks for.
                self._pause = _PAUSE if self._beyond else 0
                return 0.0, 0.0
            following = self._path[1]
            onwards = math.atan2(following.y - stop.y, following.x - stop.x)
            straight = abs(short_turn(onwards - direction)) < 0.05
            if not straight and not there:
                break
            self._path.pop(0)
            turning = self._turning
            self._start_leg(stop[:2])
            self._turning = turning if straight else True
        beside = -(x - stop.x) * sine + (y - stop.y) * cosine  # to the left of the line
        if abs(beside) > _OFF_LINE:
            self._path = []
            return 0.0, 0.0
        return self._steer(direction - heading, beside, left)

    def _steer(self, turn: float, beside: float, left: float) -> Command | None:
        moved, turned = (self._wheels[0] + self._wheels[1]) / 2.0, self._wheels[1] - self._wheels[0]
        turn = short_turn(turn)
        if self._turning or abs(turn) > _ASTRAY:
            # What the wheels run on by is part of the way to come.
            self._turning = abs(turn - turned) > _ALIGNED
            if self._turning:
                self._turned += 1
                if self._turned > _LONGEST_TURN:
                    return None
                rate = min(max(turn - turned, -2.0 * MAX_POWER), 2.0 * MAX_POWER)
                off = self._bumper.retreat
                return off - rate / 2.0, off + rate / 2.0
        power = min(self._speed, left - moved, self._limit(moved))
        if power < 0.01:
            self._blocked += 1
            if self._blocked > _BLOCKED_FOR and left > _NEAR_ENOUGH:
                self._backing = _BACK_OFF  # a turn in place needs room
                return None
        else:
            self._blocked = 0
        back_to_line = -math.atan(min(max(1.2 * beside, -0.4), 0.4)) if left > 0.2 else 0.0
        rate = 0.5 * (turn + back_to_line) - 0.5 * turned + 0.5 * self._bumper.steer
        rate = min(max(rate, -0.1), 0.1)
        power = max(min(power, MAX_POWER - abs(rate) / 2.0), -0.05)
        return power - rate / 2.0, power + rate / 2.0

    def _limit(self, moved: float) -> float:
        """Return the fastest safe command; what was so near ahead is there still when it leaves the cone."""
        remembered = self._clear - moved if self._tick < self._clear_until else math.inf
        if self._bumper.ahead > _IN_THE_WAY:
            self._clear_until = self._tick + _REMEMBERED
            remembered = min(remembered, 1.0 / self._bumper.ahead)
        self._clear = remembered
        return min(self._bumper.limit(moved), max(remembered - STOP_SHORT - moved, 0.0))


def _cell_of(x: float, y: float) -> Cell:
    return int(y // CELL_SIZE), int(x // CELL_SIZE)
