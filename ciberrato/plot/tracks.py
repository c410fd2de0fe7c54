"""Plots of the tracks of robots."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Floats
from ciberrato.plot.canvas import (
    LINE_COLOURS,
    X_LABEL,
    Y_LABEL,
    add_legend,
    draw_walls,
    set_lab_axes,
    start_map,
)
from ciberrato.world.lab import Lab


def track(
    poses: ArrayLike,
    ax: Any = None,
    *,
    lab: Lab | None = None,
    label: str | None = None,
    colour: str = LINE_COLOURS[0],
    ends: bool = True,
    by_cycle: bool = False,
    legend: bool | None = None,
) -> Any:
    """Draw the path of a robot, with start and end.

    Parameters
    ----------
    poses : array_like, shape (n, 2) or (n, 3)
        x, y in units (a heading is passed over); nan leaves a gap.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure. Several tracks in one are drawn one after the other.
    lab : Lab, optional
        Whose walls to draw.
    label : str, optional
        For the legend.
    colour : str
    ends : bool
        Whether to name start and end.
    by_cycle : bool
        Whether the colour goes with the pose's number, from blue to yellow, in place of `colour` and `label`.
    legend : bool, optional
        Whether to add a legend below, if there is a label, or a colour bar; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        In units; limits are those of the lab, or those of all that is drawn.
    """
    places = np.asarray(poses, np.float64)
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise ValueError(f"poses: shape {places.shape}; a track has (n, 2) or (n, 3): x, y, heading")
    places = places[:, :2]
    known = places[np.isfinite(places).all(axis=1)]
    size = (10.0, 10.0) if not len(known) else np.ptp(known, axis=0) + 2.0
    ax, new = start_map(ax, *((lab.width, lab.height) if lab is not None else size))
    if lab is not None:
        draw_walls(ax, lab, colour="0.7")
    legend = new if legend is None else legend
    if by_cycle:
        _draw_by_cycle(ax, places, legend)
    else:
        ax.plot(*places.T, color=colour, linewidth=1.8, zorder=3, label=label)
    if len(known):
        ax.plot(*known[0], "o", color=colour, zorder=4)
    if ends and len(known):
        for name, place in (("start", known[0]), ("end", known[-1])):
            ax.annotate(name, place, xytext=(0, -16), textcoords="offset points", ha="center")
    if lab is not None:
        set_lab_axes(ax, lab.width, lab.height)
    elif ax.get_aspect() == "auto":  # else a map, whose limits stay
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel(X_LABEL)
        ax.set_ylabel(Y_LABEL)
    if legend:
        add_legend(ax)
    return ax


def _draw_by_cycle(ax: Any, places: Floats, bar: bool) -> None:
    from matplotlib.collections import LineCollection

    steps = np.stack([places[:-1], places[1:]], axis=1)
    known = np.isfinite(steps).all(axis=(1, 2))
    numbers = np.flatnonzero(known)
    track = LineCollection(list(steps[known]), array=numbers, cmap="viridis", linewidths=2.0, zorder=3)
    ax.add_collection(track)
    if bar and len(numbers):
        ax.figure.colorbar(track, ax=ax, label="cycle", shrink=0.6)
