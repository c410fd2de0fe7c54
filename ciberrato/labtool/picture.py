"""Pictures of labs, with start positions and with what a check found."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from agent.views.figures.canvas import save_figure
from ciberrato import plot
from ciberrato.checks.files import Checked
from ciberrato.errors import UsageError
from ciberrato.files.lab import LabFile
from ciberrato.files.start_grid import GridFile
from ciberrato.plot.canvas import new_figure
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
    axis.set_title(f"{lab.name}: {len(findings)} finding{'s' * (len(findings) != 1)}", fontsize=10)
    axis.set_xlabel("x in units\n" + "\n".join(lines), fontsize=7, loc="left")
    save_figure(figure, path)


def _figure(lab: Lab, more: float) -> tuple[Any, Any]:
    width = 9.0
    figure = new_figure(width, min(max(width * lab.height / lab.width, 1.5), 30.0) + 1.0 + more)
    return figure, figure.subplots()


def _line(number: int, text: str) -> str:
    text = f"{number}  {text}"
    return text.replace("$", r"\$") if len(text) <= _LONGEST else text[:_LONGEST].replace("$", r"\$") + "…"


def draw_track(lab: Lab, path: Path, poses: Sequence[tuple[float, float]], title: str) -> None:
    """Draw a lab and the way that a robot has gone through it, from blue to yellow.

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
    from matplotlib.collections import LineCollection

    figure, axis = _figure(lab, 0.0)
    plot.lab(lab, axis)
    pairs = list(pairwise(poses))
    track = LineCollection(pairs, array=range(len(pairs)), cmap="viridis", linewidths=2.0, zorder=6)
    axis.add_collection(track)
    for pose, marker, name in ((poses[0], "o", "start"), (poses[-1], "s", "end")):
        axis.plot(*pose, marker, markersize=7, markerfacecolor="white", color="#D55E00", zorder=7)
        axis.annotate(name, pose, xytext=(6, 6), textcoords="offset points", color="#D55E00", zorder=8)
    if pairs:
        figure.colorbar(track, ax=axis, label="cycle", shrink=0.6)
    axis.set_title(title, fontsize=10)
    save_figure(figure, path)
