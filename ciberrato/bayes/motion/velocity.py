r"""Driving an arc at commanded speeds, with Gaussian noise, as a density over the end pose.

The robot drives the length :math:`s = \hat v\,\Delta t` while it turns by :math:`\alpha = \hat\omega\,\Delta
t`, and turns by another :math:`\gamma` at the end, each normal about the command's figure. The arc's chord
has the length :math:`r = s \sin(\alpha/2) / (\alpha/2)` and the direction :math:`\theta + \alpha/2`. For a
displacement (r, :math:`\phi`) that leaves two ways, forward with :math:`\alpha = 2 (\phi - \theta)` and
backward with :math:`\alpha = 2 (\phi + \pi - \theta)`, each angle wrapped before it is doubled. With
:math:`\beta = \alpha/2` and the Jacobian of (s, :math:`\alpha`) to (x, y),

.. math::
   p(x', y', \theta' | u, x, y, \theta) = \sum_{\text{ways}} N(s; v \Delta t)\, N(2\beta; \omega \Delta t)\,
     W(\theta' - \theta - 2\beta)\, \frac{2 \beta}{r \sin\beta}

Probabilistic Robotics, tables 5.1 (whose product leaves the Jacobian out) and 5.3 (which samples from this).
Arcs of more than one full turn are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import wrap, wrapped_normal
from ciberrato.bayes.arraytypes import FloatArray, IntArray
from ciberrato.bayes.motion.displacements import displacements
from ciberrato.bayes.motion.pose_kernel import apply_pose_kernel
from ciberrato.bayes.spaces import StateSpace


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

    speed: float
    turning: float
    duration: float = 1.0

    def __post_init__(self) -> None:
        if not self.duration > 0.0:
            raise ValueError(f"a duration must be positive, not {self.duration}")


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
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must be 0 or more, not {getattr(self, name)}")

    def sigmas(self, command: VelocityCommand) -> tuple[float, float, float]:
        """Give the standard deviations of the way, the turn and the final turn; ValueError if one is 0."""
        v2, w2 = command.speed**2, command.turning**2
        speed = math.sqrt(self.speed**2 + self.alpha1 * v2 + self.alpha2 * w2)
        turning = math.sqrt(self.turning**2 + self.alpha3 * v2 + self.alpha4 * w2)
        final = math.sqrt(self.final**2 + self.alpha5 * v2 + self.alpha6 * w2)
        if min(speed, turning, final) == 0.0:
            raise ValueError(
                "a velocity command needs some noise in each of its three parts to have a density"
            )
        return speed * command.duration, turning * command.duration, final * command.duration


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityMotion:
    """Arcs over an (x, y, heading) grid.

    The density is taken at the cell centres: noise should not be much finer than the cells. Mass that leaves
    the grid is lost. For grids of up to some ten thousand states: the kernel depends on displacement and both
    headings together.

    Attributes
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    noise : VelocityNoise
        Standard deviations.
    window : float
        Leave out displacements longer than the way commanded by more than this many sigmas; what that drops
        is at most `erfc(window / sqrt 2)`.
    """

    space: StateSpace
    noise: VelocityNoise
    window: float = 6.0

    def __post_init__(self) -> None:
        if len(self.space.axes) != 3 or not math.isclose(self.space.axes[2].length, 2.0 * math.pi):
            raise ValueError("velocities need axes x, y, heading, the last over a whole turn")
        if not self.window > 0.0:
            raise ValueError(f"the window must be positive, not {self.window}")

    def kernel(self, control: VelocityCommand) -> tuple[IntArray, FloatArray]:
        """Give displacements, (n, 2) cells, and the kernel, (n, headings before, headings after)."""
        way_sigma, turn_sigma, final_sigma = self.noise.sigmas(control)
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

    def predict(self, belief: ArrayLike, control: VelocityCommand) -> FloatArray:
        """Move a belief, shape (x, y, heading), by a command. Not normalized."""
        belief = np.asarray(belief, dtype=float)
        if belief.shape != self.space.shape:
            raise ValueError(f"belief has shape {belief.shape}, the space {self.space.shape}")
        return apply_pose_kernel(belief, *self.kernel(control))


def _normal(value: FloatArray, sigma: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.square(value / sigma)) / (sigma * math.sqrt(2.0 * math.pi)))
