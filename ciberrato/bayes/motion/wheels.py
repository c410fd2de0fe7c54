r"""Two wheels whose power follows the command by a first-order filter, with multiplicative noise.

Each cycle, for either wheel,

.. math:: p_t = \text{noise} \cdot (w c_t + (1 - w) p_{t-1})

with noise normal about 1; the robot drives :math:`(p_l + p_r) / 2` along its old heading and then turns by
:math:`(p_r - p_l) / \text{base}`. This is Probabilistic Robotics, section 5.3, for a robot that moves far
less than a cell a cycle. Interpolating so small a motion between cells would spread the belief at every
cycle; so the grid's headings carry one common offset, and each heading's image one offset of less than a
cell (`ciberrato.bayes.motion.passes`). The noise of way and turn comes from the same wheels: each turn, in
whole heading cells, goes with the way to be expected of it.

Noise of one cycle persists in the filter: an error e adds e / w to the way in the end, so the variance of the
way per cycle is that of a wheel's power divided by :math:`w^2`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.motion.inputs import check_belief
from ciberrato.bayes.motion.passes import (
    check_motion,
    check_space,
    move_carried,
    spread,
    ways,
)
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True)
class WheelCarry:
    """Part of the belief that its array does not hold.

    Attributes
    ----------
    left, right : float
        Expected wheel power at present, units of length a cycle.
    turn : float
        Radians to add to the heading of every cell, within half a cell.
    offset : FloatArray, shape (headings, 2)
        Units of length to add to x and y of the cells of each heading, within half a cell.
    """

    __repr__ = short_repr

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
        Cells in which the robot can be. Mass that would leave them, or the grid, stays where it is and turns,
        as a robot does at a wall.
    """

    __repr__ = short_repr

    space: StateSpace
    base: float
    response: float = 0.5
    noise: float = 0.0
    heading_floor: float = 0.0
    way_floor: float = 0.0
    free: BoolArray | None = None

    def __post_init__(self) -> None:
        check_space(self.space, "wheel motion")
        if not 0.0 < self.base < math.inf or not 0.0 < self.response <= 1.0:
            raise ValueError(
                f"need a positive base and a response in (0, 1], not {self.base}, {self.response}"
            )
        if not all(0.0 <= v < math.inf for v in (self.noise, self.heading_floor, self.way_floor)):
            raise ValueError("noise and floors must be finite and 0 or more")
        if self.free is not None and self.free.shape != self.space.shape[:2]:
            raise ValueError(f"the free cells have shape {self.free.shape}, the space {self.space.shape[:2]}")

    def at_rest(self) -> WheelCarry:
        """Return the carry of a robot that stands still, its cells at their own centres."""
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

        Raises
        ------
        ValueError
            If the belief has the wrong shape or is no belief, or the way is not finite or longer than the
            grid.
        """
        belief = check_belief(belief, self.space.shape)
        if len(control) != 2:
            raise ValueError(f"a command is the power of the left and the right wheel, not {control!r}")
        left, right = (
            self.response * float(c) + (1.0 - self.response) * p
            for c, p in zip(control, (carry.left, carry.right), strict=True)
        )
        way, turn = (left + right) / 2.0, (right - left) / self.base
        moving = left != 0.0 or right != 0.0
        scale = (self.noise / self.response) ** 2
        per_wheel = scale * (left * left + right * right)
        way_variance = per_wheel / 4.0 + (self.way_floor**2 if moving else 0.0)
        turn_variance = per_wheel / self.base**2 + (self.heading_floor**2 if moving else 0.0)
        check_motion(self.space, [way], [turn], [math.sqrt(way_variance)])
        both = scale * (right * right - left * left) / (2.0 * self.base)

        axis, cells = self.space.axes[2], np.array([axis.cell for axis in self.space.axes[:2]])
        steps = round((turn + carry.turn) / axis.cell)
        step, weight = spread(min(math.sqrt(turn_variance), 2.0 * axis.length) / axis.cell)
        slope = both / turn_variance if turn_variance > 0.0 else 0.0
        source = np.repeat(np.arange(axis.size), len(step))
        extra = np.tile(slope * step * axis.cell, axis.size)
        rest = math.sqrt(max(0.0, way_variance - slope * both))
        mean, covariance = ways(self.space, axis.centres[source] + carry.turn, way + extra, rest)
        images, offset = move_carried(
            np.moveaxis(belief, 2, 0),
            carry.offset / cells,
            source,
            (source + np.tile(step, axis.size) + steps) % axis.size,
            np.tile(weight, axis.size),
            mean,
            covariance,
            np.ones(self.space.shape[:2], dtype=bool) if self.free is None else self.free,
        )
        left_over = turn + carry.turn - steps * axis.cell
        moved = np.ascontiguousarray(np.moveaxis(images, 0, 2))
        return moved, WheelCarry(left, right, left_over, offset * cells)
