"""Curves over a run: how sure the filter is, how right, and how well the robot was followed."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from agent.offline.summary import normalized_entropy
from agent.views.figures.canvas import LINE_COLOURS, TRUE_COLOUR, new_figure, save_figure, set_step_axis
from ciberrato.arrays import Floats
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
        Where the robot was at each block (None for the prior).

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    steps = np.arange(len(beliefs)) - 1
    known = [not np.isnan(belief).any() for belief in beliefs]
    entropy = [normalized_entropy(b) if ok else math.nan for b, ok in zip(beliefs, known, strict=True)]
    greatest = [float(b.max()) if ok else math.nan for b, ok in zip(beliefs, known, strict=True)]
    figure = new_figure(7.0, 5.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    # The one below is wider: where both are the same, both are seen.
    upper.plot(steps, greatest, "o-", color=LINE_COLOURS[0], markersize=8, lw=3.5, label="most likely cell")
    if true_cells is not None:
        right = [
            math.nan if cell is None else float(belief[cell])
            for belief, cell in zip(beliefs, true_cells, strict=True)
        ]
        upper.plot(steps, right, "s--", color=TRUE_COLOUR, markersize=4, label="true cell")
    upper.set_ylabel("probability")
    upper.set_ylim(-0.03, 1.03)
    lower.plot(steps, entropy, "o-", color=LINE_COLOURS[2], markersize=4, label="entropy")
    figure.legend(loc="outside upper center", ncols=3, fontsize=9)
    lower.set_ylabel("entropy (bits)")
    lower.set_ylim(bottom=-0.1)
    set_step_axis(lower, len(beliefs))
    for axis in (upper, lower):
        axis.grid(color="0.9")
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
        colour = LINE_COLOURS[index]
        band = 2.0 * deviations[:, index]
        axis.fill_between(times, -band, band, color=colour, alpha=0.2, lw=0)
        axis.plot(times, errors[:, index], color=colour, linewidth=1.0)
        axis.axhline(0.0, color="0.6", linewidth=0.6)
        axis.set_ylabel(name, fontsize=9)
        axis.grid(color="0.93")
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color="0.3", label="error: dead reckoning minus truth"),
        Patch(color="0.8", label="±2 standard deviations, as the agent claims"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=2, fontsize=9)
    figure.align_ylabels()
    figure.axes[-1].set_xlabel("time (cycles)")
    save_figure(figure, Path(path))
