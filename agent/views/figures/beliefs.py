"""Beliefs over the lab, a panel a step."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agent.offline.summary import cell_name, normalized_entropy, peak
from agent.views.figures.canvas import (
    TRUE_COLOUR,
    draw_walls,
    label_outer,
    new_figure,
    save_figure,
    set_lab_axes,
    set_title,
    step_names,
)
from agent.views.figures.panelchoice import Choice, telling_blocks
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
    every_step: bool = False,
) -> None:
    """Draw one panel a step: the belief, the walls over it, the true cell where it is known.

    A tail of steps that are all certain (and right, where the truth is known) is cut; a note says so.

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
    every_step : bool
        Cut nothing.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    from matplotlib.cm import ScalarMappable

    blocks, rows, columns = beliefs.shape
    choice = Choice(list(range(blocks)), "") if every_step else telling_blocks(beliefs, true_cells)
    shown = len(choice.blocks)
    across = min(shown, 3 if columns <= 2 * rows else 2 if shown <= 6 or columns > 20 else 3)
    down = math.ceil(shown / across)
    panel_width = 4.6
    panel_height = panel_width * rows / columns + 0.5
    figure = new_figure(across * panel_width + 1.2, down * panel_height + 0.9, layout="compressed")
    axes = figure.subplots(down, across, squeeze=False)
    norm = probability_scale()
    names = step_names(blocks)
    for axis in axes.flat[shown:]:
        axis.set_axis_off()
    for axis, block in zip(axes.flat, choice.blocks, strict=False):
        truth = true_cells[block] if true_cells is not None else None
        draw_belief(axis, beliefs[block], norm, lab, truth)
        axis.set_title(_panel_title(names[block], beliefs[block]), fontsize=10)
    label_outer(axes, shown)
    bar = figure.colorbar(
        ScalarMappable(norm=norm, cmap="viridis"), ax=axes, shrink=0.9, fraction=0.03, pad=0.015
    )
    bar.set_label("probability of the cell")
    bar.set_ticks([0, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 1])
    known = true_cells is not None and any(cell is not None for cell in true_cells)
    parts = [title, "red ring: true cell" if known else None]
    if any(parts) or choice.note:
        set_title(figure, "; ".join(part for part in parts if part), size=11, note=choice.note)
    save_figure(figure, Path(path))


def probability_scale() -> Any:
    """Create the colour scale of all beliefs: a square root keeps small masses visible beside a certain cell.

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


def ring_cell(axis: Any, cell: Cell) -> list[Any]:
    """Draw a ring around a cell's centre; white under red shows on every colour of the belief.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    cell : (row, column)

    Returns
    -------
    list of matplotlib artists
    """
    row, column = cell
    centre = ((column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE)
    return [
        *axis.plot(*centre, "o", ms=9, fillstyle="none", color="white", markeredgewidth=3, zorder=3),
        *axis.plot(*centre, "o", ms=9, fillstyle="none", color=TRUE_COLOUR, markeredgewidth=1.4, zorder=4),
    ]


def _panel_title(name: str, belief: Floats) -> str:
    if np.isnan(belief).any():
        return f"{name}: undefined (nan)"
    best = peak(belief)
    entropy = f"{normalized_entropy(belief):.2f} bits"
    if len(best.cells) == belief.size:
        return f"{name}: all cells, p = {best.probability:.3f}, {entropy}"
    ties = f" and {len(best.cells) - 1} more" if len(best.cells) > 1 else ""
    return f"{name}: {cell_name(best.cells[0])}{ties}, p = {best.probability:.3f}, {entropy}"
