"""Notices that the robot is not where the belief is: evidence gathered against it, cycle by cycle.

A one-sided CUSUM of the likelihood ratio between a pose anywhere and the belief (Page, 1954).
"""

from __future__ import annotations

import math

from ciberrato.localization.records import FilterSettings


class Alarm:
    """Sums up what speaks against a belief."""

    def __init__(self) -> None:
        self.level = 0.0
        """Evidence gathered that the robot is not where the belief is (natural logarithm)."""

    def judge(self, evidence: float, elsewhere: float, settings: FilterSettings) -> bool:
        """Compare the evidence for the belief with that for a pose anywhere.

        Parameters
        ----------
        evidence : float
            Likelihood of what was sensed under the belief.
        elsewhere : float
            Natural logarithm of that under a pose anywhere.
        settings : FilterSettings

        Returns
        -------
        bool
            Whether the belief may stay.
        """
        ratio = math.log(max(evidence, 1e-30)) - elsewhere
        self.level = max(self.level - ratio + settings.alarm_slack, 0.0)
        return evidence != 0.0 and self.level <= settings.alarm

    def reset(self) -> None:
        """Reset the statistics: the belief was replaced."""
        self.level = 0.0
