"""Beliefs over the lab, a panel a step."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from agent.offline.summary import cell_name, normalized_entropy, peak
from agent.views.figures.canvas import save_figure
from agent.views.figures.panelchoice import Choice, telling_blocks
from ciberrato import plot
from ciberrato.arrays import Floats
from ciberrato.plot.beliefs import CELL_TICKS, probability_scale
from ciberrato.plot.canvas import label_outer, new_figure, set_title, step_names
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import Lab


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
        File to write; the ending selects the format (png, svg, pdf).
    lab : Lab or None
        Whose walls to draw.
    true_cells : sequence of (row, column) or None
        Cell of the robot at each block (None for the prior).
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
        plot.cells(beliefs[block], axis, lab=lab, truth=truth, norm=norm)
        axis.set_title(_panel_title(names[block], beliefs[block]), fontsize=10)
    label_outer(axes, shown)
    bar = figure.colorbar(
        ScalarMappable(norm=norm, cmap="viridis"), ax=axes, shrink=0.9, fraction=0.03, pad=0.015
    )
    bar.set_label("probability of the cell")
    bar.set_ticks(CELL_TICKS)
    known = true_cells is not None and any(cell is not None for cell in true_cells)
    parts = [title, "red ring: true cell" if known else None]
    if any(parts) or choice.note:
        set_title(figure, "; ".join(part for part in parts if part), size=11, note=choice.note)
    save_figure(figure, Path(path))


def _panel_title(name: str, belief: Floats) -> str:
    if np.isnan(belief).any():
        return f"{name}: undefined (nan)"
    best = peak(belief)
    entropy = f"{normalized_entropy(belief):.2f} bits"
    if len(best.cells) == belief.size:
        return f"{name}: all cells, p = {best.probability:.3f}, {entropy}"
    ties = f" and {len(best.cells) - 1} more" if len(best.cells) > 1 else ""
    return f"{name}: {cell_name(best.cells[0])}{ties}, p = {best.probability:.3f}, {entropy}"
