"""Shows a viewer what a run's agent believes: follows the log and sends overlays, as a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from agent.offline.localization import expected_readings_of, localize_run
from agent.offline.summary import peak
from agent.offline.track import estimated_track
from agent.views.logfollower import Follower, follow
from ciberrato.arrays import Floats
from ciberrato.files.run_records import Cycle, RecordedRun
from ciberrato.net.overlay import OverlayClient
from ciberrato.overlay import GridBelief, OverlayMessage, PoseMark, Shape
from ciberrato.world.lab import CELL_SIZE

if TYPE_CHECKING:
    from agent.offline.expected_readings import ExpectedReadings
    from ciberrato.world.lab import Lab


INTERVAL = 0.05
"""Seconds between looks at the log."""

_POSE_TTL = 1.0


def show_overlays(
    path: Path | Follower,
    lab: Lab,
    client: OverlayClient,
    *,
    ended: Callable[[], bool] = lambda: False,
    idle_limit: float | None = None,
) -> None:
    """Send what a run's log says to a viewer, as long as the log grows.

    Parameters
    ----------
    path : Path or LogFollower
        The agent's log; it need not exist yet.
    lab : Lab
        Lab of the run.
    client : OverlayClient
    ended : callable
        Tells whether to return; what is new by then is still shown.
    idle_limit : float or None
        Return after so many seconds without news.

    Raises
    ------
    LabError
        If the file is not the log of a run.
    """
    expected: ExpectedReadings | None = None
    beliefs: Floats | None = None
    shown = 0
    for follower in follow(path, interval=INTERVAL, ended=ended, idle_limit=idle_limit):
        run = follower.run
        if run is None or not run.cycles:
            continue
        if expected is None:
            expected = expected_readings_of(run.header, lab)
        published = run.drives_right and run.cycles[-1].estimate is None
        if published and run.steps and (beliefs is None or len(beliefs) != len(run.steps) + 1):
            beliefs = localize_run(run, expected).beliefs
            client.send(belief_overlay(run, beliefs))
        news = [cycle for cycle in run.cycles[shown:] if cycle.cells]
        shown = len(run.cycles)
        if news:
            client.send(live_belief_overlay(run, news[-1], lab))
        client.send(pose_overlay(run, beliefs))


def belief_overlay(run: RecordedRun, beliefs: Floats) -> OverlayMessage:
    """Return what the agent believes since its last step, at the cycle of that step.

    Parameters
    ----------
    run : RecordedRun
        With at least one step.
    beliefs : ndarray, shape (steps + 1, rows, columns)

    Returns
    -------
    OverlayMessage
    """
    rows, columns = beliefs[-1].shape
    extent = (0.0, 0.0, columns * CELL_SIZE, rows * CELL_SIZE)
    return OverlayMessage(
        source=run.header.robot_name or "agent",
        robot=run.header.robot_position or None,
        time=run.steps[-1].time,
        angles=run.header.sensor_angles,
        belief=GridBelief(cells=beliefs[-1], extent=extent),
    )


def live_belief_overlay(run: RecordedRun, cycle: Cycle, lab: Lab) -> OverlayMessage:
    """Return which cells were possible for the live pose filter in a cycle.

    Parameters
    ----------
    run : RecordedRun
    cycle : Cycle
        With `cells`.
    lab : Lab

    Returns
    -------
    OverlayMessage
    """
    cells = np.zeros((lab.rows, lab.columns))
    for row, column, probability in cycle.cells or ():
        cells[row, column] = probability
    return OverlayMessage(
        source=run.header.robot_name or "agent",
        robot=run.header.robot_position or None,
        time=cycle.time,
        angles=run.header.sensor_angles,
        belief=GridBelief(cells=cells, extent=(0.0, 0.0, lab.columns * CELL_SIZE, lab.rows * CELL_SIZE)),
    )


def pose_overlay(run: RecordedRun, beliefs: Floats | None) -> OverlayMessage:
    """Return where the agent takes itself to be after the last cycle of a run.

    Parameters
    ----------
    run : RecordedRun
        With at least one cycle.
    beliefs : ndarray, shape (steps + 1, rows, columns), or None

    Returns
    -------
    OverlayMessage
        Ghosts of the robot: at the live pose filter's estimate, or, where several poses are possible, at each
        of them; else, if that is one place, the way driven from where the last step's belief says that it
        began.
    """
    header, last = run.header, run.cycles[-1]
    shapes: tuple[Shape, ...] = ()
    if last.estimate is not None:
        # Modes are logged every few cycles: between, those of the last time stay until their time is up.
        poses = last.modes or (last.estimate,)
        shapes = tuple(
            _ghost(x, y, heading, f"p {probability:.2f}", number)
            for number, (x, y, heading, probability) in enumerate(poses)
        )
    elif beliefs is not None and len(peak(beliefs[-1]).cells) == 1:
        track = estimated_track(run, beliefs)
        if track is not None:
            x, y, heading = (float(value) for value in track[-1])
            shapes = (_ghost(x, y, heading, f"step {run.steps[-1].index}"),)
    return OverlayMessage(
        source=header.robot_name or "agent",
        robot=header.robot_position or None,
        time=last.time,
        shapes=shapes,
    )


def _ghost(x: float, y: float, heading: float, label: str, number: int = 0) -> PoseMark:
    return PoseMark(
        id=f"pose {number + 1}" if number else "pose", x=x, y=y, direction=heading, label=label, ttl=_POSE_TTL
    )
