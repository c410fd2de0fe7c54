"""Beliefs over the lab, a panel a step."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agent.offline.summary import cell_name, normalized_entropy, peak
from agent.views.figures.canvas import TRUE_COLOUR, draw_walls, new_figure, save_figure, set_lab_axes
from ciberrato.arrays import Floats
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab


def belief_panels(
    beliefs: Floats,
    path: str | os.PathLike[str],
    *,
    lab: Lab | None = None,
    true_cells: Sequence[Cell | None] | None = None,
    title: str | None = None,
) -> None:
    """Draw one panel a step: the belief, the walls over it, the true cell where it is known.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
        The prior first; row 0 is the bottom row of the lab.
    path : path-like
        Where to write; the ending chooses the format (png, svg, pdf).
    lab : Lab or None
        Whose walls to draw.
    true_cells : sequence of (row, column) or None
        Where the robot was at each block (None for the prior).
    title : str or None
        Above all panels.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    from matplotlib.cm import ScalarMappable

    blocks, rows, columns = beliefs.shape
    across = min(blocks, 3 if columns <= 2 * rows else 2 if blocks <= 6 or columns > 20 else 3)
    down = math.ceil(blocks / across)
    panel_width = 4.6
    panel_height = panel_width * rows / columns + 0.45
    figure = new_figure(across * panel_width + 0.9, down * panel_height + 0.6)
    axes = figure.subplots(down, across, squeeze=False)
    norm = probability_scale()
    for index, axis in enumerate(axes.flat):
        if index >= blocks:
            axis.set_axis_off()
            continue
        truth = true_cells[index] if true_cells is not None else None
        draw_belief(axis, beliefs[index], norm, lab, truth)
        axis.set_title(_panel_title(index, beliefs[index]), fontsize=9)
        if index + across < blocks:
            axis.tick_params(labelbottom=False)
        if index % across:
            axis.tick_params(labelleft=False)
    bar = figure.colorbar(
        ScalarMappable(norm=norm, cmap="viridis"), ax=axes, shrink=0.8, fraction=0.02, pad=0.01
    )
    bar.set_label("probability of the cell")
    bar.set_ticks([0, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 1])
    if title:
        figure.suptitle(title, fontsize=11)
    save_figure(figure, Path(path))


def probability_scale() -> Any:
    """Make the colour scale of all beliefs: a square root keeps small masses visible beside a certain cell.

    Returns
    -------
    matplotlib.colors.Normalize
    """
    from matplotlib.colors import PowerNorm

    return PowerNorm(gamma=0.5, vmin=0.0, vmax=1.0)


def draw_belief(
    axis: Any, belief: Floats, norm: Any, lab: Lab | None = None, truth: Cell | None = None
) -> Any:
    """Draw one belief.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    belief : ndarray, shape (rows, columns)
        Row 0 at the bottom.
    norm : matplotlib.colors.Normalize
        See `probability_scale`.
    lab : Lab or None
        Whose walls to draw.
    truth : (row, column) or None
        Where to draw a ring.

    Returns
    -------
    matplotlib.image.AxesImage
    """
    rows, columns = belief.shape
    width, height = columns * CELL_SIZE, rows * CELL_SIZE
    axis.set_facecolor("0.85")  # where there is no belief (nan)
    image = axis.imshow(
        belief,
        origin="lower",
        extent=(0, width, 0, height),
        cmap="viridis",
        norm=norm,
        interpolation="nearest",
        zorder=1,
    )
    if lab is not None:
        draw_walls(axis, lab)
        width, height = max(width, lab.width), max(height, lab.height)
    if truth is not None:
        ring_cell(axis, truth)
    set_lab_axes(axis, width, height)
    return image


def ring_cell(axis: Any, cell: Cell) -> None:
    """Put a ring around a cell's centre; white under red shows on every colour of the belief.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    cell : (row, column)
    """
    row, column = cell
    centre = ((column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE)
    axis.plot(*centre, "o", markersize=9, fillstyle="none", color="white", markeredgewidth=3, zorder=3)
    axis.plot(*centre, "o", markersize=9, fillstyle="none", color=TRUE_COLOUR, markeredgewidth=1.4, zorder=4)


def _panel_title(index: int, belief: Floats) -> str:
    if index == 0:
        return "prior"
    name = "start" if index == 1 else f"step {index - 1}"
    if np.isnan(belief).any():
        return f"{name}: undefined (nan)"
    best = peak(belief)
    ties = f" (one of {len(best.cells)})" if len(best.cells) > 1 else ""
    entropy = normalized_entropy(belief)
    return f"{name}: {cell_name(best.cells[0])}{ties} p = {best.probability:.3f}, {entropy:.2f} bits"
