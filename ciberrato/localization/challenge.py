"""Doubts about a belief: now and then a second filter begins anew, and the poses are compared.

A filter that has lost its robot may fit what is sensed better than an average place would, and never
notice; it need not even be certain of its wrong poses. So every now and then a challenger starts from all
poses on the coarse lattice. If it finds a pose that the champion does not have, that one and the champion's
are held against everything that is sensed from then on, by the exact sensor model, until one is refuted. The
true pose does not lose such a duel.
"""

from __future__ import annotations

import math

import numpy as np

from ciberrato.localization.belief.estimate import PoseEstimate, probability_near
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.symmetry import PoseScore
from ciberrato.localization.grid_filter import PoseFilter
from ciberrato.localization.records import FilterStep

PERIOD = 40
"""Messages between the end of a challenge and the beginning of the next."""
_LONGEST = 150
_DECIDED = 6.0
_SAME_PLACE = 0.7
_SAME_HEADING = math.radians(20.0)
_LIKELY = 0.2
_EXCLUDED = 0.02
"""Probability below which a champion that is not certain does not have a pose."""


class Duel:
    """A challenger's life.

    Parameters
    ----------
    challenger : PoseFilter
        Newly begun; it takes in what the champion does.
    score : PoseScore
    """

    def __init__(self, challenger: PoseFilter, score: PoseScore) -> None:
        self.challenger = challenger
        self._score = score
        self._age = 0
        self.evidence = 0.0
        """For the challenger, as a natural logarithm."""

    def judge(self, champion: PoseEstimate, step: FilterStep, belief: PoseBelief) -> bool | None:
        """Compare both poses with what was sensed.

        Parameters
        ----------
        champion : PoseEstimate
        step : FilterStep
            The champion's, of the message that both have taken in.
        belief : PoseBelief
            The champion's.

        Returns
        -------
        bool or None
            Whether the challenger has won; None if it goes on.
        """
        self._age += 1
        if self._age > _LONGEST:
            return False
        if self.challenger.belief.dense is not None:
            return None
        found = self.challenger.estimate()
        if found.probability < _LIKELY:
            return None
        turn = abs(math.remainder(found.heading - champion.heading, 2.0 * math.pi))
        if math.hypot(found.x - champion.x, found.y - champion.y) < _SAME_PLACE and turn < _SAME_HEADING:
            return False
        if not champion.certain and probability_near(belief, found.x, found.y, found.heading) > _EXCLUDED:
            return None
        poses = np.array(
            [(champion.x, champion.y, champion.heading), (found.x, found.y, found.heading)], np.float64
        )
        scores = self._score(poses, step.infrared, step.compass, step.ground, step.beacons)
        self.evidence += 0.5 * float(scores[1] - scores[0])
        if abs(self.evidence) < _DECIDED:
            return None
        return self.evidence > 0.0
