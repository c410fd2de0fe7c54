"""Curves over a run: how sure the filter is, how right, and how well the robot was followed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from agent.views.figures.canvas import save_figure
from ciberrato import plot
from ciberrato.arrays import Floats
from ciberrato.plot.canvas import LINE_COLOURS, new_figure
from ciberrato.plot.curves import TIME_LABEL
from ciberrato.world.coordinates import Cell


def step_curves(
    beliefs: Floats, path: str | os.PathLike[str], *, true_cells: Sequence[Cell | None] | None = None
) -> None:
    """Draw entropy and the greatest probability over the steps; that of the true cell where it is known.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
        The prior first. Blocks of nan leave a gap.
    path : path-like
        The ending chooses the format.
    true_cells : sequence of (row, column) or None
        Cell of the robot at each block (None for the prior).

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure = new_figure(7.0, 5.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    plot.probabilities(beliefs, upper, truth=true_cells)
    plot.entropies(beliefs, lower)
    upper.set_xlabel("")
    figure.legend(loc="outside upper center", ncols=3, fontsize=9)
    save_figure(figure, Path(path))


def pose_error_curves(
    times: Sequence[int], errors: Floats, deviations: Floats, path: str | os.PathLike[str]
) -> None:
    """Draw how far off the estimated pose was, with the filter's own standard deviations.

    Parameters
    ----------
    times : sequence of int
        Cycles.
    errors : ndarray, shape (times, 3)
        Estimate minus truth: along and across the way in units, heading in degrees.
    deviations : ndarray, shape (times, 3)
        Standard deviations that the estimate claims, in the same units.
    path : path-like
        The ending chooses the format.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure = new_figure(8.0, 6.0)
    names = ("error along (units)", "error across (units)", "error of heading (°)")
    for index, (axis, name) in enumerate(zip(figure.subplots(3, 1, sharex=True), names, strict=True)):
        colours = [LINE_COLOURS[index]]
        plot.series(
            times, errors[:, index], axis, name=name, deviations=deviations[:, index], colours=colours
        )
        axis.set_xlabel("")
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color="0.3", label="error: dead reckoning minus truth"),
        Patch(color="0.8", label="±2 standard deviations, as the agent claims"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=2, fontsize=9)
    figure.align_ylabels()
    figure.axes[-1].set_xlabel(TIME_LABEL)
    save_figure(figure, Path(path))
