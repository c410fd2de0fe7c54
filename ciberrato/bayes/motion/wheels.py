r"""Two wheels whose power follows the command by a first-order filter, with multiplicative noise.

Each cycle, for either wheel,

.. math:: p_t = \text{noise} \cdot (w c_t + (1 - w) p_{t-1})

with noise normal about 1; the robot drives :math:`(p_l + p_r) / 2` along its old heading and then turns by
:math:`(p_r - p_l) / \text{base}`. This is Probabilistic Robotics, section 5.3, for a robot that moves far
less than a cell a cycle. Interpolating so small a motion between cells would spread the belief at every
cycle; so the grid's headings carry one common offset, and each heading's image one offset of less than a
cell, and only whole cells are moved. Noise is added as kernels with exact variance along x and along y; their
covariance is left out.

Noise of one cycle persists in the filter: an error e adds e / w to the way in the end, so the variance of the
way per cycle is that of a wheel's power divided by :math:`w^2`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.convolution import convolve, gaussian_kernel, whole_steps
from ciberrato.bayes.spaces import StateSpace


@dataclass(frozen=True, slots=True)
class WheelCarry:
    """What the belief's array does not hold.

    Attributes
    ----------
    left, right : float
        Expected wheel power at present, units of length a cycle.
    turn : float
        Radians to add to the heading of every cell, within half a cell.
    offset : FloatArray, shape (headings, 2)
        Units of length to add to x and y of the cells of each heading, within half a cell.
    """

    left: float
    right: float
    turn: float
    offset: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class DifferentialWheels:
    """Two wheels over an (x, y, heading) grid.

    Attributes
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    base : float
        Distance between the wheels, in units of length.
    response : float
        Share of the command in the next power, w above, in (0, 1]; 1 is no filter.
    noise : float
        Standard deviation of the multiplicative noise.
    heading_floor, way_floor : float
        Standard deviations added a cycle while the robot moves, radians and units of length, for what the
        model leaves out.
    free : BoolArray, shape (x, y), optional
        Where the robot can be. Mass that would leave these cells, or the grid, stays where it is and turns,
        as a robot does at a wall.
    """

    space: StateSpace
    base: float
    response: float = 0.5
    noise: float = 0.0
    heading_floor: float = 0.0
    way_floor: float = 0.0
    free: BoolArray | None = None

    def __post_init__(self) -> None:
        if len(self.space.axes) != 3 or not math.isclose(self.space.axes[2].length, 2.0 * math.pi):
            raise ValueError("wheels need axes x, y, heading, the last over a whole turn")
        if not self.base > 0.0 or not 0.0 < self.response <= 1.0:
            raise ValueError(
                f"need a positive base and a response in (0, 1], not {self.base}, {self.response}"
            )
        if min(self.noise, self.heading_floor, self.way_floor) < 0.0:
            raise ValueError("noise and floors must be 0 or more")
        if self.free is not None and self.free.shape != self.space.shape[:2]:
            raise ValueError(f"the free cells have shape {self.free.shape}, the space {self.space.shape[:2]}")

    def at_rest(self) -> WheelCarry:
        """Give the carry of a robot that stands still, its cells at their own centres."""
        return WheelCarry(0.0, 0.0, 0.0, np.zeros((self.space.shape[2], 2)))

    def predict(
        self, belief: ArrayLike, control: tuple[float, float], carry: WheelCarry
    ) -> tuple[FloatArray, WheelCarry]:
        """Move a belief by one cycle.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            A cell stands for its centre plus the carry's offset and turn.
        control : (float, float)
            Commanded power of the left and right wheel, units of length a cycle.
        carry : WheelCarry
            `at_rest()` at first, then what the last call returned.

        Returns
        -------
        belief : FloatArray, shape (x, y, heading)
        carry : WheelCarry
        """
        belief = np.array(belief, dtype=float)
        if belief.shape != self.space.shape:
            raise ValueError(f"belief has shape {belief.shape}, the space {self.space.shape}")
        left, right = (
            self.response * c + (1.0 - self.response) * p
            for c, p in zip(control, (carry.left, carry.right), strict=True)
        )
        way, turn = (left + right) / 2.0, (right - left) / self.base
        moving = left != 0.0 or right != 0.0
        per_wheel = (self.noise / self.response) ** 2 * (left * left + right * right)
        way_variance = per_wheel / 4.0 + (self.way_floor**2 if moving else 0.0)
        turn_variance = per_wheel / self.base**2 + (self.heading_floor**2 if moving else 0.0)

        offset = self._drive(belief, way, way_variance, carry)
        width = self.space.axes[2].cell
        steps, left_over = whole_steps(turn / width, carry.turn / width)
        belief = np.roll(belief, steps, axis=2)
        offset = np.roll(offset, steps, axis=0)
        if turn_variance > 0.0:
            kernel = gaussian_kernel(0.0, turn_variance / width**2)
            belief = convolve(belief, kernel.weights, kernel.first, edge="wrap", axis=2)
        return belief, WheelCarry(left, right, left_over * width, offset)

    def _drive(self, belief: FloatArray, way: float, variance: float, carry: WheelCarry) -> FloatArray:
        """Move each heading's image in place and give the new offsets."""
        cells = np.array([axis.cell for axis in self.space.axes[:2]])
        headings = self.space.axes[2].centres + carry.turn
        offset = carry.offset + way * np.stack([np.cos(headings), np.sin(headings)], axis=1)
        for k, heading in enumerate(headings):
            image = belief[:, :, k]
            if not image.any():
                continue
            moved = image
            for axis, along in enumerate((math.cos(heading), math.sin(heading))):
                steps, _ = whole_steps(offset[k, axis] / cells[axis], 0.0)
                spread = gaussian_kernel(0.0, variance * (along / cells[axis]) ** 2)
                if steps or len(spread.weights) > 1:
                    moved = self._blocked(moved, spread.weights, spread.first + steps, axis)
            belief[:, :, k] = moved
        return np.asarray(offset - np.rint(offset / cells) * cells)

    def _blocked(self, image: FloatArray, weights: FloatArray, first: int, axis: int) -> FloatArray:
        """Move an image along one axis; what would leave the free cells stays where it was."""
        free = np.ones(image.shape, dtype=bool) if self.free is None else self.free
        result = np.zeros_like(image)
        size = image.shape[axis]
        for k, weight in enumerate(weights):
            step = first + k
            taken, to = [slice(None)] * 2, [slice(None)] * 2
            taken[axis] = slice(max(-step, 0), max(size - max(step, 0), 0))
            to[axis] = slice(max(step, 0), max(size + min(step, 0), 0))
            share = weight * image
            arrived = np.where(free[tuple(to)], share[tuple(taken)], 0.0)
            result[tuple(to)] += arrived
            share[tuple(taken)] -= arrived
            result += share
        return result
