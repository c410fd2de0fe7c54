"""What all figures share: the canvas, how it is saved, and the walls of a lab.

matplotlib is loaded inside the functions, as it takes a second.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file
from ciberrato.world.lab import CELL_SIZE, Lab

TRUE_COLOUR = "#d62728"
"""Of what is true and was not known to the filter."""

# Okabe and Ito's colours, told apart by colour-blind readers too.
LINE_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")


def new_figure(width: float, height: float) -> Any:
    """Make an empty figure that needs no screen.

    Parameters
    ----------
    width, height : float
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


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
    from matplotlib.collections import PolyCollection

    solid = [wall.corners for wall in lab.walls if wall.height > 0]
    lines = [wall.corners for wall in lab.walls if wall.height <= 0]
    border = [lab.border.corners]
    for polygons, face, edge, style, width in (
        (lines, "none", "0.6", ":", 0.5),
        (solid, colour, "black", "-", 0.5),
        (border, "none", "black", "-", 1.2),
    ):
        axis.add_collection(
            PolyCollection(
                polygons, facecolors=face, edgecolors=edge, linestyles=style, linewidths=width, zorder=2
            )
        )


def set_lab_axes(axis: Any, width: float, height: float) -> None:
    """Scale an axis to a lab, its ticks at cell centres.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    width, height : float
        Units.
    """
    axis.set_xlim(0, width)
    axis.set_ylim(0, height)
    axis.set_aspect("equal")
    axis.set_xticks(_ticks(width, 7))
    axis.set_yticks(_ticks(height, 4))
    axis.tick_params(labelsize=7, length=2)


def _ticks(length: float, most: int) -> list[float]:
    cells = int(length // CELL_SIZE)
    return [(cell + 0.5) * CELL_SIZE for cell in range(0, cells, max(1, cells // most))]
