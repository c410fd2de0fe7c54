"""A live view of a running agent in a terminal: follows the agent's log, one screen, redrawn as it grows.

The view is a process of its own that only reads the log, so it cannot hold up the control loop.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from agent.localizer import localize
from agent.runlog import parse_cycle, parse_header
from agent.runrecords import Cycle, RecordedRun, RunHeader
from agent.summary import heat_map, step_table
from ciberrato.errors import LabError

if TYPE_CHECKING:
    from agent.ground_truth import GroundTruth
    from ciberrato.lab import Lab

INTERVAL = 0.2
"""Seconds between looks at the log."""

_CLEAR_ALL, _HOME, _CLEAR_LINE, _CLEAR_BELOW = "\x1b[2J", "\x1b[H", "\x1b[K", "\x1b[J"
_TABLE_ROWS = 5


class LogFollower:
    """Reads a log while it is written, each complete line once.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._rest = b""
        self._lines = 0
        self.header: RunHeader | None = None
        self.cycles: list[Cycle] = []

    @property
    def run(self) -> RecordedRun | None:
        """What is there so far; None before the first line is complete."""
        return None if self.header is None else RecordedRun(self.header, tuple(self.cycles))

    def poll(self) -> bool:
        """Read what is new.

        Returns
        -------
        bool
            Whether anything was.

        Raises
        ------
        LabError
            If a line is not one of a log.
        """
        try:
            with self._path.open("rb") as stream:
                if stream.seek(0, os.SEEK_END) < self._offset:
                    self._begin_again()
                stream.seek(self._offset)
                data = stream.read()
        except FileNotFoundError:
            return False
        except OSError as error:
            raise LabError(f"cannot be read: {error.strerror}", source=str(self._path)) from None
        self._offset += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._lines += 1
            if self.header is None:
                self.header = parse_header(line, str(self._path))
            else:
                self.cycles.append(parse_cycle(line, str(self._path), self._lines))
        return bool(lines)

    def _begin_again(self) -> None:
        """Forget everything: another run has begun to write the file."""
        self._offset, self._rest, self._lines = 0, b"", 0
        self.header, self.cycles = None, []


def watch(
    path: Path,
    lab: Lab,
    *,
    out: TextIO | None = None,
    once: bool = False,
    colour: bool = True,
    parent: int | None = None,
    idle_limit: float | None = None,
) -> None:
    """Show a run while it goes on, until the user interrupts.

    Parameters
    ----------
    path : Path
        The agent's log; it need not exist yet.
    lab : Lab
        Of the run.
    out : text stream
        Standard output if None.
    once : bool
        Show what is there and return.
    colour : bool
        Use terminal colours.
    parent : int or None
        Return when the process that started this one is no longer this one.
    idle_limit : float or None
        Return after so many seconds without news.

    Raises
    ------
    LabError
        If the file is not the log of a run.
    """
    from agent.ground_truth import compute_ground_truth

    out = sys.stdout if out is None else out
    follower = LogFollower(path)
    if not once:
        print(_CLEAR_ALL, end="", file=out, flush=True)
    truth: GroundTruth | None = None
    news = time.monotonic()
    while True:
        grew = follower.poll()
        if grew or once:
            news = time.monotonic()
            if follower.header is not None and truth is None:
                header = follower.header
                truth = compute_ground_truth(
                    lab, header.sensor_angles, header.parameters, model=header.distance_model
                )
            size = shutil.get_terminal_size()
            text = screen(follower.run, truth, width=size.columns, height=size.lines, colour=colour)
            if once:
                print(text, file=out)
                return
            lines = text.split("\n")[: size.lines - 1]
            print(
                _HOME + "".join(line + _CLEAR_LINE + "\n" for line in lines) + _CLEAR_BELOW, end="", file=out
            )
            out.flush()
        ended = parent is not None and os.getppid() != parent
        if ended or (idle_limit is not None and time.monotonic() - news > idle_limit):
            return
        time.sleep(INTERVAL)


def screen(
    run: RecordedRun | None,
    truth: GroundTruth | None,
    *,
    width: int = 80,
    height: int = 24,
    colour: bool = False,
) -> str:
    """Say on one screen what the agent is doing and where it believes to be.

    Parameters
    ----------
    run : RecordedRun or None
        So far.
    truth : GroundTruth or None
    width, height : int
        Of the terminal.
    colour : bool

    Returns
    -------
    str
        At most `height` - 1 lines of at most `width` characters (escapes aside).
    """
    if run is None or not run.cycles or truth is None:
        return "waiting for the log of a run"
    header, last = run.header, run.cycles[-1]
    button = "running" if last.start else "stopped" if last.stop else "finished"
    limit = f" of {header.parameters.sim_time}" if header.parameters.sim_time else ""
    lines = [
        f"{header.robot_name or 'robot'} in {header.lab_name}: cycle {last.time}{limit}, {last.phase}, "
        f"simulator {button}{', COLLISION' if last.collision else ''}",
        "IR "
        + "  ".join(
            f"{angle:g}°: {'-' if value is None else f'{value:.1f}'}"
            for angle, value in zip(header.sensor_angles, last.infrared, strict=True)
        )
        + f"   compass {'-' if last.compass is None else f'{last.compass:g}'}"
        + f"   motors {'-' if last.command is None else '{:g} {:g}'.format(*last.command)}",
        f"way {last.displacement:.2f}  beside {last.lateral:+.2f}  heading {last.heading:+.1f}°",
        "",
    ]
    found = localize(
        [step.readings for step in run.steps],
        truth,
        preset=header.preset,
        obstacle_noise=header.parameters.obstacle_noise,
    )
    table = step_table(found.beliefs).split("\n")
    picture = heat_map(found.beliefs[-1], width=width, colour=colour).split("\n")
    room = height - 1 - len(lines) - len(picture) - 2
    rows = max(1, min(_TABLE_ROWS, room))
    lines += [table[0], *table[1:][-rows:], "", *picture]
    # A colour's escapes take no room; only the picture has them, and it fits by itself.
    return "\n".join(line if "\x1b" in line else line[:width] for line in lines)
