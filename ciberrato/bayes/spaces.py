"""State spaces: named axes cut into equal cells, and the way between cell indices and poses.

A belief over a space is a float array of the space's shape; axis 0 of the array is the first axis named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One coordinate, cut into `size` cells of equal width.

    Attributes
    ----------
    name : str
        What the coordinate is called, as in "x" or "heading".
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

    name: str
    size: int
    cell: float = 1.0
    origin: float = 0.0
    unit: str = ""
    periodic: bool = False

    def __post_init__(self) -> None:
        if self.size < 1:
            raise ValueError(f"axis {self.name!r} needs at least one cell, not {self.size}")
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
        """Cell centres in `unit`, shape (size,), rising."""
        return np.asarray(self.origin + (np.arange(self.size) + 0.5) * self.cell, dtype=np.float64)

    @property
    def edges(self) -> FloatArray:
        """Cell edges in `unit`, shape (size + 1,), rising."""
        return np.asarray(self.origin + np.arange(self.size + 1) * self.cell, dtype=np.float64)

    def contains(self, values: ArrayLike) -> BoolArray:
        """Tell which coordinates lie on the axis; all finite ones do where it is periodic."""
        values = np.asarray(values, dtype=float)
        if self.periodic:
            return np.asarray(np.isfinite(values))
        return np.asarray((values >= self.origin) & (values < self.origin + self.length))

    def index(self, values: ArrayLike) -> IntArray:
        """Give the cell that holds each coordinate.

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
        """Give `to - start`, the short way round [-length / 2, length / 2) on a periodic axis."""
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
        """Give the array axis that holds the coordinate called `name`.

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
        """Give the axis called `name`; ValueError if there is none."""
        return self.axes[self.position(name)]

    def index(self, pose: ArrayLike) -> IntArray:
        """Give the cells that hold the poses.

        Parameters
        ----------
        pose : array_like, shape (..., number of axes)
            Coordinates in the order of the axes.

        Returns
        -------
        IntArray, shape (..., number of axes)

        Raises
        ------
        ValueError
            If a pose is outside the space or has the wrong number of coordinates.
        """
        pose = self._checked(pose)
        return np.stack([axis.index(pose[..., i]) for i, axis in enumerate(self.axes)], axis=-1)

    def pose(self, index: ArrayLike) -> FloatArray:
        """Give cell centres, shape (..., number of axes), for indices of the same shape."""
        index = self._checked(index)
        return np.stack(
            [axis.origin + (index[..., i] + 0.5) * axis.cell for i, axis in enumerate(self.axes)], -1
        )

    def flat_index(self, pose: ArrayLike) -> IntArray:
        """Give the index into the raveled belief of the cells that hold the poses, shape (...)."""
        index = self.index(pose)
        return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(index, -1, 0)), self.shape), dtype=np.intp)

    def centres(self) -> FloatArray:
        """Give every cell's centre, shape (*shape, number of axes)."""
        grids = np.meshgrid(*(axis.centres for axis in self.axes), indexing="ij")
        return np.stack(grids, axis=-1)

    def uniform(self) -> FloatArray:
        """Give the belief that holds every cell equally likely."""
        return np.full(self.shape, 1.0 / self.size)

    def point_mass(self, pose: ArrayLike) -> FloatArray:
        """Give the belief that is certain of the cell that holds `pose`."""
        belief = np.zeros(self.shape)
        belief.flat[int(self.flat_index(pose))] = 1.0
        return belief

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
    """Make a 1-D space with axis x."""
    return StateSpace((Axis(name="x", size=size, cell=cell, origin=origin, unit=unit, periodic=periodic),))


def rectangle(
    shape: Sequence[int], *, cell: float = 1.0, origin: Sequence[float] = (0.0, 0.0), unit: str = ""
) -> StateSpace:
    """Make a 2-D space with axes x and y, in this order."""
    return StateSpace(
        tuple(
            Axis(name=name, size=size, cell=cell, origin=start, unit=unit)
            for name, size, start in zip("xy", shape, origin, strict=True)
        )
    )


def pose_grid(
    shape: Sequence[int], *, cell: float, origin: Sequence[float] = (0.0, 0.0, -math.pi), unit: str = "m"
) -> StateSpace:
    """Make an (x, y, heading) space; the heading is periodic over 2 pi and its cell follows from its size."""
    planar = rectangle(shape[:2], cell=cell, origin=origin[:2], unit=unit)
    turn = 2.0 * math.pi / shape[2]
    heading = Axis(name="heading", size=shape[2], cell=turn, origin=origin[2], unit="rad", periodic=True)
    return StateSpace((*planar.axes, heading))
