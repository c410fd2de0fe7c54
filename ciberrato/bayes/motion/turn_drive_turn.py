r"""Odometry as turn, drive, turn, in three passes: right in mean and variance however fine the motion.

The heading is spread by :math:`W(\delta_1, \sigma_1^2)`, each heading's image is moved along its direction by
:math:`N(\tau, \sigma_\tau^2)`, and the heading is spread again by :math:`W(\delta_2, \sigma_2^2)`:
Probabilistic Robotics, table 5.6, with distributions in the place of samples.

The directions of the drive are the headings' centres plus what :math:`\delta_1` leaves of a heading cell,
which the second turn makes up for: so the mean is exact. Of the noise every pass keeps the variance, where a
distribution over whole cells can have it. What cannot be avoided: a mean between cells adds r (1 - r) square
cells to a variance below that, r being its fraction (r = 1/20 for steps of 5 mm on cells of 0.1 m: ten of
them spread by 0.7 cells); `predict_carried` adds none of it. And a drive along a slanting direction whose
noise is a cell or more is wider across by 1/6 square cell on the average. Where the ways of neighbouring
headings end more than a cell apart, several directions stand for a heading if the noise of the second turn is
half a heading cell or more; else the belief lies on rays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.motion.in_machine_code import predict_compiled, predict_states_compiled, step_compiled
from ciberrato.bayes.motion.inputs import check_belief
from ciberrato.bayes.motion.lattice import LatticeKernels, lattice_kernels
from ciberrato.bayes.motion.long_rows import fits, predict_long_rows
from ciberrato.bayes.motion.odometry_reading import OdometryNoise, OdometryReading, Prediction
from ciberrato.bayes.motion.passes import (
    PoseCarry,
    check_motion,
    check_space,
    directions_per_heading,
    drive,
    move_carried,
    reach,
    turn_carried,
    turn_matrix,
    ways,
)
from ciberrato.bayes.motion.selected import States, turn_drive_turn
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr


class Plan(NamedTuple):
    """Arrays by which machine code moves a belief.

    Attributes
    ----------
    turns : two pairs (turn, sigma)
        In heading cells.
    kernels : LatticeKernels
        One for each heading.
    """

    turns: tuple[tuple[float, float], tuple[float, float]]
    kernels: LatticeKernels

    def __repr__(self) -> str:
        return short_repr(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnDriveTurn:
    """Three passes over an (x, y, heading) grid.

    Mass that leaves the grid, or ends in a cell that is not free, is lost.

    Attributes
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    noise : OdometryNoise
        Standard deviations; may be 0.
    free : BoolArray, shape (x, y), optional
        Cells in which the robot can be; all if None.
    window : float
        Cut a drive with noise of a cell or more off beyond this many sigmas, and normalize the rest; that
        concerns at most `erfc(window / sqrt 2)` of it, which is reported.
    skip_below : float
        Leave out headings whose whole image holds less mass than this.
    """

    __repr__ = short_repr

    space: StateSpace
    noise: OdometryNoise
    free: BoolArray | None = None
    window: float = 4.0
    skip_below: float = 0.0
    _work: dict[Any, FloatArray] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_space(self.space, "odometry")
        if self.free is not None and self.free.shape != self.space.shape[:2]:
            raise ValueError(f"the free cells have shape {self.free.shape}, the space {self.space.shape[:2]}")
        if not self.window > 0.0 or not self.skip_below >= 0.0:
            raise ValueError("the window must be positive and the mass to skip 0 or more")
        compiled.load_for(self.space.size)

    def predict(self, belief: ArrayLike, control: OdometryReading) -> FloatArray:
        """Move a belief, shape (x, y, heading), by an odometry reading. Not normalized.

        A belief of single precision stays one: each of three passes adds 1e-6 of the greatest entry at most.
        """
        return self.predict_with_losses(belief, control).belief

    def predict_with_losses(
        self, belief: ArrayLike, control: OdometryReading, *, cut: float | None = None
    ) -> Prediction:
        """Move a belief and say what was left out.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            Sums to 1.
        control : OdometryReading
            The relative motion measured.
        cut : float, optional
            Leave out what drives more than this many sigmas too short or too far, without normalizing.

        Returns
        -------
        Prediction

        Raises
        ------
        ValueError
            If the belief has the wrong shape or is no belief, or the reading is not finite or longer than the
            grid.
        """
        rot1, _, rot2 = self._sigmas(control)
        rows, columns, headings = self.space.shape
        width = self.space.axes[2].cell
        parts = directions_per_heading(self.space, control.trans, rot2)
        steps = round(control.rot1 * parts / width)
        left = control.rot1 - steps * width / parts
        truncated = math.erfc((self.window if cut is None else cut) / math.sqrt(2.0))
        if compiled.kernels(self.space.size) is not None and parts == 1 and self.skip_below == 0.0:
            turns = (steps, rot1 / width), ((control.rot2 + left) / width, rot2 / width)
            return Prediction(
                predict_compiled(
                    belief,
                    self.space.shape,
                    self.free,
                    turns,
                    self._kernels(control, 1, left, cut),
                    self._work,
                ),
                0.0,
                truncated,
            )
        belief = check_belief(belief, self.space.shape, single=True)
        kernels = self._kernels(control, parts, left, cut)
        first = turn_matrix(headings, steps / parts, rot1 / width, after=parts)
        last = turn_matrix(headings, (control.rot2 + left) / width, rot2 / width, before=parts)
        first, last = (matrix.astype(belief.dtype, copy=False) for matrix in (first, last))
        if self.space.size >= compiled.LARGE and self.skip_below == 0.0 and fits(kernels):
            after = predict_long_rows(belief, self.free, first, last, kernels, self._work)
            return Prediction(after, 0.0, truncated)
        # Heading first, so that each heading's image lies in one piece for the drive; the transposition is
        # the product's.
        images, driven = self._images(headings * parts, belief.dtype)
        np.matmul(first.T, belief.reshape(-1, headings).T, out=images)
        skipped = 0.0
        if self.skip_below > 0.0:
            mass = images.sum(axis=1)
            small = mass < self.skip_below
            skipped = float(mass[small].sum())
            images[small] = 0.0
        shape = (headings * parts, rows, columns)
        moved = drive(images.reshape(shape), kernels, driven.reshape(shape)).reshape(shape[0], -1)
        if self.free is not None:
            moved *= self.free.ravel()
        after = moved.T @ last
        return Prediction(after.reshape(belief.shape), skipped, truncated)

    def plan(self, control: OdometryReading) -> Plan | None:
        """Return what `step` moves a belief by; None where machine code is not loaded, or does not do it.

        Errors of the reading as of `predict_with_losses`.
        """
        rot1, _, rot2 = self._sigmas(control)
        width = self.space.axes[2].cell
        parts = directions_per_heading(self.space, control.trans, rot2)
        if compiled.kernels(self.space.size) is None or parts != 1 or self.skip_below > 0.0:
            return None
        steps = round(control.rot1 / width)
        left = control.rot1 - steps * width
        turns = (steps, rot1 / width), ((control.rot2 + left) / width, rot2 / width)
        return Plan(turns, self._kernels(control, 1, left, None))

    def step(
        self,
        plan: Plan,
        belief: FloatArray,
        factor: float,
        scan: tuple[Any, ...],
        limits: tuple[float, ...],
        out: FloatArray,
    ) -> tuple[float, int]:
        """Move a belief times a factor and multiply it by a scan's likelihood, in machine code.

        Parameters and result as of `ciberrato.bayes.motion.in_machine_code.step_compiled`.
        """
        return step_compiled(belief, factor, out, self.free, *plan, scan, limits, self._work)

    def predict_states(
        self, states: IntArray, masses: FloatArray, control: OdometryReading, *, skip: float = 0.0
    ) -> States:
        """Move listed states, each as `predict` does; time and memory go with their number.

        Parameters
        ----------
        states : IntArray, shape (n,)
            Numbers of cells in the raveled belief, rising, none twice.
        masses : FloatArray, shape (n,)
            0 or more.
        control : OdometryReading
            The relative motion measured.
        skip : float
            Share of the mass that may be left out, in states that hold little.

        Returns
        -------
        States
            Not normalized, as of `predict`. In machine code (`ciberrato.bayes.compiled`) each mass is off by
            1e-14 of the greatest at most, and so is what decides which are left out.
        """
        rot1, _, rot2 = self._sigmas(control)
        headings, width = self.space.shape[2], self.space.axes[2].cell
        parts = directions_per_heading(self.space, control.trans, rot2)
        steps = round(control.rot1 * parts / width)
        left = control.rot1 - steps * width / parts
        free = np.ones(self.space.shape[:2], dtype=bool) if self.free is None else self.free

        def kernels(some: IntArray) -> LatticeKernels:
            return self._kernels(control, parts, left, None, some)

        if compiled.kernels(self.space.size) is not None and parts == 1:
            turns = (steps, rot1 / width), ((control.rot2 + left) / width, rot2 / width)
            return predict_states_compiled(states, masses, self.space.shape, free, turns, kernels, skip)
        return turn_drive_turn(
            states,
            masses,
            turn_matrix(headings, steps / parts, rot1 / width, after=parts),
            kernels,
            turn_matrix(headings, (control.rot2 + left) / width, rot2 / width, before=parts),
            free,
            skip,
        )

    def predict_carried(
        self, belief: ArrayLike, control: OdometryReading, carry: PoseCarry
    ) -> tuple[FloatArray, PoseCarry]:
        """Move a belief by whole cells and carry the fractions over, so that small steps add no spread.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            A cell stands for its centre plus the carry's offset and turn.
        control : OdometryReading
            The relative motion measured.
        carry : PoseCarry
            `PoseCarry.none(space)` at first, then what the last call returned.

        Returns
        -------
        belief : FloatArray, shape (x, y, heading)
        carry : PoseCarry
        """
        belief = check_belief(belief, self.space.shape)
        rot1, trans, rot2 = self._sigmas(control)
        cells = np.array([axis.cell for axis in self.space.axes[:2]])
        images, offset, turn = np.moveaxis(belief, 2, 0), carry.offset / cells, carry.turn
        images, offset, turn = turn_carried(self.space, images, offset, turn, control.rot1, rot1)
        mean, covariance = ways(self.space, self.space.axes[2].centres + turn, control.trans, trans)
        every = np.arange(len(images))
        images, offset = move_carried(images, offset, every, every, np.ones(len(every)), mean, covariance)
        if self.free is not None:
            images = images * self.free
        images, offset, turn = turn_carried(self.space, images, offset, turn, control.rot2, rot2)
        return np.ascontiguousarray(np.moveaxis(images, 0, 2)), PoseCarry(turn, offset * cells)

    def _sigmas(self, control: OdometryReading) -> tuple[float, float, float]:
        sigmas = self.noise.sigmas(control)
        check_motion(self.space, [control.trans], [control.rot1, control.rot2], [sigmas[1]])
        return sigmas

    def _kernels(
        self,
        control: OdometryReading,
        parts: int,
        left: float,
        cut: float | None,
        some: IntArray | None = None,
    ) -> LatticeKernels:
        axis = self.space.axes[2]
        part: IntArray = np.arange(axis.size * parts) if some is None else some
        direction = axis.centres[0] + part * axis.cell / parts + left
        mean, covariance = ways(self.space, direction, control.trans, self.noise.sigmas(control)[1])
        window = self.window if cut is None else max(self.window, cut)
        loops = compiled.kernels(self.space.size)
        return lattice_kernels(mean, covariance, reach=reach(self.space), sigmas=window, cut=cut, loops=loops)

    def _images(self, count: int, kind: Any) -> tuple[FloatArray, FloatArray]:
        # Kept from call to call: fresh arrays of this size cost as much in page faults as the work on them.
        key = count, kind
        if key not in self._work:
            self._work.clear()
            self._work[key] = np.empty((2, count, self.space.shape[0] * self.space.shape[1]), dtype=kind)
        return self._work[key][0], self._work[key][1]
