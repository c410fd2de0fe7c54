"""The lattice of places on which the pose filter keeps its belief.

Nodes are spaced so that the centres of the lab's 2 x 2 cells are nodes, on which robots start; a node
stands for the square around it. Only squares in which some pose is free (a robot's radius away from every
wall) are kept, and the readings of such a square are those of a *representative*: the node itself, or, if
a robot on the node would touch a wall, the nearest place where it does not.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.geometry.tiles import near_faces, wall_distances
from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief import compiled
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.reprs import short_repr
from ciberrato.world.lab import CELL_SIZE, Lab

Indices = NDArray[np.int64]

PAD = 4  # nodes around the lab that are never free, so that shifts need no checks
_TOLERANCE = 1e-6  # units; far above the arithmetic's error, so that equal places of a lab are treated alike
_REACH = 0.75  # of the resolution; half of it to the square's edge, the rest for the belief's offset


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Free squares of a lab, row by row from the bottom left.

    Attributes
    ----------
    resolution : float
        Units between nodes; `CELL_SIZE` is an odd multiple of it or it divides half a cell.
    nx, ny : int
        Nodes of the padded lattice.
    origin : (float, float)
        Units; the node at the lower left corner of the padded lattice.
    x, y : array, shape (squares,)
        Nodes of the free squares, in units.
    representative : array, shape (squares, 2)
        The free place nearest to each node.
    clearance : array, shape (squares,)
        Distance of the node to the nearest wall.
    cell : array of int, shape (squares,)
        Number of the lab's 2 x 2 cell, row by row from the bottom left.
    site : array of int, shape (squares,)
        Position in the padded lattice, row by row.
    index : array of int, shape (ny * nx + 1,)
        Number of the free square at each position; `squares` where there is none (also at the last entry).
    whole : Lattice or None
        Of a part of a lab (`ciberrato.localization.tables.tiled`): another lattice, of all of it, from which
        frequencies in the lab are taken. None: this one is of all of it.
    corner : (int, int)
        Columns and rows of nodes left of and below this part.
    first : (float, float) or None
        Units; of a part, the first node of all.
    """

    __repr__ = short_repr

    resolution: float
    nx: int
    ny: int
    origin: tuple[float, float]
    x: Floats
    y: Floats
    representative: Floats
    clearance: Floats
    cell: Indices
    site: Indices
    index: Indices
    whole: Lattice | None = None
    corner: tuple[int, int] = (0, 0)
    first: tuple[float, float] | None = None
    _shifts: dict[tuple[int, int], Indices] = field(default_factory=dict)
    _padded: list[Floats] = field(default_factory=list)
    _moves: dict[int, Indices] = field(default_factory=dict)
    _scratch: dict[int, Floats] = field(default_factory=dict)
    kept: dict[tuple[Lab, int], Any] = field(default_factory=dict, compare=False, repr=False)
    """Tables of beacons, by lab and number: they are needed as long as the lattice."""

    @property
    def size(self) -> int:
        """Number of free squares."""
        return len(self.x)

    @property
    def everywhere(self) -> int:
        """Number of free squares in the lab; near it, if this is a part of one."""
        if self.whole is None:
            return self.size
        return round(self.whole.size * (self.whole.resolution / self.resolution) ** 2)

    def squares_at(self, x: Floats, y: Floats) -> Indices:
        """Return the squares of places, in units; `size` where there is none."""
        first = self.first or self.origin
        column = np.round((x - first[0]) / self.resolution).astype(np.int64) - self.corner[0]
        row = np.round((y - first[1]) / self.resolution).astype(np.int64) - self.corner[1]
        column, row = np.clip(column, 0, self.nx - 1), np.clip(row, 0, self.ny - 1)
        return np.asarray(self.index[row * self.nx + column])

    @property
    def padded_clearance(self) -> Floats:
        """`clearance` with a 0 behind it, so that `index` can be used on it; shape (squares + 1,)."""
        if not self._padded:
            self._padded.append(np.append(self.clearance, 0.0))
        return self._padded[0]

    def scratch(self, bins: int) -> Floats:
        """Return room for a number a state, which its users leave filled with zeros.

        One for all beliefs on the lattice: fresh memory has to be got from the system page by page, which
        takes longer than what it is needed for.

        Parameters
        ----------
        bins : int

        Returns
        -------
        array, shape (bins * squares,)
        """
        known = self._scratch.get(bins)
        if known is None:
            known = self._scratch[bins] = np.empty(bins * self.size)
            known.fill(0.0)
        return known

    def share_scratch(self, bins: int, room: Floats) -> None:
        """Use this room, filled with zeros, for `scratch`: of lattices that follow one another."""
        self._scratch[bins] = room[: bins * self.size]

    def move_table(self, reach: int) -> Indices:
        """Return `neighbours` for all shifts within a reach, row by row from the lower left.

        Parameters
        ----------
        reach : int
            In nodes.

        Returns
        -------
        array of int, shape ((2 * reach + 1)**2, squares)
        """
        known = self._moves.get(reach)
        if known is None:
            steps = range(-reach, reach + 1)
            known = self._moves[reach] = np.stack([self.neighbours(dx, dy) for dy in steps for dx in steps])
        return known

    def neighbours(self, dx: int, dy: int) -> Indices:
        """Return which square lies so many nodes to the right of and above each; `size` if it is not free.

        Parameters
        ----------
        dx, dy : int
            Within ±4.

        Returns
        -------
        array of int, shape (squares,)
        """
        known = self._shifts.get((dx, dy))
        if known is None:
            known = self._shifts[dx, dy] = self.index[self.site + dy * self.nx + dx]
        return known


