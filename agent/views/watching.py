"""A live view of a running agent in a terminal: follows the agent's log, one screen, redrawn as it grows.

The view is a process of its own that only reads the log, so it cannot hold up the control loop.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from agent.offline.localization import expected_readings_of, localize_run
from agent.offline.summary import cell_name, heat_map, peak, step_table
from agent.views.logfollower import Follower, LogFollower, SimulatorLogFollower, follow
from ciberrato.arrays import Floats
from ciberrato.files.run_records import Cycle, RecordedRun
from ciberrato.localization.belief.estimate import cell_at
from ciberrato.plaintext import plain

if TYPE_CHECKING:
    from agent.offline.expected_readings import ExpectedReadings
    from ciberrato.world.coordinates import PoseInDegrees
    from ciberrato.world.lab import Lab

INTERVAL = 0.2
"""Seconds between looks at the log."""

_CLEAR_ALL, _HOME, _CLEAR_LINE, _CLEAR_BELOW = "\x1b[2J", "\x1b[H", "\x1b[K", "\x1b[J"
_TABLE_ROWS = 5
_MOST_NAME = 24


def watch(
    path: Path | Follower,
    lab: Lab,
    *,
    out: TextIO | None = None,
    once: bool = False,
    colour: bool = True,
    ended: Callable[[], bool] = lambda: False,
    idle_limit: float | None = None,
) -> None:
    """Show a run while it goes on, until the user interrupts.

    Parameters
    ----------
    path : Path, LogFollower or SimulatorLogFollower
        The agent's log, which need not exist yet; or a simulator's.
    lab : Lab
        Lab of the run.
    out : text stream
        Standard output if None.
    once : bool
        Show what is there and return.
    colour : bool
        Use terminal colours.
    ended : callable
        Tells whether to return; what is new by then is still shown.
    idle_limit : float or None
        Return after so many seconds without news.

    Raises
    ------
    LabError
        If the file is not the log of a run.
    """
    out = sys.stdout if out is None else out
    if once:
        once_only = LogFollower(path) if isinstance(path, Path) else path
        once_only.poll()
        print(_screen_of(once_only, lab, None, colour)[0], file=out)
        return
    print(_CLEAR_ALL, end="", file=out, flush=True)
    expected: ExpectedReadings | None = None
    for follower in follow(path, interval=INTERVAL, ended=ended, idle_limit=idle_limit):
        text, expected = _screen_of(follower, lab, expected, colour)
        lines = text.split("\n")[: shutil.get_terminal_size().lines - 1]
        print(_HOME + "".join(line + _CLEAR_LINE + "\n" for line in lines) + _CLEAR_BELOW, end="", file=out)
        out.flush()


def _screen_of(
    follower: Follower, lab: Lab, expected: ExpectedReadings | None, colour: bool
) -> tuple[str, ExpectedReadings | None]:
    if follower.header is not None and expected is None:
        expected = expected_readings_of(follower.header, lab)
    size = shutil.get_terminal_size()
    pose = None
    if isinstance(follower, SimulatorLogFollower) and follower.run.cycles:
        pose = follower.poses.get(follower.run.cycles[-1].time)
    shown = screen(
        follower.run, expected, width=size.columns, height=size.lines, colour=colour, true_pose=pose
    )
    return shown, expected


def screen(
    run: RecordedRun | None,
    expected: ExpectedReadings | None,
    *,
    width: int = 80,
    height: int = 24,
    colour: bool = False,
    true_pose: PoseInDegrees | None = None,
) -> str:
    """Return a screen that shows the agent's state and where it believes to be.

    Parameters
    ----------
    run : RecordedRun or None
        So far.
    expected : ExpectedReadings or None
    width, height : int
        Width and height of the terminal.
    colour : bool
    true_pose : (x, y, heading) or None
        True pose of the robot, units and degrees, if the log holds it.

    Returns
    -------
    str
        At most `height` - 1 lines of at most `width` characters (escapes aside).
    """
    if run is None or not run.cycles or expected is None:
        return "waiting for the log of a run"
    header, last = run.header, run.cycles[-1]
    button = "running" if last.start else "stopped" if last.stop else "finished"
    name = plain(header.robot_name, _MOST_NAME) or "robot"
    lab_name = plain(header.lab_name, _MOST_NAME)
    limit = f" of {header.parameters.sim_time}" if header.parameters.sim_time else ""
    lines = [
        f"{name}{f' in {lab_name}' if lab_name else ''}: cycle {last.time}{limit}, {last.phase}, "
        f"simulator {button}{', COLLISION' if last.collision else ''}",
        "IR "
        + "  ".join(
            f"{angle:g}°: {'-' if value is None else f'{value:.1f}'}"
            for angle, value in zip(header.sensor_angles, last.infrared, strict=True)
        )
        + f"   compass {'-' if last.compass is None else f'{last.compass:g}'}"
        + f"   motors {'-' if last.command is None else '{:g} {:g}'.format(*last.command)}",
        _pose_line(last)
        + ("" if true_pose is None else "   true pose ({:.2f}, {:.2f}) {:.1f}°".format(*true_pose)),
        "",
    ]
    rows, columns, _ = expected.readings.shape
    if run.drives_right:
        beliefs = localize_run(run, expected).beliefs
        table = step_table(beliefs).split("\n")
    else:
        shown = [cycle for cycle in run.cycles if cycle.cells]
        if not shown:
            return "\n".join(line[:width] for line in lines)
        beliefs = _logged_belief(shown[-1], rows, columns)[np.newaxis]
        table = [f"belief of the live filter at cycle {shown[-1].time}: {_peak_line(beliefs[0])}"]
    picture = heat_map(beliefs[-1], width=width, colour=colour).split("\n")
    room = height - 1 - len(lines) - len(picture) - 2
    most = max(1, min(_TABLE_ROWS, room))
    lines += [table[0], *table[1:][-most:], "", *picture]
    # A colour's escapes take no room; only the picture has them, and it fits by itself.
    return "\n".join(line if "\x1b" in line else line[:width] for line in lines)


def _logged_belief(cycle: Cycle, rows: int, columns: int) -> Floats:
    """Return the belief over cells that a live filter has logged; shape (rows, columns)."""
    belief = np.zeros((rows, columns))
    for row, column, probability in cycle.cells or ():
        belief[row, column] = probability
    return belief


def _peak_line(belief: Floats) -> str:
    best = peak(belief)
    return f"cell {cell_name(best.cells[0])}, p {best.probability:.3f}"


def _pose_line(cycle: Cycle) -> str:
    """Return where the robot takes itself to be: by the drive's dead reckoning, or by the pose filter."""
    if cycle.displacement is not None and cycle.lateral is not None and cycle.heading is not None:
        return f"way {cycle.displacement:.2f}  beside {cycle.lateral:+.2f}  heading {cycle.heading:+.1f}°"
    if cycle.estimate is None:
        return "no pose in the log yet: no pose filter runs, or its tables are not there"
    x, y, heading, probability = cycle.estimate
    return (
        f"cell {cell_name(cell_at(x, y))}  x {x:.2f}  y {y:.2f}  heading {heading:+.1f}°  p {probability:.3f}"
    )
