"""Tempering of the readings of one moment: the exponent of their likelihood.

The error made by taking one distance for a whole square is the same in the next cycle if the robot is still
in the same square. Likelihoods are therefore raised to a power that is proportional to how many squares and
bins the robot has moved on, up to a limit (Thrun, Burgard, Fox, *Probabilistic Robotics*, section 6.3.4, on
dependent readings).
"""

from __future__ import annotations

from ciberrato.localization.filtering.stage import Stage

_LONG_REST = 20  # messages after which readings of a robot at rest bring nothing new


class Tempering:
    """Counts how long the robot has been at rest."""

    def __init__(self) -> None:
        self._rested = 0

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
            Between 0 and the settings' `exponent`.
        """
        settings = stage.settings
        progress = moved / stage.tables.lattice.resolution + turned / stage.belief.bin_width
        if progress < 1e-3:
            self._rested += 1
            if self._rested > _LONG_REST:
                return 0.0
            return settings.exponent if self._rested == 1 else settings.least_exponent / self._rested
        self._rested = 0 if progress > 0.1 else self._rested
        return settings.exponent * min(max(progress, settings.least_exponent), 1.0)