def build_lattice(lab: Lab, resolution: float) -> Lattice:
    """Find the free squares of a lab.

    Parameters
    ----------
    lab : Lab
    resolution : float
        Units between nodes.

    Returns
    -------
    Lattice
    """
    return Nodes(lab, resolution).lattice()


class Nodes:
    """All nodes of a lab, padding included; their free squares are looked for in all or in some of them.

    What is found of a square does not depend on which others are looked at with it.

    Parameters
    ----------
    lab : Lab
    resolution : float
        Units between nodes.

    Attributes
    ----------
    columns, rows : array
        Units; the nodes along each axis.
    """

    def __init__(self, lab: Lab, resolution: float) -> None:
        self.lab, self.resolution = lab, resolution
        obstacles = tuple(wall for wall in lab.walls if wall.height > 0.0)
        self._walls = WallMap.from_lab(dataclasses.replace(lab, walls=obstacles))
        self.columns, self.rows = _axis(lab.width, resolution), _axis(lab.height, resolution)

    def lattice(self, columns: slice = slice(None), rows: slice = slice(None)) -> Lattice:
        """Return the free squares among some columns and rows of nodes, numbered among these only."""
        lab, resolution, walls = self.lab, self.resolution, self._walls
        chosen_columns, chosen_rows = self.columns[columns], self.rows[rows]
        x, y = (grid.ravel() for grid in np.meshgrid(chosen_columns, chosen_rows))
        inside = (x > 0.0) & (x < lab.width) & (y > 0.0) & (y < lab.height)
        clearance = np.zeros(x.size)
        place = np.stack([x, y], axis=-1)
        clearance[inside] = distances_to_walls(walls, place[inside])
        tight = np.flatnonzero(inside & (clearance < ROBOT_RADIUS - _TOLERANCE))
        near = tight[clearance[tight] > ROBOT_RADIUS - 1.5 * resolution]
        place[near], reached = _push_out(walls, place[near], resolution)
        free = inside & (clearance >= ROBOT_RADIUS - _TOLERANCE)
        free[near] = reached
        kept = np.flatnonzero(free)
        enclosed = walls.point_in_polygons(place[kept, 0], place[kept, 1])
        kept = kept[~enclosed]
        index = np.full(x.size + 1, len(kept), np.int64)
        index[kept] = np.arange(len(kept))
        column = np.clip((place[kept, 0] / CELL_SIZE).astype(np.int64), 0, max(lab.columns - 1, 0))
        row = np.clip((place[kept, 1] / CELL_SIZE).astype(np.int64), 0, max(lab.rows - 1, 0))
        return Lattice(
            resolution=resolution,
            nx=len(chosen_columns),
            ny=len(chosen_rows),
            origin=(float(chosen_columns[0]), float(chosen_rows[0])),
            x=x[kept],
            y=y[kept],
            representative=place[kept],
            clearance=clearance[kept],
            cell=row * lab.columns + column,
            site=kept,
            index=index,
        )


def _axis(length: float, resolution: float) -> Floats:
    """Return the nodes along an axis, one in the middle of the first cell, with padding on both sides."""
    centre = CELL_SIZE / 2.0
    before = int(centre / resolution) + PAD
    after = int((length - centre) / resolution) + PAD
    # Multiplied, not summed: equal places of the lab are to come out equal.
    return np.asarray(centre + resolution * np.arange(-before, after + 1), np.float64)


def _push_out(walls: WallMap, place: Floats, resolution: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Move places away from walls until they are free; say which are still in their square."""
    start, moved = place, place.copy()
    distance = np.zeros(len(place))
    for _ in range(6):
        foot, distance = nearest_walls(walls, moved)
        away = moved - foot
        length = np.hypot(away[:, 0], away[:, 1])
        # A little beyond touching: readings of a robot that touches a wall are those of no other pose.
        short = np.maximum(ROBOT_RADIUS + resolution / 4.0 - length, 0.0) / np.maximum(length, 1e-9)
        moved = moved + away * short[:, np.newaxis]
    _, distance = nearest_walls(walls, moved)
    near = np.abs(moved - start).max(axis=1, initial=0.0) <= _REACH * resolution * (1.0 + 1e-6)
    return moved, near & (distance >= ROBOT_RADIUS - _TOLERANCE)


def distances_to_walls(walls: WallMap, places: Floats, tile: float = 2.0) -> Floats:
    """Compute the distances of many points to the nearest face; in machine code, if that is loaded."""
    kernels = compiled.kernels()
    if kernels is None:
        return wall_distances(walls, places, tile)
    faces = walls.start, walls.end, walls.direction, walls.length
    return np.asarray(kernels.wall_distances(np.ascontiguousarray(places), *faces, walls.width))


def nearest_walls(walls: WallMap, place: Floats) -> tuple[Floats, Floats]:
    """Compute the nearest wall point to each place, and its distance."""
    kernels = compiled.kernels()
    if kernels is not None:
        ends = walls.start, walls.end, walls.direction, walls.length
        found: tuple[Floats, Floats] = kernels.nearest_feet(np.ascontiguousarray(place), *ends)
        return found
    foot, distance = np.empty_like(place), np.empty(len(place))
    for members, faces in near_faces(walls, place):
        (start_x, start_y), (ux, uy) = walls.start[faces].T, walls.direction[faces].T
        x, y = place[members, :1], place[members, 1:]
        along = np.clip((x - start_x) * ux + (y - start_y) * uy, 0.0, walls.length[faces])
        foot_x, foot_y = start_x + along * ux, start_y + along * uy
        squared = (x - foot_x) ** 2 + (y - foot_y) ** 2
        best = squared.argmin(axis=1)
        rows = np.arange(len(best))
        foot[members, 0], foot[members, 1] = foot_x[rows, best], foot_y[rows, best]
        distance[members] = np.sqrt(squared[rows, best])
    return foot, distance
