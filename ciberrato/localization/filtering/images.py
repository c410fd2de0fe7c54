"""Claims in a lab that looks the same turned round: shared with the turned images."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.evidence.gps import GpsSense
from ciberrato.localization.evidence.start_prior import StartPrior
from ciberrato.localization.evidence.symmetry import SymmetryCheck
from ciberrato.localization.records import FilterStep

_EXCLUDED = 50.0  # evidence beyond any doubt
_WORTH_COMPARING = 0.3  # probability of the estimate


class TurnedImages:
    """Shares an estimate's probability with its images.

    Parameters
    ----------
    check : SymmetryCheck
        Comparison of the readings with the lab's symmetry.
    start : StartPrior
    gps : GpsSense or None
    """

    def __init__(self, check: SymmetryCheck, start: StartPrior, gps: GpsSense | None) -> None:
        self._check = check
        self._start = start
        self._gps = gps
        self._compared = False

    def begin_message(self) -> None:
        """Announce that there is something new to compare."""
        self._compared = False

    def share(self, found: PoseEstimate, step: FilterStep | None, *, restarted: bool) -> PoseEstimate:
        """Return an estimate with its share of the probability.

        Parameters
        ----------
        found : PoseEstimate
        step : FilterStep or None
            Taken in last; compared once with what is expected of the estimate and of its images.
        restarted : bool
            Whether the filter has begun anew since the start: then what was told of the start says nothing.
        """
        if not self._check.turns:
            return found
        if step is not None and found.probability > _WORTH_COMPARING and not self._compared:
            self._compared = True
            way = sum((motion.left + motion.right) / 2.0 for motion in step.motions)
            pose = (found.x, found.y, found.heading)
            self._check.observe(pose, way, step.infrared, step.compass, step.ground, step.beacons)
        share = self._check.share(self._besides(found.heading, restarted=restarted))
        return dataclasses.replace(found, probability=found.probability * share)

    def split(self, found: PoseEstimate, *, restarted: bool) -> list[PoseEstimate]:
        """Return an estimate of the belief and its images, each with its part of the probability.

        Parameters
        ----------
        found : PoseEstimate
            Of the most probable state.
        restarted : bool
            As of `share`.
        """
        pose = (found.x, found.y, found.heading)
        poses = [pose, *(turn.apply(pose) for turn in self._check.turns)]
        shares = self._check.shares(self._besides(found.heading, restarted=restarted))
        return [
            dataclasses.replace(found.moved_to(*each), probability=found.probability * float(share))
            for each, share in zip(poses, shares, strict=True)
        ]

    def _besides(self, heading: float, *, restarted: bool) -> NDArray[np.float64]:
        """Return the evidence of start and GPS against each image, as natural logarithms."""
        turns = self._check.turns
        known = 0.0 if restarted else _EXCLUDED
        against = np.array([known * self._start.excludes(turn) for turn in turns])
        if self._gps is not None:
            headings = heading + np.array([0.0, *(turn.angle for turn in turns)])
            tracker = self._gps.tracker
            weights = np.log(tracker.at(tracker.weights(), headings) + 1e-9)
            against += weights[0] - weights[1:]
        return against
