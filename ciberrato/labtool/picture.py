"""Pictures of labs, with start positions and with what a check found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agent.views.figures.canvas import save_figure
from ciberrato import plot
from ciberrato.checks.files import Checked
from ciberrato.errors import UsageError
from ciberrato.files.lab import LabFile
from ciberrato.files.start_grid import GridFile
from ciberrato.plaintext import plain
from ciberrato.plot.canvas import new_figure, set_title
from ciberrato.world.lab import Lab
from ciberrato.world.start_grid import StartGrid

_COLOURS = {"error": "#d62728", "warning": "#d62728", "note": "#0072B2"}
_MOST_LINES = 24
_LONGEST = 130


def draw_lab(lab: Lab, path: Path, grid: StartGrid | None = None) -> None:
    """Draw a lab: walls, lines, beacons, targets, start positions.

    Parameters
    ----------
    lab : Lab
    path : Path
        The ending chooses the format.
    grid : StartGrid or None

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure, axis = _figure(lab, 0.0)
    plot.lab(lab, axis, grid=grid, legend=True)
    save_figure(figure, path)


def draw_checked(checked: Sequence[Checked], path: Path) -> None:
    """Draw the lab of a check, every finding that has a place marked by a number, and listed below.

    Parameters
    ----------
    checked : sequence of Checked
        With one lab among them; start grids are those of that lab.
    path : Path

    Raises
    ------
    UsageError
        If there is no lab among them, or several; if the figure cannot be written.
    """
    labs = [one.contents.lab for one in checked if isinstance(one.contents, LabFile)]
    if len(labs) != 1:
        raise UsageError(f"--png: draws one lab, and there are {len(labs)} among the files that can be used")
    (lab,) = labs
    grids = [one.contents.grid for one in checked if isinstance(one.contents, GridFile)]
    findings = [finding for one in checked for finding in one.findings]
    lines = [_line(number, str(finding)) for number, finding in enumerate(findings, 1)][:_MOST_LINES]
    if len(findings) > _MOST_LINES:
        lines.append(f"... and {len(findings) - _MOST_LINES} more")
    figure, axis = _figure(lab, 0.2 * len(lines))
    positions = tuple(position for grid in grids for position in grid.positions)
    plot.lab(lab, axis, grid=StartGrid(positions=positions) if positions else None)
    for number, finding in enumerate(findings, 1):
        if finding.place is None:
            continue
        x = min(max(finding.place[0], 0.0), lab.width)
        y = min(max(finding.place[1], 0.0), lab.height)
        colour = _COLOURS[finding.severity]
        axis.plot(
            [x], [y], "o", markersize=13, markerfacecolor="white", color=colour, zorder=8, clip_on=False
        )
        axis.annotate(
            str(number),
            (x, y),
            ha="center",
            va="center",
            fontsize=7,
            color=colour,
            zorder=9,
            annotation_clip=False,
        )
    set_title(axis, f"{plain(lab.name, 40)}: {len(findings)} finding{'s' * (len(findings) != 1)}")
    axis.set_xlabel("x in units\n" + "\n".join(lines), fontsize=7, loc="left", parse_math=False)
    save_figure(figure, path)


def _figure(lab: Lab, more: float) -> tuple[Any, Any]:
    width = 9.0
    figure = new_figure(width, min(max(width * lab.height / lab.width, 1.5), 30.0) + 1.0 + more)
    return figure, figure.subplots()


def _line(number: int, text: str) -> str:
    return plain(f"{number}  {text}", _LONGEST)


def draw_track(lab: Lab, path: Path, poses: Sequence[tuple[float, float]], title: str) -> None:
    """Draw a lab and the path that a robot has driven through it, from blue to yellow.

    Parameters
    ----------
    lab : Lab
    path : Path
        The ending chooses the format.
    poses : sequence of (x, y)
        Units, a cycle each.
    title : str

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure, axis = _figure(lab, 0.0)
    plot.track(poses, plot.lab(lab, axis), by_cycle=True, legend=True)
    set_title(axis, title)
    save_figure(figure, path)
