"""Parts that all figures share: the canvas, colours, titles, and the walls of a lab.

matplotlib is loaded inside the functions, as it takes a second.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from ciberrato.plaintext import plain
from ciberrato.world.lab import CELL_SIZE, Lab

TRUE_COLOUR = "#d62728"
"""Of what is true and was not known to the filter."""

# Okabe and Ito's colours, told apart by colour-blind readers too.
LINE_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")


Layout = Literal["constrained", "compressed"]

X_LABEL, Y_LABEL = "x (units)", "y (units)"
LABEL_SIZE = 9
_MOST_TITLE, _MOST_LABEL = 100, 60


def new_figure(width: float, height: float, *, layout: Layout = "constrained") -> Any:
    """Create an empty figure that needs no screen.

    Parameters
    ----------
    width, height : float
        Inches.
    layout : {"constrained", "compressed"}
        The latter for maps, whose shape is fixed: no gaps between them.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


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


def set_title(target: Any, text: str, *, size: float | str = 10.0, note: str = "") -> None:
    """Set the title of an axis or a figure; it may hold names of others.

    Parameters
    ----------
    target : matplotlib.axes.Axes or matplotlib.figure.FigureBase
    text : str
        A dollar in it begins no formula, control characters are shown as a sign, and it is cut when long.
    size : float or str
        Points, or one of matplotlib's words.
    note : str
        A second line, of ours.
    """
    write = target.suptitle if hasattr(target, "suptitle") else target.set_title
    lines = [line for line in (plain(text, _MOST_TITLE), note) if line]
    write("\n".join(lines), fontsize=size, parse_math=False)


def legend_text(name: str) -> str:
    """Return a name of others as the label of a line: no formula, not hidden for its first character.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
        Cut when long, without unseen characters.
    """
    text = plain(name, _MOST_LABEL).replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text  # matplotlib leaves labels with _ out of legends


def step_names(blocks: int) -> list[str]:
    """Name the blocks of a belief file, each once: the prior, then the steps from 0, the start cell."""
    return ["prior", *(f"step {step}" for step in range(blocks - 1))]


def set_step_axis(axis: Any, blocks: int) -> None:
    """Label an axis whose places are those of `step_names`, from -1.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    blocks : int
    """
    stride = max(1, math.ceil((blocks - 1) / 16))
    steps = list(range(0, blocks - 1, stride))
    axis.set_xticks([-1, *steps], ["prior", *map(str, steps)])
    axis.set_xlabel("step (0: start cell)")


def set_lab_axes(axis: Any, width: float, height: float) -> None:
    """Scale an axis to a lab, its ticks at cell centres, with names and units.

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
    axis.tick_params(labelsize=8, length=2)
    axis.set_xlabel(X_LABEL, fontsize=LABEL_SIZE)
    axis.set_ylabel(Y_LABEL, fontsize=LABEL_SIZE)


def label_outer(axes: Any, shown: int) -> None:
    """Keep names and numbers at the outer panels only.

    Parameters
    ----------
    axes : array of matplotlib axes, shape (rows, columns)
    shown : int
        Number of them that have a picture, row by row.
    """
    across = axes.shape[1]
    for index, axis in enumerate(axes.flat):
        if index + across < shown:
            axis.tick_params(labelbottom=False)
            axis.set_xlabel("")
        if index % across:
            axis.tick_params(labelleft=False)
            axis.set_ylabel("")


def _ticks(length: float, most: int) -> list[float]:
    cells = int(length // CELL_SIZE)
    return [(cell + 0.5) * CELL_SIZE for cell in range(0, cells, max(1, cells // most))]


def start_axes(ax: Any, width: float = 7.0, height: float = 4.0) -> tuple[Any, bool]:
    """Return the axes to draw in, and whether they are new: then legends and colour bars belong to them.

    Parameters
    ----------
    ax : matplotlib.axes.Axes or None
        None: those of a new figure of pyplot, which notebooks show by themselves.
    width, height : float
        Inches, of a new figure.
    """
    if ax is not None:
        if not hasattr(ax, "add_patch"):
            raise TypeError(f"ax: {ax!r:.60} is not an Axes of matplotlib")
        return ax, False
    from matplotlib import pyplot

    _, axes = pyplot.subplots(figsize=(width, height), layout="constrained")
    return axes, True


def start_map(ax: Any, width: float, height: float) -> tuple[Any, bool]:
    """Return axes as `start_axes` does, a new figure having the shape of a map of so many units."""
    inches = 7.5
    return start_axes(ax, inches, min(max(inches * height / max(width, 1e-9), 1.5), 12.0) + 0.7)


def add_legend(ax: Any) -> None:
    """Draw a legend below the axes, beside the data."""
    if ax.get_legend_handles_labels()[1]:
        ax.figure.legend(loc="outside lower center", ncols=2, fontsize=LABEL_SIZE)
