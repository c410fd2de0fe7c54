"""The pose filter over a recorded run: its beliefs at chosen cycles, and its estimates."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ciberrato.arrays import Floats
from ciberrato.files.run_records import Cycle, RecordedRun
from ciberrato.localization.pose_filter import PoseFilter
from ciberrato.world.coordinates import PoseInDegrees
from ciberrato.world.lab import Lab


@dataclass(frozen=True)
class PoseReplay:
    """Pose filter over a recorded run, from any start.

    Attributes
    ----------
    beliefs : ndarray, shape (chosen cycles + 1, rows, columns)
        Over cells, row 0 below: before the run, then at each chosen cycle.
    poses : tuple of (x, y, heading) or None
        The estimate at each cycle of the run, units and degrees; None where it is not certain.
    doubtful_since : int or None
        The cycle from which the readings do not fit the lab.
    """

    beliefs: Floats
    poses: tuple[PoseInDegrees | None, ...]
    doubtful_since: int | None


def replay_poses(run: RecordedRun, lab: Lab, chosen: Callable[[int, Cycle], bool]) -> PoseReplay:
    """Run the pose filter over a recorded run.

    Parameters
    ----------
    run : RecordedRun
        Recorded run. The log does not hold its start: any pose counts as possible.
    lab : Lab
    chosen : callable
        Says by a cycle's index and record whether its belief is kept.

    Returns
    -------
    PoseReplay
    """
    header = run.header
    poses: list[PoseInDegrees | None] = []
    with PoseFilter(lab, header.parameters, header.sensor_angles, wait=True) as localizer:
        for index, (cycle, (measures, command)) in enumerate(zip(run.cycles, run.inputs, strict=True)):
            localizer.feed(measures, command)
            if chosen(index, cycle):
                localizer.live.mark(cycle.time)
            found = localizer.estimate()
            poses.append((found.x, found.y, math.degrees(found.heading)) if found.certain else None)
    live = localizer.live
    return PoseReplay(live.moments.blocks, tuple(poses), live.doubtful_since)
