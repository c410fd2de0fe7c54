"""Curves over a run: over its steps, and over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Floats
from ciberrato.bayes.summaries import entropy_bits
from ciberrato.plot.canvas import LINE_COLOURS, TRUE_COLOUR, add_legend, set_step_axis, start_axes
from ciberrato.world.coordinates import Cell

TIME_LABEL = "time (cycles)"


def series(
    times: ArrayLike,
    values: ArrayLike,
    ax: Any = None,
    *,
    name: str,
    labels: Sequence[str] = (),
    deviations: ArrayLike | None = None,
    colours: Sequence[str] = LINE_COLOURS,
    legend: bool | None = None,
) -> Any:
    """Draw values over time: readings, errors, entropy.

    Parameters
    ----------
    times : array_like, shape (n,)
        Cycles.
    values : array_like, shape (n,) or (n, k)
        One or several series; nan leaves a gap.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    name : str
        Of the values, with their unit: ``"entropy (bits)"``.
    labels : sequence of str
        Of the k series, for the legend.
    deviations : array_like of the shape of values, optional
        Standard deviations of errors around 0: a band of twice of them, around a line at 0.
    colours : sequence of str
    legend : bool, optional
        Whether to add a legend below, if there are labels; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    along, heights = np.asarray(times, np.float64), np.asarray(values, np.float64)
    if along.ndim != 1 or heights.ndim not in (1, 2) or len(heights) != len(along):
        raise ValueError(f"values: shape {heights.shape} for times of shape {along.shape}")
    columns = heights.reshape(len(along), -1).T if heights.ndim == 2 else heights[np.newaxis]
    if labels and len(labels) != len(columns):
        raise ValueError(f"labels: {len(labels)} for {len(columns)} series")
    ax, new = start_axes(ax, 7.0, 3.2)
    if deviations is not None:
        bands = np.asarray(deviations, np.float64).reshape(heights.shape)
        bands = bands.T if heights.ndim == 2 else bands[np.newaxis]
        for number, band in enumerate(bands):
            colour = colours[number % len(colours)]
            ax.fill_between(along, -2.0 * band, 2.0 * band, color=colour, alpha=0.2, lw=0)
    for number, column in enumerate(columns):
        label = labels[number] if labels else None
        ax.plot(along, column, color=colours[number % len(colours)], linewidth=1.0, label=label)
    if deviations is not None:
        ax.axhline(0.0, color="0.6", linewidth=0.6)
    ax.set_xlabel(TIME_LABEL)
    ax.set_ylabel(name, fontsize=9)
    ax.grid(color="0.93")
    if new if legend is None else legend:
        add_legend(ax)
    return ax


def probabilities(
    beliefs: Floats,
    ax: Any = None,
    *,
    truth: Sequence[Cell | None] | None = None,
    legend: bool | None = None,
) -> Any:
    """Draw the greatest probability over the steps of a belief file; that of the true cell where it is known.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
        The prior first. Blocks of nan leave a gap.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    truth : sequence of (row, column) or None
        Cell of the robot at each block (None for the prior).
    legend : bool, optional
        Whether to add a legend below; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax, new = start_axes(ax, 7.0, 3.2)
    steps = np.arange(len(beliefs)) - 1
    # The one below is wider: where both are the same, both are seen.
    greatest = [math.nan if np.isnan(belief).any() else float(belief.max()) for belief in beliefs]
    ax.plot(steps, greatest, "o-", color=LINE_COLOURS[0], markersize=8, lw=3.5, label="most likely cell")
    if truth is not None:
        right = [
            math.nan if cell is None else float(belief[cell])
            for belief, cell in zip(beliefs, truth, strict=True)
        ]
        ax.plot(steps, right, "s--", color=TRUE_COLOUR, markersize=4, label="true cell")
    ax.set_ylabel("probability")
    ax.set_ylim(-0.03, 1.03)
    return _finish_steps(ax, len(beliefs), new if legend is None else legend)


def entropies(beliefs: Floats, ax: Any = None, *, legend: bool | None = None) -> Any:
    """Draw the entropy over the steps of a belief file.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
        The prior first. Blocks of nan leave a gap.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    legend : bool, optional
        Whether to add a legend below; default: no.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax, _ = start_axes(ax, 7.0, 3.2)
    entropy = [math.nan if np.isnan(belief).any() else entropy_bits(belief) for belief in beliefs]
    steps = np.arange(len(beliefs)) - 1
    ax.plot(steps, entropy, "o-", color=LINE_COLOURS[2], markersize=4, label="entropy")
    ax.set_ylabel("entropy (bits)")
    ax.set_ylim(bottom=-0.1)
    return _finish_steps(ax, len(beliefs), bool(legend))


def _finish_steps(ax: Any, blocks: int, legend: bool) -> Any:
    set_step_axis(ax, blocks)
    ax.grid(color="0.9")
    if legend:
        add_legend(ax)
    return ax
