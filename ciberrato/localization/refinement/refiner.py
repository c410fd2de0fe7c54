"""Refinement of the lattice's estimate by particles: its begin, and its renewal."""

from __future__ import annotations

import math

import numpy as np

from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief.estimate import CLAIM_RADIUS, CLAIM_TURN, PoseEstimate
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.records import FilterStep
from ciberrato.localization.refinement.particles import ParticleCloud
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

_APART = 0.3
"""Units between the lattice's estimate and the particles' from which on they are no longer the same."""
_APART_TURN = math.radians(7.0)
_WIDE = 0.25
"""Standard deviation in units from which on particles refine nothing."""
_PATIENCE = 5


class Refinement:
    """Follows the known pose by particles.

    Parameters
    ----------
    lab : Lab
    angles : tuple of float
        Mounting angles of the IR sensors in radians.
    parameters : Parameters
        As announced.
    generator : numpy.random.Generator
    """

    def __init__(
        self, lab: Lab, angles: tuple[float, ...], parameters: Parameters, generator: np.random.Generator
    ) -> None:
        self._cloud = ParticleCloud(WallMap.from_lab(lab), angles, parameters, generator)
        self._apart = 0
        self._followed: FilterStep | None = None
        self._judged: FilterStep | None = None

    @property
    def particles(self) -> int:
        """Number of particles; 0 while the pose is not known."""
        return self._cloud.size

    def end(self) -> None:
        """Follow nothing: the pose is not known any more."""
        self._cloud.clear()
        self._apart = 0

    def follow(self, step: FilterStep, share: float) -> None:
        """Update with a step, see `ParticleCloud.follow`."""
        self._followed = step
        if self._cloud.size:
            self._cloud.follow(step, share)

    def refine(self, found: PoseEstimate, belief: PoseBelief) -> PoseEstimate:
        """Return the particles' pose in place of the lattice's, where they follow the same one.

        Parameters
        ----------
        found : PoseEstimate
            Estimate of the lattice.
        belief : PoseBelief
            Belief from which it comes.

        Returns
        -------
        PoseEstimate
            With the probability that it had.
        """
        if self._cloud.size == 0:
            if not found.likely or belief.dense is not None:
                return found
            self._begin(found, belief)
            if self._cloud.size == 0:
                return found
        (x, y, heading), deviation = self._cloud.mean()
        turn = math.remainder(heading - found.heading, 2.0 * math.pi)
        apart = math.hypot(x - found.x, y - found.y) > _APART or abs(turn) > _APART_TURN
        if self._judged is not self._followed:
            self._judged = self._followed
            self._apart = self._apart + 1 if apart else 0
        if self._apart > _PATIENCE:
            self.end()
            return found
        if apart or max(deviation[0], deviation[1]) > _WIDE:
            return found
        return found.moved_to(x, y, math.remainder(heading, 2.0 * math.pi))

    def _begin(self, found: PoseEstimate, belief: PoseBelief) -> None:
        reach = (1.5 * CLAIM_RADIUS, 1.5 * CLAIM_RADIUS, 1.5 * CLAIM_TURN)
        self._cloud.begin(belief, (found.x, found.y, found.heading), reach)
