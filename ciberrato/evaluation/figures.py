"""Draws what an evaluation found: a panel for every kind of run, a line for every drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ciberrato.evaluation.attempt import Result
from ciberrato.evaluation.report import group_by, times_to_localize
from ciberrato.evaluation.task import TRUTH_PERIOD

# By Okabe and Ito, to be distinguished by the colour-blind; with line styles, to be distinguished in print.
_STYLES = (
    ("#0072B2", "-", "o"),
    ("#D55E00", "--", "s"),
    ("#009E73", "-.", "^"),
    ("#CC79A7", ":", "D"),
    ("#E69F00", (0, (5, 1)), "v"),
    ("#56B4E9", (0, (3, 1, 1, 1)), "P"),
)
_MOST_COLUMNS = 4
_MOST_PANELS = 16
_LEAST_RUNS = 5
"""Runs that a point of the calibration stands for, at least."""

Draw = Callable[[Any, str, list[Result], dict[str, Any]], None]


class _Figure(NamedTuple):
    name: str
    title: str
    x_label: str
    y_label: str
    draw: Draw


def draw_figures(results: Sequence[Result], fields: Sequence[str], folder: Path) -> list[Path]:
    """Draw time to localize, probability of the true pose, pose errors, calibration and collisions.

    Parameters
    ----------
    results : sequence of Result
    fields : sequence of str
        What makes a group: names of `Task`'s fields. If the drive is one of them, it makes the lines, and
        the others make the panels, if those are not too many.
    folder : Path
        Made if need be.

    Returns
    -------
    list of Path
        The files written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    folder.mkdir(parents=True, exist_ok=True)
    panels, lines = _panels(results, fields)
    written = []
    for wanted in _FIGURES:
        columns = min(len(panels), _MOST_COLUMNS)
        rows = math.ceil(len(panels) / columns)
        single = len(panels) == 1
        figure, grid = pyplot.subplots(
            rows,
            columns,
            figsize=(7.5, 5.0) if single else (3.4 * columns + 0.6, 2.7 * rows + 1.2),
            sharex=True,
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        for axes, (name, groups) in zip(grid.flat, panels.items(), strict=False):
            for line, group in groups.items():
                colour, dashes, marker = _STYLES[lines.index(line) % len(_STYLES)]
                wanted.draw(axes, line, group, {"color": colour, "linestyle": dashes, "marker": marker})
            axes.set_title(name, fontsize="medium")
            axes.grid(alpha=0.3)
        for number, axes in enumerate(grid.flat):
            axes.set_visible(number < len(panels))
            if number + columns >= len(panels):  # nothing below
                axes.set_xlabel(wanted.x_label)
                axes.xaxis.set_tick_params(labelbottom=True)
        figure.suptitle(f"{wanted.title} ({len(results)} runs)")
        figure.supylabel(wanted.y_label)
        handles, labels = _legend(grid)
        if labels:
            figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 6))
        path = folder / f"{wanted.name}.png"
        figure.savefig(path, dpi=120)
        pyplot.close(figure)
        written.append(path)
    return written


def _panels(
    results: Sequence[Result], fields: Sequence[str]
) -> tuple[dict[str, dict[str, list[Result]]], list[str]]:
    """Sort results into panels, and each panel's into lines; with the names of all lines."""
    others = [field for field in fields if field != "drive"]
    if "drive" not in fields or len(group_by(results, *others)) > _MOST_PANELS:
        groups = {" ".join(key): group for key, group in group_by(results, *fields).items()}
        return {"": groups}, list(groups)
    panels = {
        " ".join(key) if others else "": {line: group for (line,), group in group_by(panel, "drive").items()}
        for key, panel in group_by(results, *others).items()
    }
    return panels, sorted({line for groups in panels.values() for line in groups})


def _legend(grid: Any) -> tuple[list[Any], list[str]]:
    found: dict[str, Any] = {}
    for axes in grid.flat:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    names = sorted(found)
    return [found[name] for name in names], names


