"""A run to show, from whichever log there is: the agent's own, or a simulator's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from agent.offline.simulator_log import is_simulator_log, replay_of
from ciberrato.files.run_log import read_run
from ciberrato.files.run_records import RecordedRun
from ciberrato.world.coordinates import PoseInDegrees, SensorAngles
from ciberrato.world.lab import Lab


class Recorded(NamedTuple):
    """A run and what its log knows beside it.

    Attributes
    ----------
    run : RecordedRun
    lab : Lab or None
        None where the log names its lab only, as the agent's does.
    truth : dict of int to (x, y, heading), or None
        True poses of the robot, by cycle; None if the log does not hold them.
    """

    run: RecordedRun
    lab: Lab | None
    truth: dict[int, PoseInDegrees] | None


def read_recorded(
    path: Path,
    angles: SensorAngles,
    *,
    robot: int | None = None,
    salvage: Callable[[str], None] | None = None,
) -> Recorded:
    """Read the log of a run, whosever it is.

    Parameters
    ----------
    path : Path
    angles : tuple of four float
        Angles of the IR sensors in degrees, for a simulator's log, which does not hold them.
    robot : int or None
        Robot of a simulator's log; None = the first.
    salvage : callable, optional
        Told of lines of an agent's log that cannot be read and are left out; see `read_run`.

    Returns
    -------
    Recorded

    Raises
    ------
    LabError
        If the file is no log.
    UsageError
        If that robot is not in it.
    """
    if not is_simulator_log(path):
        return Recorded(read_run(path, salvage=salvage), None, None)
    replay, lab = replay_of(path, angles, robot=robot)
    return Recorded(replay.run, lab, replay.poses)
