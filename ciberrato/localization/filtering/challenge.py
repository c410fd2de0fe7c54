"""Doubts about a belief: now and then a second filter begins anew, and the poses are compared.

A filter that has lost its robot may fit what is sensed better than an average place would, and never
notice; it need not even be certain of its wrong poses. So every now and then a challenger starts from all
poses on the coarse lattice. If it finds a pose that the champion does not have, that one and the champion's
are held against everything that is sensed from then on, by the exact sensor model, until one is refuted. The
true pose does not lose such a test: a sequential probability ratio test of two poses (Wald, 1945).

A challenger may know where the robot is not before it knows where it is: in a long corridor, say, when the
champion has it in the open. So the beliefs are compared, too, as forecasters (Dawid, 1984): by how likely
each found every reading before it took it in. A champion that foretells much worse than a challenger which
excludes its pose is refuted, and the challenger goes on from what it has.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from ciberrato.localization.belief.estimate import PoseEstimate, probability_near
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.symmetry import PoseScore
from ciberrato.localization.filtering.alignment import MessageAlignment
from ciberrato.localization.filtering.stage import Stage
from ciberrato.localization.records import FilterStep
from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import Measures

PERIOD = 40
"""Messages between the end of a challenge and the beginning of the next."""
_LONGEST = 150
_DECIDED = 6.0
_SAME_PLACE = 0.7
_SAME_HEADING = math.radians(20.0)
_LIKELY = 0.2
_EXCLUDED = 0.02
"""Probability below which a belief does not have a pose."""
_SHARE = 0.5
"""Exponent of what was foretold of a message: the errors of squares return with the next one."""


class Contender(Protocol):
    """A filter that takes messages in: champion or challenger."""

    stage: Stage
    alignment: MessageAlignment
    last_step: FilterStep | None
    foretold: float | None

    def begin_at(self, wheels: Command, time: int | None) -> None:
        """Begin in the middle of a run."""

    def doubt_motion(self) -> None:
        """Trust no reading in full: commands act at unsure times."""

    def observe(self, measures: Measures, command_in_effect: Command | None) -> None:
        """Process one message."""

    def estimate(self) -> PoseEstimate:
        """Return the pose at the last message."""
        ...


class Challenge:
    """Lets a challenger begin every `PERIOD` messages, and holds it against the champion.

    Parameters
    ----------
    begin : callable
        Returns a challenger, for which all poses are possible.
    score : PoseScore
        The exact sensor model.
    """

    def __init__(self, begin: Callable[[], Contender], score: PoseScore) -> None:
        self._begin = begin
        self._score = score
        self._test: HypothesisTest | None = None
        self._waited = 0
        self._doubtful = False

    def doubt_motion(self) -> None:
        """Count the first readings of every challenger in part, too."""
        self._doubtful = True
        if self._test is not None:
            self._test.challenger.doubt_motion()

    @property
    def active(self) -> bool:
        """Return whether there is a challenger now."""
        return self._test is not None

    def end(self) -> None:
        """Send the challenger away: all poses are possible for the champion, too."""
        self._test = None

    def observe(
        self,
        champion: Contender,
        measures: Measures,
        command: Command | None,
        before: tuple[Command, int | None],
    ) -> Contender | None:
        """Start a challenger, if it is time for one.

        Parameters
        ----------
        champion : Contender
            It has taken the message in.
        measures : Measures
        command : (float, float) or None
            In effect since the message before.
        before : tuple
            Motion of the wheels before the message, and the time of the one before.

        Returns
        -------
        Contender or None
            The challenger, if it has won.
        """
        step = champion.last_step
        if step is None or not step.motions:
            return None
        if self._test is None:
            if champion.stage.belief.dense is None:
                self._waited += 1
            if self._waited < PERIOD or champion.alignment.lag > 0:
                return None
            self._waited = 0
            challenger = self._begin()
            challenger.begin_at(*before)
            if self._doubtful:
                challenger.doubt_motion()
            self._test = HypothesisTest(challenger, self._score)
        test = self._test
        test.challenger.observe(measures, command)
        test.compare_forecasts(champion)
        won = test.judge(champion.estimate(), step, champion.stage.belief)
        if won is None:
            return None
        self._test = None
        return test.challenger if won else None


class HypothesisTest:
    """Champion against challenger, by what is sensed from now on.

    Parameters
    ----------
    challenger : Contender
        Newly begun; it takes in what the champion does.
    score : PoseScore
    """

    def __init__(self, challenger: Contender, score: PoseScore) -> None:
        self.challenger = challenger
        self._score = score
        self._age = 0
        self.evidence = 0.0
        """For the challenger's pose, as a natural logarithm."""
        self.forecasts = 0.0
        """For the challenger's belief, by what it foretold, likewise; not less than 0."""

    def compare_forecasts(self, champion: Contender) -> None:
        """Update the evidence between the beliefs with what both have foretold of the same readings."""
        told, other, step = champion.foretold, self.challenger.foretold, champion.last_step
        if told is not None and other is not None and step is not None:
            new = min(step.exponent / champion.stage.settings.exponent, 1.0)
            self.forecasts = max(self.forecasts + _SHARE * new * (other - told), 0.0)

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
        if self.challenger.stage.belief.dense is not None:
            return None
        if self.forecasts > _DECIDED and self._excludes(champion):
            return True
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

    def _excludes(self, pose: PoseEstimate) -> bool:
        belief = self.challenger.stage.belief
        return probability_near(belief, pose.x, pose.y, pose.heading) < _EXCLUDED
