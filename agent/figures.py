"""Figures of beliefs over the lab. matplotlib is loaded only here, and only when a figure is drawn."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.summary import Cell, cell_name, normalized_entropy, peak
from ciberrato.errors import UsageError
from ciberrato.lab import CELL_SIZE, Lab

Array = NDArray[np.float64]


def belief_panels(
    beliefs: Array,
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
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import PowerNorm
    from matplotlib.figure import Figure

    blocks, rows, columns = beliefs.shape
    across = min(blocks, 3 if columns <= 2 * rows else 2 if blocks <= 6 or columns > 20 else 3)
    down = math.ceil(blocks / across)
    panel_width = 4.6
    panel_height = panel_width * rows / columns + 0.45
    figure = Figure(figsize=(across * panel_width + 0.9, down * panel_height + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(down, across, squeeze=False)
    # A square-root scale keeps small masses visible beside a certain cell.
    norm = PowerNorm(gamma=0.5, vmin=0.0, vmax=1.0)
    for index, axis in enumerate(axes.flat):
        if index >= blocks:
            axis.set_axis_off()
            continue
        truth = true_cells[index] if true_cells is not None else None
        _panel(axis, beliefs[index], norm, lab, truth)
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


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure under a temporary name, then rename it.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : Path
        Its ending chooses the format.

    Raises
    ------
    UsageError
        If the format is unknown or the file cannot be written.
    """
    import io

    from agent.atomic import replace_file

    kind = path.suffix.lstrip(".").lower() or "png"
    known = figure.canvas.get_supported_filetypes()
    if kind not in known:
        raise UsageError(
            f"{path}: cannot write a figure of kind {kind!r}; use one of {', '.join(sorted(known))}"
        )
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=120)
    replace_file(path, buffer.getvalue())


def draw_walls(axis: Any, lab: Lab, *, colour: str = "white") -> None:
    """Draw the walls of a lab as filled polygons, lines on the floor thin and dotted, and the border.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        In units of the lab.
    lab : Lab
    colour : str
        Of walls; their edge is dark so that they show on any ground.
    """
    from matplotlib.patches import Polygon

    for wall in lab.walls:
        line = wall.height <= 0
        axis.add_patch(
            Polygon(
                wall.corners,
                closed=True,
                facecolor="none" if line else colour,
                edgecolor="0.6" if line else "black",
                linestyle=":" if line else "-",
                linewidth=0.5,
                zorder=2,
            )
        )
    axis.add_patch(
        Polygon(lab.border.corners, closed=True, facecolor="none", edgecolor="black", linewidth=1.2, zorder=2)
    )


def _panel(axis: Any, belief: Array, norm: Any, lab: Lab | None, truth: Cell | None) -> None:
    rows, columns = belief.shape
    width, height = columns * CELL_SIZE, rows * CELL_SIZE
    axis.set_facecolor("0.85")  # where there is no belief (nan)
    axis.imshow(
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
        row, column = truth
        centre = ((column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE)
        # Two rings, dark on light, show on every colour of the belief.
        axis.plot(*centre, "o", markersize=9, fillstyle="none", color="white", markeredgewidth=3, zorder=3)
        axis.plot(
            *centre, "o", markersize=9, fillstyle="none", color="#d62728", markeredgewidth=1.4, zorder=4
        )
    axis.set_xlim(0, width)
    axis.set_ylim(0, height)
    axis.set_aspect("equal")
    axis.set_xticks(np.arange(1, width, CELL_SIZE * max(1, columns // 7)))
    axis.set_yticks(np.arange(1, height, CELL_SIZE * max(1, rows // 4)))
    axis.tick_params(labelsize=7, length=2)


def _panel_title(index: int, belief: Array) -> str:
    if index == 0:
        return "prior"
    name = "start" if index == 1 else f"step {index - 1}"
    if np.isnan(belief).any():
        return f"{name}: undefined (nan)"
    best = peak(belief)
    ties = f" (one of {len(best.cells)})" if len(best.cells) > 1 else ""
    entropy = normalized_entropy(belief)
    return f"{name}: {cell_name(best.cells[0])}{ties} p = {best.probability:.3f}, {entropy:.2f} bits"
