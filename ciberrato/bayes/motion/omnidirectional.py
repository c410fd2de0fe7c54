r"""Odometry of a robot that can drive in any direction without turning first, with Gaussian noise.

In the robot's frame at the start, the drive goes :math:`(d_x, d_y)`, forward and to the left, with normal
noise along its direction and across; the heading turns by :math:`\delta` with normal noise of its own:

.. math::
   x' = x + R(\theta)\, [(d_x, d_y) + R(\beta)\,(\varepsilon_{along}, \varepsilon_{across})],\quad
   \theta' = \theta + \delta + \varepsilon_{turn},\quad \beta = \operatorname{atan2}(d_y, d_x)

What Probabilistic Robotics, section 5.4 does for turn, drive, turn; the parameters are those that amcl and
beluga have for such robots, variances per square of what was measured. Mean and variance are right as far as
cells can have them (`ciberrato.bayes.motion.turn_drive_turn` says how far), whatever the ratio of step, noise
and cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import wrap
from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.motion.inputs import check_belief, deviation
from ciberrato.bayes.motion.lattice import lattice_kernels
from ciberrato.bayes.motion.passes import (
    PoseCarry,
    check_motion,
    check_space,
    drive,
    move_carried,
    reach,
    turn_carried,
    turn_matrix,
)
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class OmnidirectionalReading:
    """A relative motion, in the frame of the robot at its start.

    Attributes
    ----------
    forward, left : float
        Way driven, in units of length.
    turn : float
        Radians, counter-clockwise.
    """

    __repr__ = short_repr

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0

    @classmethod
    def between(cls, before: ArrayLike, after: ArrayLike) -> OmnidirectionalReading:
        """Return the motion between two odometry poses (x, y, heading); ValueError if they are not finite."""
        x0, y0, heading0 = (float(v) for v in np.asarray(before))
        x1, y1, heading1 = (float(v) for v in np.asarray(after))
        if not math.isfinite(x0 + y0 + heading0 + x1 + y1 + heading1):
            raise ValueError(f"odometry poses must be finite, not {before!r} and {after!r}")
        cos, sin = math.cos(heading0), math.sin(heading0)
        dx, dy = x1 - x0, y1 - y0
        return cls(
            forward=dx * cos + dy * sin, left=dy * cos - dx * sin, turn=float(wrap(heading1 - heading0))
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OmnidirectionalNoise:
    """Standard deviations of such odometry: constant parts, and alphas as amcl and beluga have them.

    Attributes
    ----------
    rotation : float
        Constant part for the turn, radians.
    translation, strafe : float
        Constant parts along and across the drive, in units of length.
    alpha1, alpha2 : float
        Variance of the turn per square radian turned and square unit driven.
    alpha3, alpha4 : float
        Variance along the drive per square unit driven and square radian turned; the latter across too.
    alpha5 : float
        Variance across the drive per square unit driven.
    """

    __repr__ = short_repr

    rotation: float = 0.0
    translation: float = 0.0
    strafe: float = 0.0
    alpha1: float = 0.0
    alpha2: float = 0.0
    alpha3: float = 0.0
    alpha4: float = 0.0
    alpha5: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and 0 or more, not {getattr(self, name)}")

    def sigmas(self, reading: OmnidirectionalReading) -> tuple[float, float, float]:
        """Return the standard deviations of turn, along and across the drive; ValueError if not finite."""
        if not all(math.isfinite(v) for v in (reading.forward, reading.left, reading.turn)):
            raise ValueError(f"an odometry reading must be finite, not {reading}")
        # Python's floats: what overflows is inf, without a warning, and named below.
        forward, left, turned = float(reading.forward), float(reading.left), float(reading.turn)
        square, turn = forward * forward + left * left, turned * turned
        return (
            deviation(self.rotation, (self.alpha1, turn), (self.alpha2, square)),
            deviation(self.translation, (self.alpha3, square), (self.alpha4, turn)),
            deviation(self.strafe, (self.alpha5, square), (self.alpha4, turn)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OmnidirectionalOdometry:
    """Drive in any direction and turn, over an (x, y, heading) grid.

    Mass that leaves the grid, or ends in a cell that is not free, is lost.

    Attributes
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    noise : OmnidirectionalNoise
        Standard deviations; may be 0.
    free : BoolArray, shape (x, y), optional
        Cells in which the robot can be; all if None.
    """

    __repr__ = short_repr

    space: StateSpace
    noise: OmnidirectionalNoise
    free: BoolArray | None = None

    def __post_init__(self) -> None:
        check_space(self.space, "odometry")
        if self.free is not None and self.free.shape != self.space.shape[:2]:
            raise ValueError(f"the free cells have shape {self.free.shape}, the space {self.space.shape[:2]}")

    def predict(self, belief: ArrayLike, control: OmnidirectionalReading) -> FloatArray:
        """Move a belief, shape (x, y, heading), by an odometry reading. Not normalized.

        Raises
        ------
        ValueError
            If the belief has the wrong shape or is no belief, or the reading is not finite or longer than the
            grid.
        """
        belief = check_belief(belief, self.space.shape)
        turn_sigma, mean, covariance = self._drives(control, 0.0)
        kernels = lattice_kernels(mean, covariance, reach=reach(self.space))
        images = drive(np.ascontiguousarray(np.moveaxis(belief, 2, 0)), kernels)
        if self.free is not None:
            images = images * self.free
        axis = self.space.axes[2]
        turned = turn_matrix(axis.size, control.turn / axis.cell, turn_sigma / axis.cell)
        return np.asarray((images.reshape(axis.size, -1).T @ turned).reshape(belief.shape))

    def predict_carried(
        self, belief: ArrayLike, control: OmnidirectionalReading, carry: PoseCarry
    ) -> tuple[FloatArray, PoseCarry]:
        """Move a belief by whole cells and carry the fractions over, so that small steps add no spread.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            A cell stands for its centre plus the carry's offset and turn.
        control : OmnidirectionalReading
            The relative motion measured.
        carry : PoseCarry
            `PoseCarry.none(space)` at first, then what the last call returned.

        Returns
        -------
        belief : FloatArray, shape (x, y, heading)
        carry : PoseCarry
        """
        belief = check_belief(belief, self.space.shape)
        turn_sigma, mean, covariance = self._drives(control, carry.turn)
        cells = np.array([axis.cell for axis in self.space.axes[:2]])
        every = np.arange(self.space.shape[2])
        images, offset = move_carried(
            np.moveaxis(belief, 2, 0),
            carry.offset / cells,
            every,
            every,
            np.ones(len(every)),
            mean,
            covariance,
        )
        if self.free is not None:
            images = images * self.free
        images, offset, turn = turn_carried(self.space, images, offset, carry.turn, control.turn, turn_sigma)
        return np.ascontiguousarray(np.moveaxis(images, 0, 2)), PoseCarry(turn, offset * cells)

    def _drives(self, control: OmnidirectionalReading, turned: float) -> tuple[float, FloatArray, FloatArray]:
        """Return sigma of the turn, and of each heading's drive mean, (n, 2), and covariance in cells."""
        turn_sigma, along, across = self.noise.sigmas(control)
        way = math.hypot(control.forward, control.left)
        check_motion(self.space, [way], [control.turn], [along, across])
        bearing = math.atan2(control.left, control.forward)
        direction = self.space.axes[2].centres + turned + bearing
        cells = np.array([axis.cell for axis in self.space.axes[:2]])
        ahead = np.stack([np.cos(direction), np.sin(direction)], axis=1) / cells
        aside = np.stack([-np.sin(direction), np.cos(direction)], axis=1) / cells
        covariance = np.zeros((len(direction), 2, 2))
        for axis, sigma in ((ahead, along), (aside, across)):
            covariance += sigma * sigma * axis[:, :, np.newaxis] * axis[:, np.newaxis, :]
        return turn_sigma, way * ahead, covariance