def _draw_times(axes: Any, label: str, results: list[Result], style: dict[str, Any]) -> None:
    times = times_to_localize([result.outcome for result in results])
    known = np.sort(times[np.isfinite(times)])
    longest = max(result.task.cycles for result in results)
    share = np.arange(len(known) + 1) / len(results)
    axes.step(
        [0.0, *known, longest],
        [*share, share[-1]],
        where="post",
        label=label,
        color=style["color"],
        linestyle=style["linestyle"],
    )
    for level in (0.5, 0.9):
        axes.axhline(level, color="grey", linewidth=0.6, linestyle=":")
    _scale_cycles(axes, longest)


def _scale_cycles(axes: Any, longest: int) -> None:
    axes.set_xscale("symlog", linthresh=10.0)
    ticks = [tick for tick in (0, 10, 30, 100, 300, 1000, 3000) if tick < 0.7 * longest] + [longest]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(0.0, longest)
    axes.set_ylim(0.0, 1.02)


def _draw_truth(axes: Any, label: str, results: list[Result], style: dict[str, Any]) -> None:
    # A run that ended early did so as nothing more was to happen.
    longest = max(result.task.cycles for result in results)
    length = longest // TRUTH_PERIOD + 1
    truths = [r.outcome.truth for r in results if r.outcome.truth]
    if not truths:  # a filter that others wrote need not say
        return
    held = [[*truth, *[truth[-1]] * (length - len(truth))] for truth in truths]
    axes.plot(
        TRUTH_PERIOD * np.arange(length),
        np.mean(held, axis=0),
        label=label,
        color=style["color"],
        linestyle=style["linestyle"],
    )
    _scale_cycles(axes, longest)


def _draw_errors(axes: Any, label: str, results: list[Result], style: dict[str, Any]) -> None:
    errors = np.sort([r.outcome.final_place_error for r in results if r.outcome.final_claim])
    if not len(errors):
        return
    share = np.arange(len(errors) + 1) / len(errors)
    axes.step(
        [0.0, *np.minimum(errors, 1.0)],
        share,
        where="post",
        label=label,
        color=style["color"],
        linestyle=style["linestyle"],
    )
    axes.axhline(0.95, color="grey", linewidth=0.6, linestyle=":")
    axes.set_xlim(0.0, 0.3)
    axes.set_ylim(0.0, 1.02)


def _draw_shares(axes: Any, label: str, results: list[Result], style: dict[str, Any]) -> None:
    # Every run counts once in a range: the cycles of a run are not independent of one another.
    counts = np.array([result.outcome.calibration for result in results], np.float64)
    having = counts[:, :, 0] > 0.0
    shares = np.where(having, counts[:, :, 1] / np.maximum(counts[:, :, 0], 1.0), 0.0)
    usable = having.sum(axis=0) >= _LEAST_RUNS
    middle = (np.arange(10) + 0.5) / 10.0
    mean = shares.sum(axis=0)[usable] / having.sum(axis=0)[usable]
    axes.plot([0.0, 1.0], [0.0, 1.0], color="grey", linewidth=0.8)
    axes.plot(middle[usable], mean, label=label, markersize=5, **style)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.02)


def _draw_collisions(axes: Any, label: str, results: list[Result], style: dict[str, Any]) -> None:
    cycles = sum(result.outcome.cycles for result in results)
    rate = 1000.0 * sum(result.outcome.collisions for result in results) / max(cycles, 1)
    bars = axes.bar(label, rate, color=style["color"])
    axes.bar_label(bars, [f"{rate:.2f}"], padding=2, fontsize="small")
    axes.margins(y=0.15)
    axes.set_ylim(bottom=0.0)


_FIGURES = (
    _Figure(
        "time_to_localize",
        "Time to localize: right, with a probability above 0.95",
        "cycles since the start",
        "share of the runs",
        _draw_times,
    ),
    _Figure(
        "true_pose",
        "Probability of the true pose (within 0.5 units and 10°)",
        "cycles since the start",
        "mean over the runs",
        _draw_truth,
    ),
    _Figure(
        "pose_error",
        "Error of the place at the end, where the robot claims to know it",
        "error of the place (units)",
        "share of the runs with a smaller one",
        _draw_errors,
    ),
    _Figure(
        "calibration",
        "Calibration: how often an estimate of that probability is right",
        "probability of the estimate",
        "share in which it is right, mean over the runs",
        _draw_shares,
    ),
    _Figure(
        "collisions",
        "Collisions",
        "kind of run",
        "beginnings of collisions in 1000 cycles",
        _draw_collisions,
    ),
)
