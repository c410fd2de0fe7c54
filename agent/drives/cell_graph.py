"""Graph of the cells between which a robot can drive, from centre to centre, and its paths.

Two neighbouring cells are *joined* if the straight path between their centres keeps clear of all walls, as
the lattice's clearance has it; a cell whose centre has no place for the robot is joined to none. So cells
of labs built from rows and of labs with walls anywhere are treated alike.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agent.drives.clearance import clearance
from ciberrato.geometry.angles import short_turn
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.physics.kinematics import MAX_POWER, ROBOT_RADIUS
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE

Edge = tuple[Cell, Cell]

LEAST_CLEARANCE = ROBOT_RADIUS + 0.09
"""Units that the nodes of a path keep from walls; what lies between two of them is at most 0.01 nearer."""
STEPS = ((0, 1), (1, 0), (0, -1), (-1, 0))
"""Of row and column, to the east, north, west and south: at headings of 0, 90, 180 and 270 degrees."""
_TURN_RATE = 2.0 * MAX_POWER  # radians per cycle
_TURN_OVERHEAD = 3.5
"""Cycles that braking, setting out, and what the wheels run on take when the robot turns in place."""
_STRAGGLER = 6.0
"""Cycles that it is worth to take a cell along that has no neighbour left to be seen."""


@dataclass(frozen=True, slots=True)
class Beginning:
    """A cell to begin with.

    Attributes
    ----------
    cell : (int, int)
    cycles : float
        Time to get to its centre.
    heading : float
        Radians; with which the robot gets there.
    """

    cell: Cell
    cycles: float
    heading: float


@dataclass(frozen=True, slots=True, eq=False)
class CellGraph:
    """Cells and the straight paths between neighbours.

    Attributes
    ----------
    free : array of bool, shape (rows, columns)
        Whether the robot can stand in the centre; row 0 is the bottom row.
    joined : array of bool, shape (rows, columns, 4)
        Whether it can drive straight to the neighbour's centre, in the order of `STEPS`.
    """

    free: NDArray[np.bool_]
    joined: NDArray[np.bool_]

    def neighbours(self, cell: Cell) -> list[Cell]:
        """Return the cells to which there is a straight path."""
        return [(cell[0] + STEPS[k][0], cell[1] + STEPS[k][1]) for k in np.flatnonzero(self.joined[cell])]

    def quickest(
        self,
        beginnings: Sequence[Beginning],
        seen: NDArray[np.float64],
        closed: Callable[[Edge], bool],
    ) -> list[Cell]:
        """Find the path to the nearest cell not seen yet; if all are, to the one seen longest ago.

        Nearest is what takes the fewest cycles, turns included; a cell whose neighbours have all been seen
        counts as a little nearer, as coming back for it alone would take long.

        Parameters
        ----------
        beginnings : sequence of Beginning
        seen : array, shape (rows, columns)
            Time at which the robot was last in each cell; minus infinity for never.
        closed : callable
            Says of an edge whether it is not to be taken.

        Returns
        -------
        list of (int, int)
            Cells by their order, the first of them a beginning; empty if there is nowhere to go.
        """
        cycles: dict[tuple[Cell, int], float] = {}
        before: dict[tuple[Cell, int], tuple[Cell, int] | None] = {}
        queue: list[tuple[float, Cell, int, float, tuple[Cell, int] | None]] = [
            (begin.cycles, begin.cell, -1, begin.heading, None) for begin in beginnings
        ]
        heapq.heapify(queue)
        best: tuple[float, float] = (math.inf, math.inf)
        goal: tuple[Cell, int] | None = None
        while queue:
            cost, cell, came, heading, parent = heapq.heappop(queue)
            if best[0] == -math.inf and cost > best[1] + _STRAGGLER:
                break
            here = cell, came
            if here in cycles:
                continue
            cycles[here], before[here] = cost, parent
            if parent is not None or seen[cell] == -math.inf:
                worth = (float(seen[cell]), cost - self._bonus(cell, seen))
                if worth < best:
                    best, goal = worth, here
            for direction in np.flatnonzero(self.joined[cell]):
                there = cell[0] + STEPS[direction][0], cell[1] + STEPS[direction][1]
                if closed((cell, there)) or (there, int(direction)) in cycles:
                    continue
                total = cost + turning_cycles(direction * math.pi / 2.0 - heading) + CELL_SIZE / MAX_POWER
                heapq.heappush(queue, (total, there, int(direction), direction * math.pi / 2.0, here))
        path = []
        while goal is not None:
            path.append(goal[0])
            goal = before[goal]
        return path[::-1]

    def _bonus(self, cell: Cell, seen: NDArray[np.float64]) -> float:
        alone = seen[cell] == -math.inf and all(seen[other] > -math.inf for other in self.neighbours(cell))
        return _STRAGGLER if alone else 0.0


def join_cells(lattice: Lattice, rows: int, columns: int, least: float = LEAST_CLEARANCE) -> CellGraph:
    """Find the straight paths between neighbouring cells.

    Parameters
    ----------
    lattice : Lattice
        Cell centres are nodes.
    rows, columns : int
        Rows and columns of the lab.
    least : float
        Units that all nodes on the path are away from walls.

    Returns
    -------
    CellGraph
    """
    along = np.linspace(0.0, CELL_SIZE, round(CELL_SIZE / lattice.resolution) + 1)
    y, x = np.meshgrid(np.arange(rows) * CELL_SIZE + 1.0, np.arange(columns) * CELL_SIZE + 1.0, indexing="ij")
    joined = np.zeros((rows, columns, 4), np.bool_)
    for direction, (up, right) in enumerate(STEPS):
        clearances = clearance(lattice, x[..., np.newaxis] + right * along, y[..., np.newaxis] + up * along)
        joined[..., direction] = clearances.min(axis=-1) >= least
    joined[:, -1:, 0] = joined[-1:, :, 1] = joined[:, :1, 2] = joined[:1, :, 3] = False
    return CellGraph(free=clearance(lattice, x, y) >= least, joined=joined)


def find_stands(
    lattice: Lattice, columns: int, least: float = LEAST_CLEARANCE
) -> dict[Cell, tuple[float, float]]:
    """Find where in each cell the robot can stand: as near to the centre as it fits.

    Parameters
    ----------
    lattice : Lattice
    columns : int
        Columns of the lab.
    least : float
        Units from walls.

    Returns
    -------
    dict
        From cells to nodes of the lattice (x, y in units); cells where it does not fit are left out.
    """
    fitting = np.flatnonzero(lattice.clearance >= least)
    row, column = np.divmod(lattice.cell[fitting], columns)
    x, y = lattice.x[fitting], lattice.y[fitting]
    away = np.hypot(x - (column + 0.5) * CELL_SIZE, y - (row + 0.5) * CELL_SIZE)
    stands: dict[Cell, tuple[float, float]] = {}
    for k in np.argsort(away, kind="stable"):
        stands.setdefault((int(row[k]), int(column[k])), (float(x[k]), float(y[k])))
    return stands


def centre(cell: Cell) -> tuple[float, float]:
    """Return the centre of a cell in units: x, y."""
    return (cell[1] + 0.5) * CELL_SIZE, (cell[0] + 0.5) * CELL_SIZE


def turning_cycles(angle: float) -> float:
    """Return how long a turn in place takes, in radians; none takes nothing."""
    angle = abs(short_turn(angle))
    return 0.0 if angle < 0.1 else angle / _TURN_RATE + _TURN_OVERHEAD
