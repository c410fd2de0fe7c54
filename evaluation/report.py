"""Sums outcomes up: one table, a line for every group of runs, and figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.runner import Result

SMALL_ROOM = 12.0
"""Units squared: who starts in a closed room no larger may never learn which of its like it is."""

COLUMNS = (
    "runs",
    "half",
    "90%",
    "never%",
    "shut%",
    "wrong 1st%",
    "wrong time%",
    "place med",
    "place 95%",
    "turn med",
    "coll/1000",
    "restarts",
    "ms med",
    "ms 99%",
)


def group_by(results: Sequence[Result], *fields: str) -> dict[tuple[str, ...], list[Result]]:
    """Group results by fields of their tasks.

    Parameters
    ----------
    results : sequence of Result
    *fields : str
        Names of `Task`'s fields.

    Returns
    -------
    dict of tuple of str to list of Result
    """
    groups: dict[tuple[str, ...], list[Result]] = {}
    for result in results:
        key = tuple(_short(getattr(result.task, field), field) for field in fields)
        groups.setdefault(key, []).append(result)
    return groups


def _short(value: Any, field: str) -> str:
    if field == "lab" and "/" in str(value):
        path = Path(str(value))
        return f"{path.parent.name}/{path.stem}"
    if isinstance(value, bool):
        return field if value else f"no {field}"
    return str(value)


def summary(results: Sequence[Result]) -> dict[str, float]:
    """Compute the figures of a group of runs.

    Parameters
    ----------
    results : sequence of Result
        At least one.

    Returns
    -------
    dict of str to float
        By the names in `COLUMNS`. *half* and *90%*: cycles until so many of the runs had a right claim,
        infinite if they never had; *shut*: runs that began in a small closed room, part of *never*;
        *wrong 1st*: first claims that were wrong, of all first claims; *wrong time*: claims that were
        wrong, of all claims by cycle; *place*, *turn*: errors of the last estimate in units and degrees,
        of runs that ended with a claim; *coll*: beginnings of collisions.
    """
    outcomes = [result.outcome for result in results]
    times = np.array([math.inf if o.first_right is None else o.first_right for o in outcomes])
    claims = [o for o in outcomes if o.first_claim is not None]
    final = [o for o in outcomes if o.final_claim] or outcomes
    return {
        "runs": len(outcomes),
        "half": _quantile(times, 0.5),
        "90%": _quantile(times, 0.9),
        "never%": 100.0 * float(np.isinf(times).mean()),
        "shut%": 100.0 * float(np.mean([o.room <= SMALL_ROOM for o in outcomes])),
        "wrong 1st%": 100.0 * _share(sum(o.first_claim_wrong for o in claims), len(claims)),
        "wrong time%": 100.0 * _share(sum(o.wrongly for o in outcomes), sum(o.claimed for o in outcomes)),
        "place med": _quantile(np.array([o.final_place_error for o in final]), 0.5),
        "place 95%": _quantile(np.array([o.final_place_error for o in final]), 0.95),
        "turn med": _quantile(np.array([o.final_turn_error for o in final]), 0.5),
        "coll/1000": 1000.0 * _share(sum(o.collisions for o in outcomes), sum(o.cycles for o in outcomes)),
        "restarts": float(sum(len(o.restarts) for o in outcomes)),
        "ms med": float(np.median([o.filter_ms[0] + o.drive_ms[0] for o in outcomes])),
        "ms 99%": float(np.median([o.filter_ms[1] + o.drive_ms[1] for o in outcomes])),
    }


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 0.0


def _quantile(values: NDArray[np.float64], share: float) -> float:
    return float(np.quantile(values, share, method="higher"))


def kidnapping_line(results: Sequence[Result]) -> str | None:
    """Sum up the runs with a kidnapping in a line; None if there are none."""
    taken = [result.outcome for result in results if result.outcome.kidnapped is not None]
    if not taken:
        return None
    noticed = np.array([math.inf if o.noticed is None else o.noticed for o in taken])
    found = np.array([math.inf if o.found is None else o.found for o in taken])
    # What was never known cannot be noticed to have changed.
    return (
        f"kidnapped {len(taken)}: noticed after {_quantile(noticed, 0.5):g} (median), "
        f"{_quantile(noticed, 0.9):g} (90 %); found {np.isfinite(found).sum()}, after "
        f"{_quantile(found, 0.5):g} (median), {_quantile(found, 0.9):g} (90 %)"
    )


def table(groups: dict[tuple[str, ...], list[Result]]) -> str:
    """Lay the summaries of groups out in aligned columns."""
    rows = [["group", *COLUMNS]]
    for key, results in groups.items():
        figures = summary(results)
        rows.append([" ".join(key), *(_format(figures[name], name) for name in COLUMNS)])
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def _format(value: float, name: str) -> str:
    if math.isinf(value):
        return "never"
    if name in ("runs", "half", "90%", "restarts"):
        return f"{value:.0f}"
    return f"{value:.3f}" if name.startswith("place") else f"{value:.2f}"


def draw_figures(groups: dict[tuple[str, ...], list[Result]], folder: Path) -> list[Path]:
    """Draw time to localize, probability of the true pose, pose errors and calibration.

    Parameters
    ----------
    groups : dict
        As of `group_by`; one line a group.
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
    drawings: list[tuple[str, str, str, Callable[[Any, str, list[Result]], None]]] = [
        ("time_to_localize", "cycles", "share of the runs that know their pose", _draw_times),
        ("true_pose", "cycles", "mean probability of the true pose", _draw_truth),
        ("pose_error", "units", "share of the runs with a smaller final error", _draw_errors),
        ("calibration", "probability of the estimate", "share of cycles in which it is right", _draw_shares),
    ]
    written = []
    for name, x_label, y_label, draw in drawings:
        figure, axes = pyplot.subplots(figsize=(8.0, 5.0), layout="constrained")
        for key, results in groups.items():
            draw(axes, " ".join(key), results)
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        axes.set_ylim(0.0, 1.02)
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=120)
        pyplot.close(figure)
        written.append(path)
    return written


def _draw_times(axes: Any, label: str, results: list[Result]) -> None:
    times = sorted(r.outcome.first_right for r in results if r.outcome.first_right is not None)
    share = np.arange(1, len(times) + 1) / len(results)
    axes.step([0, *times], [0.0, *share], where="post", label=label)


def _draw_truth(axes: Any, label: str, results: list[Result]) -> None:
    length = min(len(result.outcome.truth) for result in results)
    mean = np.mean([result.outcome.truth[:length] for result in results], axis=0)
    axes.plot(10 * np.arange(length), mean, label=label)


def _draw_errors(axes: Any, label: str, results: list[Result]) -> None:
    errors = sorted(r.outcome.final_place_error for r in results if r.outcome.final_claim)
    axes.step(errors, np.arange(1, len(errors) + 1) / max(len(errors), 1), where="post", label=label)
    axes.set_xlim(0.0, 0.5)


def _draw_shares(axes: Any, label: str, results: list[Result]) -> None:
    counts = np.sum([result.outcome.calibration for result in results], axis=0)
    usable = counts[:, 0] >= 20
    middle = (np.arange(10) + 0.5) / 10.0
    axes.plot(middle[usable], counts[usable, 1] / counts[usable, 0], marker="o", label=label)
    axes.plot([0.0, 1.0], [0.0, 1.0], color="grey", linewidth=0.8)
