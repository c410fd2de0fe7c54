"""State spaces: named axes cut into equal cells, and the conversion between cell indices and poses.

**Axis order.** A belief over a space is a float array of the space's shape. Its array axes are the axes of
the space, in their order; so are coordinates of a pose, indices, cell widths and origins. There are two
orders:

- `[x, y]` or `[x, y, heading]`: `rectangle`, `pose_grid`, and all that computes with coordinates: occupancy
  grids, distance fields, scan tables, landmark poses, pose motion models.
- `[row, column]`, which is `[y, x]`, row 0 the southernmost: arrays of cells as labs and belief files have
  them, `Openings` and `BlockedShift`. `cell_rows` is the space of such an array; its coordinates are (y, x),
  too.

`marginal(belief, space, "y", "x")` brings a belief from one order to the other; `OccupancyGrid.from_rows`
takes a map in rows. Headings are radians inside; functions that take or return poses have them in degrees
where asked (`deg`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import belief_array, whole, whole_array
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One coordinate, cut into `size` cells of equal width.

    Attributes
    ----------
    name : str
        Name of the coordinate, as in "x" or "heading".
    size : int
        Number of cells, at least 1.
    cell : float
        Width of a cell, in `unit`; positive.
    origin : float
        Lower edge of cell 0, in `unit`.
    unit : str
        As in "m" or "rad"; for labels only.
    periodic : bool
        Whether the upper edge of the last cell is the lower edge of cell 0 again.
    """

    __repr__ = short_repr

    name: str
    size: int
    cell: float = 1.0
    origin: float = 0.0
    unit: str = ""
    periodic: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", whole(self.size, what=f"the size of axis {self.name!r}", least=1))
        if not (math.isfinite(self.cell) and self.cell > 0.0):
            raise ValueError(f"axis {self.name!r} needs a positive cell width, not {self.cell}")
        if not math.isfinite(self.origin):
            raise ValueError(f"axis {self.name!r} needs a finite origin, not {self.origin}")

    @property
    def length(self) -> float:
        """Width of all cells together, in `unit`: the period of a periodic axis."""
        return self.size * self.cell

    @property
    def centres(self) -> FloatArray:
        """Centres of the cells in `unit`, shape (size,), rising."""
        return np.asarray(self.origin + (np.arange(self.size) + 0.5) * self.cell, dtype=np.float64)

    @property
    def edges(self) -> FloatArray:
        """Cell edges in `unit`, shape (size + 1,), rising."""
        return np.asarray(self.origin + np.arange(self.size + 1) * self.cell, dtype=np.float64)

    def contains(self, values: ArrayLike) -> BoolArray:
        """Return which coordinates lie on the axis; all finite ones do where it is periodic."""
        values = np.asarray(values, dtype=float)
        if self.periodic:
            return np.asarray(np.isfinite(values))
        return np.asarray((values >= self.origin) & (values < self.origin + self.length))

    def index(self, values: ArrayLike) -> IntArray:
        """Return the cell that holds each coordinate.

        Parameters
        ----------
        values : array_like
            Coordinates in `unit`, any shape.

        Returns
        -------
        IntArray
            Cell indices, same shape.

        Raises
        ------
        ValueError
            If a coordinate is off a bounded axis or not finite.
        """
        values = np.asarray(values, dtype=float)
        inside = self.contains(values)
        if not np.all(inside):
            first = values[~inside].flat[0]
            raise ValueError(
                f"{first} is off axis {self.name!r} [{self.origin}, {self.origin + self.length})"
            )
        cells: IntArray = np.floor((values - self.origin) / self.cell).astype(np.intp)
        # The quotient of a value just below the upper edge may round up to `size`.
        return np.asarray(cells % self.size if self.periodic else np.minimum(cells, self.size - 1))

    def difference(self, to: ArrayLike, start: ArrayLike) -> FloatArray:
        """Return `to - start`, the shorter one [-length / 2, length / 2) on a periodic axis."""
        delta: FloatArray = np.asarray(np.subtract(to, start), dtype=np.float64)
        if not self.periodic:
            return delta
        return np.asarray((delta + self.length / 2) % self.length - self.length / 2)


