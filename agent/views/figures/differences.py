"""Two belief files against each other."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from agent.offline.comparison import Comparison
from agent.views.figures.canvas import save_figure
from agent.views.figures.panelchoice import without_tail
from ciberrato.plaintext import plain
from ciberrato.plot.canvas import (
    LINE_COLOURS,
    draw_walls,
    label_outer,
    new_figure,
    set_lab_axes,
    set_step_axis,
    set_title,
    step_names,
)
from ciberrato.world.lab import CELL_SIZE, Lab

_NOTHING = 0.0005
"""A difference that three decimals do not show."""


def difference_panels(
    comparison: Comparison,
    path: str | os.PathLike[str],
    *,
    lab: Lab | None = None,
    names: tuple[str, str] = ("first", "second"),
) -> None:
    """Draw where two runs differ, a panel a step, and how far apart they are over the steps.

    A tail of steps without a difference is cut; a note says so.

    Parameters
    ----------
    comparison : Comparison
    path : path-like
        The ending chooses the format.
    lab : Lab or None
        Whose walls to draw.
    names : (str, str)
        Of the first and the second file.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import SymLogNorm

    first, second = (plain(name, 32) for name in names)
    blocks, rows, columns = comparison.differences.shape
    same = [bool(greatest < _NOTHING) for greatest in comparison.greatest]
    choice = without_tail(same, f"no difference of {_NOTHING} or more")
    shown = len(choice.blocks)
    across = min(shown, 3 if columns <= 2 * rows else 2)
    down = math.ceil(shown / across)
    height = 4.6 * rows / columns + 0.5
    figure = new_figure(across * 4.6 + 1.4, down * height + 4.0)
    maps, curve = figure.subfigures(2, 1, height_ratios=(down * height + 1.0, 3.0))
    axes = maps.subplots(down, across, squeeze=False)
    # Linear around 0, logarithmic beyond: a difference of 0.001 shows beside one of 1.
    norm = SymLogNorm(linthresh=0.005, vmin=-1.0, vmax=1.0)
    extent = (0, columns * CELL_SIZE, 0, rows * CELL_SIZE)
    for axis in axes.flat[shown:]:
        axis.set_axis_off()
    for axis, block in zip(axes.flat, choice.blocks, strict=False):
        axis.set_facecolor("0.85")
        axis.imshow(comparison.differences[block], origin="lower", extent=extent, cmap="PuOr", norm=norm)
        if lab is not None:
            draw_walls(axis, lab, colour="0.3")
        set_lab_axes(axis, columns * CELL_SIZE, rows * CELL_SIZE)
        greatest = comparison.greatest[block]
        said = "undefined" if math.isnan(greatest) else f"greatest difference {greatest:.3f}"
        axis.set_title(f"{step_names(blocks)[block]}: {said}", fontsize=10)
    label_outer(axes, shown)
    bar = maps.colorbar(ScalarMappable(norm=norm, cmap="PuOr"), ax=axes, shrink=0.9, fraction=0.03, pad=0.015)
    bar.set_label("difference in probability")
    ticks = [-1, -0.1, -0.01, 0, 0.01, 0.1, 1]
    bar.set_ticks(ticks, labels=[f"{tick:+g}" if tick else "0" for tick in ticks])
    bar.minorticks_off()
    title = f"{second} minus {first}: purple where {second} has more, orange where {first} has"
    set_title(maps, title, size=11, note=choice.note)
    axis = curve.subplots()
    steps = np.arange(blocks) - 1
    axis.plot(steps, comparison.divergence, "o-", color=LINE_COLOURS[0], markersize=4)
    axis.set_ylim(bottom=min(0.0, -0.03 * np.nanmax([*comparison.divergence, 0.01])))
    set_step_axis(axis, blocks)
    axis.set_ylabel("Jensen-Shannon\ndivergence (bits)", fontsize=9)
    axis.grid(color="0.9")
    save_figure(figure, Path(path))
