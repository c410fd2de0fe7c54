"""Plots of an evaluation: a line for each group of runs, drawn into the same axes one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.plot.canvas import start_axes

# By Okabe and Ito, to be told apart by the colour-blind; with line styles, to be told apart in print.
STYLES: tuple[tuple[str, Any, str], ...] = (
    ("#0072B2", "-", "o"),
    ("#D55E00", "--", "s"),
    ("#009E73", "-.", "^"),
    ("#CC79A7", ":", "D"),
    ("#E69F00", (0, (5, 1)), "v"),
    ("#56B4E9", (0, (3, 1, 1, 1)), "P"),
)
"""Colour, line and marker; the first group of runs in some axes gets the first."""
LEAST_RUNS = 5
"""Runs that a point of the calibration stands for, at least."""


def times_to_localize(
    times: ArrayLike, cycles: int, ax: Any = None, *, label: str = "", style: int | None = None
) -> Any:
    """Draw in which share of some runs the robot knew its pose by when.

    Parameters
    ----------
    times : array_like, shape (runs,)
        Cycles until the first right claim: the column ``first_right`` of
        `ciberrato.evaluation.read_results`; nan or inf = never.
    cycles : int
        Length of the runs.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    label : str
        Name of the runs, for the legend.
    style : int, optional
        Index in `STYLES`; default: the next in these axes.

    Returns
    -------
    matplotlib.axes.Axes
    """
    found = np.asarray(times, np.float64)
    known = np.sort(found[np.isfinite(found)])
    share = np.arange(len(known) + 1) / max(len(found), 1)
    ax, _ = start_axes(ax)
    _steps(ax, [0.0, *known, cycles], [*share, share[-1]], label, style)
    for level in (0.5, 0.9):
        ax.axhline(level, color="grey", linewidth=0.6, linestyle=":")
    _scale_cycles(ax, cycles)
    return _name(ax, "cycles since the start", "share of the runs")


def truth_probabilities(
    truths: Sequence[Sequence[float]],
    cycles: int,
    period: int,
    ax: Any = None,
    *,
    label: str = "",
    style: int | None = None,
) -> Any:
    """Draw the mean probability of the true pose over time. A run that ended early keeps its last one.

    Parameters
    ----------
    truths : sequence of sequence of float
        Of each run, every `period` cycles: `truth` of the evaluation's outcomes. Runs without are left out.
    cycles, period : int
    ax, label, style
        As in `times_to_localize`.

    Returns
    -------
    matplotlib.axes.Axes
    """
    length = cycles // period + 1
    known = [truth for truth in truths if truth]
    ax, _ = start_axes(ax)
    if known:  # a filter that others wrote need not say
        held = [[*truth, *[truth[-1]] * (length - len(truth))] for truth in known]
        colour, dashes, _ = _style(ax, style)
        ax.plot(
            period * np.arange(length), np.mean(held, axis=0), label=label, color=colour, linestyle=dashes
        )
    _scale_cycles(ax, cycles)
    return _name(ax, "cycles since the start", "mean probability of the true pose")


def place_errors(errors: ArrayLike, ax: Any = None, *, label: str = "", style: int | None = None) -> Any:
    """Draw which share of the runs had a smaller error of the place.

    Parameters
    ----------
    errors : array_like, shape (runs,)
        Units: the column ``final_place_error`` of the runs with ``final_claim``.
    ax, label, style
        As in `times_to_localize`.

    Returns
    -------
    matplotlib.axes.Axes
        From 0 to 0.3 units.
    """
    known = np.sort(np.asarray(errors, np.float64))
    ax, _ = start_axes(ax)
    if len(known):
        share = np.arange(len(known) + 1) / len(known)
        _steps(ax, [0.0, *np.minimum(known, 1.0)], share, label, style)
    ax.axhline(0.95, color="grey", linewidth=0.6, linestyle=":")
    ax.set_xlim(0.0, 0.3)
    ax.set_ylim(0.0, 1.02)
    return _name(ax, "error of the place (units)", "share of the runs with a smaller one")


def calibration(counts: ArrayLike, ax: Any = None, *, label: str = "", style: int | None = None) -> Any:
    """Draw how often an estimate of some probability is right, beside the diagonal of perfect honesty.

    Parameters
    ----------
    counts : array_like, shape (runs, 10, 2)
        For ten equal ranges of probability: cycles in which the estimate had it, and those in which it was
        right: the columns ``claims_*`` and ``right_*``. Every run counts once in a range, as the cycles of a
        run are not independent of one another; ranges with less than `LEAST_RUNS` runs have no point.
    ax, label, style
        As in `times_to_localize`.

    Returns
    -------
    matplotlib.axes.Axes
    """
    numbers = np.asarray(counts, np.float64)
    having = numbers[:, :, 0] > 0.0
    shares = np.where(having, numbers[:, :, 1] / np.maximum(numbers[:, :, 0], 1.0), 0.0)
    usable = having.sum(axis=0) >= LEAST_RUNS
    middle = (np.arange(10) + 0.5) / 10.0
    mean = shares.sum(axis=0)[usable] / having.sum(axis=0)[usable]
    ax, _ = start_axes(ax)
    colour, dashes, marker = _style(ax, style)
    ax.plot([0.0, 1.0], [0.0, 1.0], color="grey", linewidth=0.8)
    ax.plot(middle[usable], mean, label=label, markersize=5, color=colour, linestyle=dashes, marker=marker)
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(0.0, 1.02)
    return _name(ax, "probability of the estimate", "share in which it is right, mean over the runs")


def collisions(rate: float, ax: Any = None, *, label: str = "", style: int | None = None) -> Any:
    """Draw a bar: how many collisions began in 1000 cycles.

    Parameters
    ----------
    rate : float
        ``1000 * collisions.sum() / cycles.sum()``.
    ax, label, style
        As in `times_to_localize`.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax, _ = start_axes(ax)
    bars = ax.bar(label, rate, color=_style(ax, style)[0])
    ax.bar_label(bars, [f"{rate:.2f}"], padding=2, fontsize="small")
    ax.margins(y=0.15)
    ax.set_ylim(bottom=0.0)
    return _name(ax, "kind of run", "beginnings of collisions in 1000 cycles")


def _style(ax: Any, wanted: int | None) -> tuple[str, Any, str]:
    number = len(ax.get_legend_handles_labels()[1]) + len(ax.containers) if wanted is None else wanted
    return STYLES[number % len(STYLES)]


def _steps(ax: Any, along: Any, share: Any, label: str, wanted: int | None) -> None:
    colour, dashes, _ = _style(ax, wanted)
    ax.step(along, share, where="post", label=label, color=colour, linestyle=dashes)


def _scale_cycles(ax: Any, cycles: int) -> None:
    ax.set_xscale("symlog", linthresh=10.0)
    ticks = [tick for tick in (0, 10, 30, 100, 300, 1000, 3000) if tick < 0.7 * cycles] + [cycles]
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.minorticks_off()
    ax.set_xlim(0.0, cycles)
    ax.set_ylim(0.0, 1.02)


def _name(ax: Any, across: str, up: str) -> Any:
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    return ax
