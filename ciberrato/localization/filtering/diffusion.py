"""Spreads a belief by the noise of the motions: gathered, and applied to one axis at a time, in turn."""

from __future__ import annotations

import math

from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.records import FilterSettings

_DEGREE = math.pi / 180.0


class Diffusion:
    """Gathers variances.

    Parameters
    ----------
    motors_noise : float
        Percent, as announced.
    """

    def __init__(self, motors_noise: float) -> None:
        self._noise = motors_noise
        self._variances = [0.0, 0.0, 0.0]  # x, y and heading, gathered and not yet applied
        self._next_axis = 2
        self._cycles = 0

    def spread(self, belief: PoseBelief, left: float, right: float, settings: FilterSettings) -> None:
        """Add the noise of a cycle, and spread the belief along one axis if it is time.

        Parameters
        ----------
        belief : PoseBelief
        left, right : float
            Motion of the wheels, in units.
        settings : FilterSettings
        """
        wheel_variance = (2.0 * self._noise / 100.0) ** 2 * (left**2 + right**2)
        moving = min((abs(left) + abs(right)) / 0.2, 1.0)
        noisy = 1.0 if self._noise > 0.0 else 0.25
        floor_turn = (settings.turn_floor * _DEGREE) ** 2 * moving * noisy
        floor_place = settings.place_floor**2 * moving * noisy
        place = wheel_variance / 8.0 + floor_place
        for axis, variance in enumerate((place, place, wheel_variance + floor_turn)):
            self._variances[axis] += variance
        self._cycles += 1
        if self._cycles * 3 < settings.diffusion_period:
            return
        self._cycles = 0
        axis = self._next_axis
        self._next_axis = (axis + 1) % 3
        variance, self._variances[axis] = self._variances[axis], 0.0
        if axis == 2:
            belief.diffuse_heading(variance)
        else:
            belief.diffuse_place(variance, vertical=axis == 1)
