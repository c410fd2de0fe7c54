"""Two belief files against each other."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from agent.offline.comparison import Comparison
from agent.views.figures.canvas import LINE_COLOURS, draw_walls, new_figure, save_figure, set_lab_axes
from ciberrato.world.lab import CELL_SIZE, Lab


def difference_panels(
    comparison: Comparison, path: str | os.PathLike[str], *, lab: Lab | None = None
) -> None:
    """Draw where two runs differ, a panel a step, and how far apart they are over the steps.

    Parameters
    ----------
    comparison : Comparison
    path : path-like
        The ending chooses the format.
    lab : Lab or None
        Whose walls to draw.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import SymLogNorm

    blocks, rows, columns = comparison.differences.shape
    across = 3 if columns <= 2 * rows else 2
    down = math.ceil(blocks / across)
    height = 4.6 * rows / columns + 0.45
    figure = new_figure(across * 4.6 + 0.9, (down + 1) * height + 0.4)
    maps, curve = figure.subfigures(2, 1, height_ratios=(down, 1))
    axes = maps.subplots(down, across, squeeze=False)
    # Linear around 0, logarithmic beyond: a difference of 0.001 shows beside one of 1.
    norm = SymLogNorm(linthresh=0.005, vmin=-1.0, vmax=1.0)
    for index, axis in enumerate(axes.flat):
        if index >= blocks:
            axis.set_axis_off()
            continue
        extent = (0, columns * CELL_SIZE, 0, rows * CELL_SIZE)
        axis.set_facecolor("0.85")
        axis.imshow(comparison.differences[index], origin="lower", extent=extent, cmap="PuOr", norm=norm)
        if lab is not None:
            draw_walls(axis, lab, colour="0.3")
        set_lab_axes(axis, columns * CELL_SIZE, rows * CELL_SIZE)
        name = "prior" if index == 0 else f"step {index - 1}"
        axis.set_title(f"{name}: at most {comparison.greatest[index]:.3f}", fontsize=9)
    bar = maps.colorbar(ScalarMappable(norm=norm, cmap="PuOr"), ax=axes, shrink=0.8, fraction=0.02, pad=0.01)
    bar.set_label("second minus first")
    axis = curve.subplots()
    steps = np.arange(blocks) - 1
    axis.plot(steps, comparison.divergence, "o-", color=LINE_COLOURS[0], markersize=4)
    axis.set_xlabel("step (-1: prior, 0: start cell)")
    axis.set_ylabel("divergence (bits)", fontsize=8)
    axis.grid(color="0.9")
    save_figure(figure, Path(path))
