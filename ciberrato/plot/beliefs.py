"""Beliefs over the lab: over its cells, and over poses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Floats
from ciberrato.plot.canvas import TRUE_COLOUR, draw_walls, set_lab_axes, start_map
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab

CELL_TICKS = (0, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 1)
_ARROW = 0.6
"""Units."""


def cells(
    belief: ArrayLike,
    ax: Any = None,
    *,
    lab: Lab | None = None,
    truth: Cell | None = None,
    norm: Any = None,
    legend: bool | None = None,
) -> Any:
    """Draw a belief over cells, the walls over it, the true cell ringed.

    Parameters
    ----------
    belief : array_like, shape (rows, columns)
        Probabilities, row 0 the bottom row of the lab; nan is shown grey.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    lab : Lab, optional
        Whose walls to draw.
    truth : (row, column), optional
        Cell for a ring.
    norm : matplotlib.colors.Normalize, optional
        Scale of the colours; default: `probability_scale`, the same for all beliefs.
    legend : bool, optional
        Whether to add a colour bar; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        In units; its last image is that of the belief.
    """
    belief = np.asarray(belief, np.float64)
    if belief.ndim != 2:
        raise ValueError(f"belief: shape {belief.shape}; a belief over cells has (rows, columns)")
    rows, columns = belief.shape
    width, height = columns * CELL_SIZE, rows * CELL_SIZE
    ax, new = start_map(ax, width, height)
    ax.set_facecolor("0.85")  # where there is no belief (nan)
    ax.imshow(
        belief,
        origin="lower",
        extent=(0, width, 0, height),
        cmap="viridis",
        norm=probability_scale() if norm is None else norm,
        interpolation="nearest",
        zorder=1,
    )
    if lab is not None:
        draw_walls(ax, lab)
        width, height = max(width, lab.width), max(height, lab.height)
    if truth is not None:
        ring_cell(ax, truth)
    set_lab_axes(ax, width, height)
    if new if legend is None else legend:
        bar = ax.figure.colorbar(ax.images[-1], ax=ax, shrink=0.9, fraction=0.03, pad=0.015)
        bar.set_label("probability of the cell")
        if norm is None:
            bar.set_ticks(CELL_TICKS)
    return ax


def poses(
    poses: ArrayLike,
    weights: ArrayLike | None = None,
    ax: Any = None,
    *,
    lab: Lab | None = None,
    most: int = 1000,
    legend: bool | None = None,
) -> Any:
    """Draw a belief over poses as arrows: particles, the states of a lattice, or the modes of a belief.

    Of more poses than `most` so many are drawn from them, evenly along the cumulated weights (the low
    variance sampler, *Probabilistic Robotics*, table 4.4, with a fixed offset): they stand for the belief.

    Parameters
    ----------
    poses : array_like, shape (n, 3)
        x, y in units, heading in radians.
    weights : array_like, shape (n,), optional
        Not negative, of any sum; default: all alike.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    lab : Lab, optional
        Whose walls to draw.
    most : int
        Arrows, at most.
    legend : bool, optional
        Whether to add a colour bar, if weights differ; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        In units; limits are those of the lab, or those of the poses.
    """
    states = np.asarray(poses, np.float64)
    if states.ndim != 2 or states.shape[1] != 3:
        raise ValueError(f"poses: shape {states.shape}; poses have (n, 3): x, y, heading")
    masses = _masses(weights, len(states))
    states, masses = _drawn(states, masses, most)
    if lab is not None:
        low, high = np.zeros(2), np.array([lab.width, lab.height])
    elif len(states):
        low, high = states[:, :2].min(axis=0) - 1.0, states[:, :2].max(axis=0) + 1.0
    else:
        low, high = np.zeros(2), np.ones(2)
    ax, new = start_map(ax, *(high - low))
    if lab is not None:
        draw_walls(ax, lab, colour="0.7")
    order = np.argsort(masses, kind="stable")  # the likely ones on top
    x, y, heading = states[order].T
    top = float(masses.max(initial=0.0)) or 1.0
    arrows = ax.quiver(
        x,
        y,
        _ARROW * np.cos(heading),
        _ARROW * np.sin(heading),
        masses[order],
        cmap="viridis_r",
        norm=probability_scale(top),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.08,
        units="xy",
        zorder=5,
    )
    set_lab_axes(ax, high[0], high[1])
    if lab is None:
        ax.set_xlim(low[0], high[0])
        ax.set_ylim(low[1], high[1])
        ax.xaxis.set_major_locator(_plain_ticks())
        ax.yaxis.set_major_locator(_plain_ticks())
    if (new if legend is None else legend) and len(np.unique(masses)) > 1:
        bar = ax.figure.colorbar(arrows, ax=ax, shrink=0.9, fraction=0.03, pad=0.015)
        bar.set_label("probability of the pose")
    return ax


def probability_scale(most: float = 1.0) -> Any:
    """Create the colour scale of all beliefs: a square root keeps small masses visible beside a certain cell.

    Parameters
    ----------
    most : float
        The probability at its end.

    Returns
    -------
    matplotlib.colors.Normalize
    """
    from matplotlib.colors import PowerNorm

    return PowerNorm(gamma=0.5, vmin=0.0, vmax=most)


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


def _masses(weights: ArrayLike | None, size: int) -> Floats:
    masses = np.ones(size) if weights is None else np.asarray(weights, np.float64)
    if masses.shape != (size,):
        raise ValueError(f"weights: shape {masses.shape} for {size} poses")
    total = float(masses.sum())
    if size and not ((masses >= 0.0).all() and 0.0 < total < math.inf):
        raise ValueError("weights: they are finite, not negative, and not all zero")
    return masses / total if size else masses


def _drawn(states: Floats, masses: Floats, most: int) -> tuple[Floats, Floats]:
    """Return at most so many states, with the shares of the belief that they stand for."""
    if most < 1:
        raise ValueError(f"most: {most} arrows show nothing")
    if len(states) <= most:
        return states, masses
    wanted = (np.arange(most) + 0.5) / most
    places = np.minimum(np.searchsorted(np.cumsum(masses), wanted), len(states) - 1)
    chosen, counts = np.unique(places, return_counts=True)
    return states[chosen], counts / most


def _plain_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(7)