@dataclass(frozen=True, slots=True)
class StateSpace:
    """A grid of cells over one or more axes.

    Attributes
    ----------
    axes : tuple of Axis
        In the order of the belief array's axes; names must differ.
    """

    __repr__ = short_repr

    axes: tuple[Axis, ...]

    def __post_init__(self) -> None:
        if not self.axes:
            raise ValueError("a state space needs at least one axis")
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names):
            raise ValueError(f"axis names must differ: {', '.join(names)}")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a belief over this space."""
        return tuple(axis.size for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of states."""
        return math.prod(self.shape)

    @property
    def cell_volume(self) -> float:
        """Product of the cell widths: a density times this is a cell's mass."""
        return math.prod(axis.cell for axis in self.axes)

    def position(self, name: str) -> int:
        """Return the array axis that holds the coordinate called `name`.

        Raises
        ------
        ValueError
            If no axis has that name.
        """
        names = [axis.name for axis in self.axes]
        if name not in names:
            raise ValueError(f"no axis {name!r} among {', '.join(names)}")
        return names.index(name)

    def axis(self, name: str) -> Axis:
        """Return the axis called `name`; ValueError if there is none."""
        return self.axes[self.position(name)]

    def index(self, pose: ArrayLike, *, deg: bool = False) -> IntArray:
        """Find the cells that hold the poses.

        Parameters
        ----------
        pose : array_like, shape (..., number of axes)
            Coordinates in the order of the axes.
        deg : bool
            Coordinates on axes in radians are given in degrees.

        Returns
        -------
        IntArray, shape (..., number of axes)

        Raises
        ------
        ValueError
            If a pose is outside the space or has the wrong number of coordinates.
        """
        pose = self._checked(pose)
        if deg:
            pose = np.where(self._angles(), np.radians(pose), pose)
        return np.stack([axis.index(pose[..., i]) for i, axis in enumerate(self.axes)], axis=-1)

    def pose(self, index: ArrayLike, *, deg: bool = False) -> FloatArray:
        """Compute cell centres, shape (..., number of axes), for indices of the same shape.

        Parameters
        ----------
        index : array_like of int
            Whole numbers; on periodic axes any, on others those of cells.
        deg : bool
            Return coordinates on axes in radians in degrees.

        Raises
        ------
        ValueError
            If an index is no whole number or not of a cell.
        """
        cells = whole_array(self._checked(index), what="indices of cells")
        centres = []
        for i, axis in enumerate(self.axes):
            number = cells[..., i] % axis.size if axis.periodic else cells[..., i]
            if ((number < 0) | (number >= axis.size)).any():
                wrong = number[(number < 0) | (number >= axis.size)].flat[0]
                raise ValueError(f"axis {axis.name!r} has cells 0 to {axis.size - 1}, and no {wrong}")
            centres.append(axis.origin + (number + 0.5) * axis.cell)
        poses = np.stack(centres, -1)
        return np.where(self._angles(), np.degrees(poses), poses) if deg else poses

    def flat_index(self, pose: ArrayLike, *, deg: bool = False) -> IntArray:
        """Find the index into the raveled belief of the cells that hold the poses, shape (...)."""
        index = self.index(pose, deg=deg)
        return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(index, -1, 0)), self.shape), dtype=np.intp)

    def centres(self) -> FloatArray:
        """Return the centre of every cell, shape ``(*shape, number of axes)``."""
        grids = np.meshgrid(*(axis.centres for axis in self.axes), indexing="ij")
        return np.stack(grids, axis=-1)

    def uniform(self) -> FloatArray:
        """Return the belief that holds every cell equally likely."""
        return np.full(self.shape, 1.0 / self.size)

    def point_mass(self, pose: ArrayLike, *, deg: bool = False) -> FloatArray:
        """Return the belief that is certain of the cell that holds `pose`, one pose."""
        belief = np.zeros(self.shape)
        cell = self.flat_index(pose, deg=deg)
        if cell.ndim:
            raise ValueError(f"a point mass needs one pose, not an array of shape {np.shape(pose)}")
        belief.flat[int(cell)] = 1.0
        return belief

    def checked_belief(self, belief: ArrayLike) -> FloatArray:
        """Return a belief over this space as floats; ValueError if it is none or has another shape."""
        return belief_array(
            belief, what=f"belief over {', '.join(a.name for a in self.axes)}", shape=self.shape
        )

    def _angles(self) -> BoolArray:
        return np.array([axis.unit == "rad" for axis in self.axes])

    def _checked(self, values: ArrayLike) -> FloatArray:
        values = np.asarray(values, dtype=float)
        if values.ndim == 0 or values.shape[-1] != len(self.axes):
            raise ValueError(
                f"need {len(self.axes)} coordinates in the last dimension, not shape {values.shape}"
            )
        return values


