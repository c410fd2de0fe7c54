r"""Driving an arc at commanded speeds, with Gaussian noise.

The robot drives the length :math:`s = \hat v\,\Delta t` while it turns by :math:`\alpha = \hat\omega\,\Delta
t`, and turns by another :math:`\gamma` at the end, each normal about the command's figure (Probabilistic
Robotics, table 5.3). The arc's chord has the length :math:`r = s \sin(\alpha/2) / (\alpha/2)` and the
direction :math:`\theta + \alpha/2`. So the prediction is a sum over turns :math:`\alpha` in whole heading
cells about the command's, each of which moves its share along its chord by :math:`N(r; \sigma_r^2)`, and a
turn by :math:`\gamma` and what the command leaves of a heading cell. Mean and variance are those of the
model, as far as cells can have them: `ciberrato.bayes.motion.turn_drive_turn` says how far.

`kernel` is the density over the end pose at the centres of the cells. For a displacement (r, :math:`\phi`)
there are two ways, forward with :math:`\alpha = 2 (\phi - \theta)` and backward with :math:`\alpha =
2 (\phi + \pi - \theta)`, each angle wrapped before it is doubled. With :math:`\beta = \alpha/2` and the
Jacobian of (s, :math:`\alpha`) to (x, y),

.. math::
   p(x', y', \theta' | u, x, y, \theta) = \sum_{\text{ways}} N(s; v \Delta t)\, N(2\beta; \omega \Delta t)\,
     W(\theta' - \theta - 2\beta)\, \frac{2 \beta}{r \sin\beta}

Table 5.1 leaves the Jacobian out. Arcs of more than one full turn are left out of the density.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import wrap, wrapped_normal
from ciberrato.bayes.arraytypes import FloatArray, IntArray
from ciberrato.bayes.motion.displacements import displacements
from ciberrato.bayes.motion.inputs import check_belief, deviation
from ciberrato.bayes.motion.lattice import lattice_kernels
from ciberrato.bayes.motion.passes import (
    PoseCarry,
    check_motion,
    check_space,
    directions_per_heading,
    move,
    move_carried,
    reach,
    spread,
    turn_carried,
    turn_matrix,
    ways,
)
from ciberrato.bayes.motion.pose_kernel import apply_pose_kernel
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityCommand:
    """Speeds, held for some time.

    Attributes
    ----------
    speed : float
        Units of length per second, negative for backward.
    turning : float
        Radians per second, counter-clockwise.
    duration : float
        Seconds, positive.
    """

    __repr__ = short_repr

    speed: float
    turning: float
    duration: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.duration < math.inf:
            raise ValueError(f"a duration must be positive and finite, not {self.duration}")


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityNoise:
    """Standard deviations of the speeds: a constant part, and the book's alphas (table 5.3).

    Attributes
    ----------
    speed, turning, final : float
        Constant parts for the speed, the turning speed and the final turn, per second.
    alpha1 to alpha6 : float
        Variances per square speed and square turning speed: of the speed (1, 2), the turning speed (3, 4) and
        the final turn (5, 6).
    """

    __repr__ = short_repr

    speed: float = 0.0
    turning: float = 0.0
    final: float = 0.0
    alpha1: float = 0.0
    alpha2: float = 0.0
    alpha3: float = 0.0
    alpha4: float = 0.0
    alpha5: float = 0.0
    alpha6: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and 0 or more, not {getattr(self, name)}")

    def sigmas(self, command: VelocityCommand) -> tuple[float, float, float]:
        """Return the standard deviations of the distance, the turn and the final turn, 0 or more.

        Raises
        ------
        ValueError
            If the command is not finite.
        """
        if not (math.isfinite(command.speed) and math.isfinite(command.turning)):
            raise ValueError(f"a velocity command must be finite, not {command}")
        # Python's floats: what overflows is inf, without a warning, and named.
        v, w, time = float(command.speed), float(command.turning), float(command.duration)
        speed = deviation(self.speed, (self.alpha1, v * v), (self.alpha2, w * w))
        turning = deviation(self.turning, (self.alpha3, v * v), (self.alpha4, w * w))
        final = deviation(self.final, (self.alpha5, v * v), (self.alpha6, w * w))
        return speed * time, turning * time, final * time


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityMotion:
    """Arcs over an (x, y, heading) grid.

    Mass that leaves the grid is lost.

    Attributes
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    noise : VelocityNoise
        Standard deviations; may be 0. The turn's is at most two turns.
    window : float
        Of the density: leave out displacements beyond the commanded distance by more than this many sigmas;
        what that drops is at most `erfc(window / sqrt 2)`.
    density : bool
        Predict by `kernel`, not normalized. It needs noise of 0.6 cells on the way, 0.6 heading cells in the
        turn and the final turn, and grids of up to some ten thousand states: it depends on displacement and
        both headings together.
    """

    __repr__ = short_repr

    space: StateSpace
    noise: VelocityNoise
    window: float = 6.0
    density: bool = False

    def __post_init__(self) -> None:
        check_space(self.space, "velocity motion")
        if not self.window > 0.0:
            raise ValueError(f"the window must be positive, not {self.window}")

    def predict(self, belief: ArrayLike, control: VelocityCommand) -> FloatArray:
        """Move a belief, shape (x, y, heading), by a command. Not normalized.

        Raises
        ------
        ValueError
            If the belief has the wrong shape or is no belief, or the command is not finite, longer than the
            grid, or more than ten turns.
        """
        belief = check_belief(belief, self.space.shape)
        if self.density:
            return apply_pose_kernel(belief, *self.kernel(control))
        way_sigma, turn_sigma, final_sigma = self._sigmas(control)
        axis, way = self.space.axes[2], control.speed * control.duration
        # Chords turn by half of what the heading does.
        parts = directions_per_heading(self.space, 0.5 * way, final_sigma)
        step, weight, left, turn = self._turns(control, turn_sigma, parts, 0.0)
        images = np.ascontiguousarray(np.moveaxis(belief, 2, 0))
        source = np.repeat(np.arange(axis.size), len(step))
        target = (source * parts + np.tile(step, axis.size)) % (axis.size * parts)
        mean, covariance = self._chords(way, way_sigma, axis.centres[source], np.tile(turn, axis.size))
        kernels = lattice_kernels(mean, covariance, reach=reach(self.space))
        moved = move(images, kernels, source, target, np.tile(weight, axis.size), axis.size * parts)
        last = turn_matrix(axis.size, left / axis.cell, final_sigma / axis.cell, before=parts)
        return np.asarray((moved.reshape(len(moved), -1).T @ last).reshape(belief.shape))

    def predict_carried(
        self, belief: ArrayLike, control: VelocityCommand, carry: PoseCarry
    ) -> tuple[FloatArray, PoseCarry]:
        """Move a belief by whole cells and carry the fractions over, so that small steps add no spread.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            A cell stands for its centre plus the carry's offset and turn.
        control : VelocityCommand
            Speeds commanded.
        carry : PoseCarry
            `PoseCarry.none(space)` at first, then what the last call returned.

        Returns
        -------
        belief : FloatArray, shape (x, y, heading)
        carry : PoseCarry
        """
        belief = check_belief(belief, self.space.shape)
        way_sigma, turn_sigma, final_sigma = self._sigmas(control)
        axis, cells = self.space.axes[2], np.array([axis.cell for axis in self.space.axes[:2]])
        step, weight, left, turn = self._turns(control, turn_sigma, 1, carry.turn)
        source = np.repeat(np.arange(axis.size), len(step))
        target = (source + np.tile(step, axis.size)) % axis.size
        mean, covariance = self._chords(
            control.speed * control.duration,
            way_sigma,
            axis.centres[source] + carry.turn,
            np.tile(turn, axis.size),
        )
        images, offset = move_carried(
            np.moveaxis(belief, 2, 0),
            carry.offset / cells,
            source,
            target,
            np.tile(weight, axis.size),
            mean,
            covariance,
        )
        images, offset, left = turn_carried(self.space, images, offset, left, 0.0, final_sigma)
        return np.ascontiguousarray(np.moveaxis(images, 0, 2)), PoseCarry(left, offset * cells)

    def _sigmas(self, control: VelocityCommand) -> tuple[float, float, float]:
        sigmas = self.noise.sigmas(control)
        way, turn = (float(speed) * float(control.duration) for speed in (control.speed, control.turning))
        check_motion(self.space, [way], [turn], [sigmas[0]])
        if sigmas[1] > 4.0 * math.pi:
            raise ValueError(
                f"a standard deviation of {sigmas[1]:g} rad is more than two turns: is it in radians?"
            )
        return sigmas

    def _turns(
        self, control: VelocityCommand, sigma: float, parts: int, turned: float
    ) -> tuple[IntArray, FloatArray, float, FloatArray]:
        """Return turns in parts of a heading cell, their probabilities, what is left over, and their radians.

        The turn left over is added to all; `turned` is what was left over before.
        """
        part = self.space.axes[2].cell / parts
        turn = control.turning * control.duration
        steps = round((turn + turned) / part)
        step, weight = spread(sigma / part)
        return step + steps, weight, turn + turned - steps * part, np.asarray(turn + step * part)

    def _chords(
        self, way: float, sigma: float, heading: FloatArray, turn: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        chord = np.sinc(0.5 * turn / math.pi)
        return ways(self.space, heading + 0.5 * turn, way * chord, sigma * np.abs(chord))

    def kernel(self, control: VelocityCommand) -> tuple[IntArray, FloatArray]:
        """Return displacements, (n, 2) cells, and the density, (n, headings before, headings after).

        ValueError where the noise is finer than 0.6 cells.
        """
        way_sigma, turn_sigma, final_sigma = self._sigmas(control)
        least, bin_ = max(axis.cell for axis in self.space.axes[:2]), self.space.axes[2].cell
        if way_sigma < 0.599 * least or min(turn_sigma, final_sigma) < 0.599 * bin_:
            raise ValueError(
                f"noise of {way_sigma:g} and {min(turn_sigma, final_sigma):g} rad is finer than 0.6 cells of "
                f"{least:g} and {bin_:g} rad: leave `density` out, or take smaller cells"
            )
        way, turn = control.speed * control.duration, control.turning * control.duration
        far = abs(way) + self.window * way_sigma
        cell = (self.space.axes[0].cell, self.space.axes[1].cell)
        steps = displacements(
            (math.ceil(far / cell[0]), math.ceil(far / cell[1])), cell, rotation=turn_sigma / 2.0
        )
        steps = steps.take(steps.distance <= far + math.hypot(*cell))
        headings = self.space.axes[2].centres
        total = np.zeros((len(steps.cells), len(headings), len(headings)))
        for sign in (1.0, -1.0):
            opposite = 0.0 if sign > 0.0 else math.pi
            half_turn = wrap(steps.direction[:, np.newaxis] + opposite - headings)
            # half_turn / sin(half_turn): 1 straight ahead, infinite where the arc closes.
            stretch = 1.0 / np.maximum(np.sinc(half_turn / math.pi), 1e-12)
            arc = sign * steps.distance[:, np.newaxis] * stretch
            density = _normal(arc - way, way_sigma) * _normal(2.0 * half_turn - turn, turn_sigma)
            density *= 2.0 * stretch * steps.inverse_distance[:, np.newaxis]
            final = headings - (headings[:, np.newaxis] + 2.0 * half_turn[:, :, np.newaxis])
            total += density[:, :, np.newaxis] * wrapped_normal(final, final_sigma) * self.space.axes[2].cell
        return steps.cells, total


def _normal(value: FloatArray, sigma: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.square(value / sigma)) / (sigma * math.sqrt(2.0 * math.pi)))
