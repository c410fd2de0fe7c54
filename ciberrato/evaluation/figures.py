"""Draws what an evaluation found: a panel for every kind of run, a line for every drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ciberrato import plot
from ciberrato.evaluation.attempt import Result
from ciberrato.evaluation.report import MOST_NAME, distinct_names, group_by, times_to_localize
from ciberrato.evaluation.task import TRUTH_PERIOD
from ciberrato.plaintext import plain
from ciberrato.plot.canvas import legend_text, set_title

_MOST_COLUMNS = 4
_MOST_PANELS = 16

Draw = Callable[[Any, str, list[Result], int], None]


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
        Fields of `Task` by which runs are grouped. If the drive is one of them, it makes the lines, and
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
    labels = distinct_names(lines, legend_text)
    titles = distinct_names(panels, lambda name: plain(name, MOST_NAME))
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
                wanted.draw(axes, labels[line], group, lines.index(line))
            set_title(axes, titles[name], size="medium")
            axes.grid(alpha=0.3)
        for number, axes in enumerate(grid.flat):
            axes.set_visible(number < len(panels))
            axes.set(xlabel="", ylabel="")
            if number + columns >= len(panels):  # nothing below
                axes.set_xlabel(wanted.x_label)
                axes.xaxis.set_tick_params(labelbottom=True)
        figure.suptitle(f"{wanted.title} ({len(results)} runs)")
        figure.supylabel(wanted.y_label)
        handles, shown = _legend(grid)
        if shown:
            figure.legend(handles, shown, loc="outside lower center", ncols=min(len(shown), 6))
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
    panels: dict[str, dict[str, list[Result]]] = {}
    for (line, *key), group in group_by(results, "drive", *others).items():
        panels.setdefault(" ".join(key), {})[line] = group
    panels = dict(sorted(panels.items()))
    return panels, sorted({line for groups in panels.values() for line in groups})


def _legend(grid: Any) -> tuple[list[Any], list[str]]:
    found: dict[str, Any] = {}
    for axes in grid.flat:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    names = sorted(found)
    return [found[name] for name in names], names


def _draw_times(axes: Any, label: str, results: list[Result], style: int) -> None:
    times = times_to_localize([result.outcome for result in results])
    plot.times_to_localize(times, _longest(results), axes, label=label, style=style)


def _draw_truth(axes: Any, label: str, results: list[Result], style: int) -> None:
    # A run that ended early did so as nothing more was to happen.
    truths = [result.outcome.truth for result in results]
    plot.truth_probabilities(truths, _longest(results), TRUTH_PERIOD, axes, label=label, style=style)


def _draw_errors(axes: Any, label: str, results: list[Result], style: int) -> None:
    errors = [result.outcome.final_place_error for result in results if result.outcome.final_claim]
    plot.place_errors(errors, axes, label=label, style=style)


def _draw_shares(axes: Any, label: str, results: list[Result], style: int) -> None:
    plot.calibration([result.outcome.calibration for result in results], axes, label=label, style=style)


def _draw_collisions(axes: Any, label: str, results: list[Result], style: int) -> None:
    cycles = sum(result.outcome.cycles for result in results)
    rate = 1000.0 * sum(result.outcome.collisions for result in results) / max(cycles, 1)
    plot.collisions(rate, axes, label=label, style=style)


def _longest(results: list[Result]) -> int:
    return max(result.task.cycles for result in results)


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
