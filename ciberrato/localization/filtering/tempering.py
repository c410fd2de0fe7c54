"""Tempering of the readings of one moment: the exponent of their likelihood.

The likelihood of a square is exact for one reading: the mean over the poses in it. The error made by taking
one distance for all of a square returns with the next reading, for two reasons. A robot that is still in the
same square has the same error. Therefore the power is proportional to how many squares and bins the robot has
moved on, up to a limit. And as the lattice moves with the robot, a state keeps its place within its square
from cycle to cycle until the noise of the motion has spread it. The first readings therefore count in full,
and the power falls to that of readings whose errors are those of the ones before (Thrun, Burgard, Fox,
*Probabilistic Robotics*, section 6.3.4, on dependent readings).
"""

from __future__ import annotations

import math

from ciberrato.localization.filtering.stage import Stage

_LONG_REST = 20  # messages after which readings of a robot at rest bring nothing new


class Tempering:
    """Counts how long the robot has been at rest, and the moments in motion since all poses were possible."""

    def __init__(self) -> None:
        self._rested = 0
        self._moments = 0.0

    def begin_anew(self) -> None:
        """Forget the moments: all poses are possible, and no error has been made yet."""
        self._moments = 0.0

    def doubt(self) -> None:
        """Let no reading count in full any more: the motion is not known well, and its error stays."""
        self._moments = math.inf

    def exponent(self, moved: float, turned: float, stage: Stage) -> float:
        """Return the power to which the likelihood of a moment is raised.

        Parameters
        ----------
        moved, turned : float
            Units driven and radians turned since the last moment.
        stage : Stage
            Its squares and bins are what progress is measured in.

        Returns
        -------
        float
            Between 0 and the settings' `first_exponent`.
        """
        settings = stage.settings
        new = math.exp(-self._moments / settings.settling)
        limit = settings.exponent + (settings.first_exponent - settings.exponent) * new
        progress = moved / stage.tables.lattice.resolution + turned / stage.belief.bin_width
        if progress < 1e-3:
            self._rested += 1
            if self._rested > _LONG_REST:
                return 0.0
            return limit if self._rested == 1 else settings.least_exponent / self._rested
        self._rested = 0 if progress > 0.1 else self._rested
        self._moments += 1
        return limit * min(max(progress, settings.least_exponent), 1.0)