def line(
    size: int, *, cell: float = 1.0, origin: float = 0.0, unit: str = "", periodic: bool = False
) -> StateSpace:
    """Create a 1-D space with axis x."""
    return StateSpace((Axis(name="x", size=size, cell=cell, origin=origin, unit=unit, periodic=periodic),))


def rectangle(
    shape: Sequence[int],
    *,
    cell: float | Sequence[float] = 1.0,
    origin: Sequence[float] = (0.0, 0.0),
    unit: str = "",
) -> StateSpace:
    """Create a 2-D space with axes x and y, in this order.

    Parameters
    ----------
    shape : (int, int)
        Cells along x and along y.
    cell : float or (float, float)
        Width of a cell, or widths along x and along y.
    origin : (float, float)
        x and y of the lower edges of cell (0, 0).
    unit : str
        For labels.
    """
    return _planar("xy", shape, cell, origin, unit)


def cell_rows(
    shape: Sequence[int],
    *,
    cell: float | Sequence[float] = 1.0,
    origin: Sequence[float] = (0.0, 0.0),
    unit: str = "",
) -> StateSpace:
    """Create the space of arrays [row, column], row 0 the southernmost: axes y and x, in this order.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    cell : float or (float, float)
        Width of a cell, or its height (along y) and width (along x).
    origin : (float, float)
        y and x of the lower edges of cell (0, 0).
    unit : str
        For labels.
    """
    return _planar("yx", shape, cell, origin, unit)


def pose_grid(
    shape: Sequence[int],
    *,
    cell: float | Sequence[float],
    origin: Sequence[float] | None = None,
    unit: str = "m",
    deg: bool = False,
) -> StateSpace:
    """Create an (x, y, heading) space; the heading is periodic over 2 pi and its cell follows from its size.

    Parameters
    ----------
    shape : (int, int, int)
        Cells along x, along y, and of the heading.
    cell : float or (float, float)
        Width of a cell, or widths along x and along y.
    origin : (float, float, float)
        x, y and heading of the lower edges of cell (0, 0, 0); (0, 0, half a turn backward) if left out.
    unit : str
        Unit of x and y, for labels.
    deg : bool
        The origin's heading is given in degrees. The axis is in radians all the same.
    """
    if len(shape) != 3 or (origin is not None and len(origin) != 3):
        raise ValueError(f"a pose grid needs a shape and an origin of three numbers, not {shape}, {origin}")
    start = (0.0, 0.0, -math.pi) if origin is None else tuple(origin)
    first = math.radians(start[2]) if deg and origin is not None else start[2]
    headings = whole(shape[2], what="the number of headings", least=1)
    planar = _planar("xy", shape[:2], cell, start[:2], unit)
    turn = 2.0 * math.pi / headings
    heading = Axis(name="heading", size=headings, cell=turn, origin=first, unit="rad", periodic=True)
    return StateSpace((*planar.axes, heading))


def _planar(
    names: str, shape: Sequence[int], cell: float | Sequence[float], origin: Sequence[float], unit: str
) -> StateSpace:
    cells = np.asarray(cell, dtype=float)
    if cells.shape not in ((), (2,)) or len(shape) != 2 or len(origin) != 2:
        raise ValueError(
            f"a plane needs two sizes, one or two cells and two origins, in the order {' '.join(names)}, "
            f"not {shape}, {cell}, {origin}"
        )
    widths = np.broadcast_to(cells, 2).tolist()
    return StateSpace(
        tuple(
            Axis(name=name, size=size, cell=width, origin=start, unit=unit)
            for name, size, width, start in zip(names, shape, widths, origin, strict=True)
        )
    )
