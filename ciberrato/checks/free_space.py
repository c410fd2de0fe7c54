"""Free space of a lab: the places in which a robot can be, and between which it can drive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.geometry.walls import WallMap
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab

MOST_NODES = 400_000
"""Of the lattice: a lab of 126 x 126 units and more is not looked at."""

MOST_DISTANCES = 2 * 10**9
"""Of nodes to faces: where there are more, the lab is not looked at either."""

_STEPS = (0.1, 0.2)
_FINE_NODES = 10_000


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A lattice over a lab, cut into parts between which no robot can drive.

    It errs on the side of the robot: nodes count as free where a free place may be near, so that what is in
    two parts is certainly apart.

    Attributes
    ----------
    walls : WallMap
        Walls that stop robots.
    step : float
        Between nodes, in units.
    clearance : array, shape (rows, columns)
        Distance of each node to the nearest wall; 0 inside walls. Row 0 is the bottom row, half a step above
        the border.
    part : array of int, shape (rows, columns)
        Number of the part that a node belongs to, the largest being 0; -1 where no robot fits.
    """

    __repr__ = short_repr

    walls: WallMap
    step: float
    clearance: NDArray[np.float64]
    part: NDArray[np.int64]

    def places(self, part: int) -> NDArray[np.float64]:
        """Return the free nodes of a part, shape (n, 2), in units."""
        row, column = np.nonzero((self.part == part) & (self.clearance >= ROBOT_RADIUS - 1e-9))
        return np.stack(((column + 0.5) * self.step, (row + 0.5) * self.step), axis=1)

    def parts_near(self, x: float, y: float, radius: float) -> set[int]:
        """Return the numbers of the parts that come within a radius of a place."""
        rows, columns = self.part.shape
        low_x, high_x = (int((x + side * radius) / self.step) for side in (-1, 1))
        low_y, high_y = (int((y + side * radius) / self.step) for side in (-1, 1))
        row, column = np.mgrid[
            max(low_y, 0) : max(min(high_y + 1, rows), max(low_y, 0)),
            max(low_x, 0) : max(min(high_x + 1, columns), max(low_x, 0)),
        ]
        off = np.hypot((column + 0.5) * self.step - x, (row + 0.5) * self.step - y)
        return set(self.part[row, column][off <= radius].tolist()) - {-1}


def solid(lab: Lab) -> Lab:
    """Return the lab without lines on the floor."""
    return replace(lab, walls=tuple(wall for wall in lab.walls if wall.height > 0.0))


def blocked(walls: WallMap, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
    """Return whether points are inside a wall or outside the lab.

    Parameters
    ----------
    walls : WallMap
        Walls of a lab without lines.
    x, y : array_like
        Units.
    """
    px, py = np.asarray(x, np.float64), np.asarray(y, np.float64)
    outside = (px < 0.0) | (py < 0.0) | (px > walls.width) | (py > walls.height)
    return np.asarray(outside | walls.point_in_polygons(px, py))


def free_space(lab: Lab) -> FreeSpace | None:
    """Compute where a robot can be.

    Parameters
    ----------
    lab : Lab

    Returns
    -------
    FreeSpace or None
        None for a lab that is too large to be looked at.
    """
    from scipy.ndimage import label

    area = lab.width * lab.height
    step = _STEPS[area / _STEPS[0] ** 2 > _FINE_NODES]
    if area / step**2 > MOST_NODES:
        return None
    walls = WallMap.from_lab(solid(lab))
    columns, rows = max(math.ceil(lab.width / step), 1), max(math.ceil(lab.height / step), 1)
    if columns * rows * walls.length.size > MOST_DISTANCES:
        return None
    x, y = np.meshgrid((np.arange(columns) + 0.5) * step, (np.arange(rows) + 0.5) * step)
    clearance = walls.distance(x, y)
    clearance[blocked(walls, x, y)] = 0.0
    # A free place is at most half a diagonal from a node.
    free = clearance >= ROBOT_RADIUS - step * math.sqrt(0.5)
    labels, count = label(free, structure=np.ones((3, 3)))
    # Corners that only a node's allowance makes: parts where no robot fits, not even nearly.
    room = np.zeros(count + 1, bool)
    room[labels[clearance >= ROBOT_RADIUS - 1e-9]] = True
    room[0] = False
    sizes = np.where(room, np.bincount(labels.ravel(), minlength=count + 1), 0)
    order = np.argsort(-sizes, kind="stable")
    number = np.full(count + 1, -1)
    number[order] = np.where(sizes[order] > 0, np.arange(count + 1), -1)
    return FreeSpace(walls, step, clearance, number[labels])
