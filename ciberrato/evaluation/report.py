"""Sums outcomes up: one table, a line for every group of runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.evaluation.attempt import Result
from ciberrato.evaluation.task import LEAST_MS, MS_RATIO, MS_STEPS, SAID, Outcome
from ciberrato.plaintext import plain

WIDTH = 100
"""Characters of a table's lines."""
MOST_NAME = 40
"""Characters of the name of a lab, a drive or a filter that are shown."""
SMALL_ROOM = 12.0
"""Units squared: who starts in a closed room no larger may never learn which of its like it is."""

COLUMNS = (
    "runs",
    "half",
    "90%",
    "never%",
    "shut%",
    "open never%",
    "equal%",
    "wrong 1st%",
    "95% interval",
    "wrong time%",
    "place med",
    "place 95%",
    "turn med",
    "turn 95%",
    "coll/1000",
    "restarts",
    "ms med",
    "ms 99%",
)
_WHOLE = ("runs", "half", "90%", "restarts")


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
        Sorted; with no fields, all results are one group ``("all",)``. The keys are names to be shown: short,
        without unseen characters, and different where the values are.
    """
    names = [
        distinct_names({getattr(r.task, field) for r in results}, partial(_short, field=field))
        for field in fields
    ]
    groups: dict[tuple[str, ...], list[Result]] = {}
    for result in results:
        values = (getattr(result.task, field) for field in fields)
        key = tuple(known[value] for known, value in zip(names, values, strict=True)) or ("all",)
        groups.setdefault(key, []).append(result)
    return dict(sorted(groups.items()))


def distinct_names(values: Iterable[Any], short: Callable[[Any], str]) -> dict[Any, str]:
    """Name values, each differently: of those with one short name, all but the first get a number.

    Parameters
    ----------
    values : iterable
    short : callable
        Value to name.

    Returns
    -------
    dict of value to str
        In the order of the values as texts.
    """
    names: dict[Any, str] = {}
    for value in sorted(values, key=str):
        name, number = short(value), 1
        while name in names.values():
            number += 1
            name = f"{short(value)} #{number}"
        names[value] = name
    return names


def _short(value: Any, field: str) -> str:
    return plain(_words(value, field), MOST_NAME)


def _words(value: Any, field: str) -> str:
    if field == "lab" and "/" in str(value):
        path = Path(str(value))
        return f"{path.parent.name}/{path.stem}"
    if field == "parameters":
        return Path(str(value)).stem.removesuffix("_params")
    if isinstance(value, bool):
        return field if value else f"no {field}"
    if field == "prior":
        return "told nothing" if value == "anywhere" else f"told {value}"
    if field == "gps":
        return f"GPS {value}"
    if field == "settings":
        return str(value) or "as in the file"
    if field == "code":
        return f"code {value}" if value else "no own code"
    return str(value)


def summary(results: Sequence[Result]) -> dict[str, float | tuple[float, float]]:
    """Compute the figures of a group of runs.

    Parameters
    ----------
    results : sequence of Result
        At least one.

    Returns
    -------
    dict of str to float, or to a pair of them
        By the names in `COLUMNS`; not a number where there is nothing to count.

        *half*, *90%*: cycles until so many of the runs had a right claim, infinite if they never had.
        *never*: runs without one. *shut*: runs that began in a small closed room; *open never*: runs
        without a right claim among the others; *equal*: runs without one that found out in which of several
        equal poses the robot is, of which none can be told from the others.
        *wrong 1st*: first claims that were wrong, of all first claims, with the 95 % interval by Wilson's
        score (J. Am. Stat. Assoc. 22, 1927); *wrong time*: claims that were wrong, of all claims by cycle.
        *place*, *turn*: errors of the last estimate in units and degrees, of runs that ended with a claim.
        *coll*: beginnings of collisions. *ms*: processor time of a cycle.
    """
    outcomes = [result.outcome for result in results]
    times = times_to_localize(outcomes)
    shut = np.array([o.room <= SMALL_ROOM for o in outcomes])
    claims = [o for o in outcomes if o.first_claim is not None]
    wrong = sum(o.first_claim_wrong for o in claims)
    final = [o for o in outcomes if o.final_claim]
    place = np.array([o.final_place_error for o in final])
    turn = np.array([o.final_turn_error_deg for o in final])
    median_ms, slow_ms = _milliseconds(outcomes)
    return {
        "runs": len(outcomes),
        "half": quantile(times, 0.5),
        "90%": quantile(times, 0.9),
        "never%": 100.0 * float(np.isinf(times).mean()),
        "shut%": 100.0 * float(shut.mean()),
        "open never%": 100.0 * _share(int(np.isinf(times[~shut]).sum()), int((~shut).sum())),
        "equal%": 100.0
        * _share(sum(o.first_right is None and o.alike is not None for o in outcomes), len(outcomes)),
        "wrong 1st%": 100.0 * _share(wrong, len(claims)),
        "95% interval": wilson_interval(wrong, len(claims)),
        "wrong time%": 100.0 * _share(sum(o.wrongly for o in outcomes), sum(o.claimed for o in outcomes)),
        "place med": quantile(place, 0.5),
        "place 95%": quantile(place, 0.95),
        "turn med": quantile(turn, 0.5),
        "turn 95%": quantile(turn, 0.95),
        "coll/1000": 1000.0 * _share(sum(o.collisions for o in outcomes), sum(o.cycles for o in outcomes)),
        "restarts": float(sum(len(o.restarts) for o in outcomes)),
        "ms med": median_ms,
        "ms 99%": slow_ms,
    }


def times_to_localize(outcomes: Sequence[Outcome]) -> NDArray[np.float64]:
    """Return the cycle of the first right claim of each run, infinite where there was none."""
    return np.array([math.inf if o.first_right is None else o.first_right for o in outcomes])


def quantile(values: NDArray[np.float64], share: float) -> float:
    """Return a quantile, the higher of two values where it lies between them."""
    if not len(values):
        return math.nan
    return float(np.quantile(values, share, method="higher"))


def wilson_interval(hits: int, cases: int) -> tuple[float, float]:
    """Return the 95 % interval of a share by Wilson's score, in per cent."""
    if not cases:
        return math.nan, math.nan
    z = NormalDist().inv_cdf(0.975)
    share = hits / cases
    middle = share + z**2 / (2 * cases)
    half = z * math.sqrt(share * (1.0 - share) / cases + z**2 / (4 * cases**2))
    low, high = ((middle + side * half) / (1.0 + z**2 / cases) for side in (-1.0, 1.0))
    return 100.0 * max(low, 0.0), 100.0 * min(high, 1.0)


def _share(part: int, whole: int) -> float:
    return part / whole if whole else math.nan


def _milliseconds(outcomes: Sequence[Outcome]) -> tuple[float, float]:
    """Return median and 99 % quantile over all cycles, or the runs' medians where cycles were not counted."""
    if not all(o.ms_counts for o in outcomes):
        return (
            float(np.median([o.filter_ms[0] + o.drive_ms[0] for o in outcomes])),
            float(np.median([o.filter_ms[1] + o.drive_ms[1] for o in outcomes])),
        )
    below = np.cumsum(np.sum([o.ms_counts for o in outcomes], axis=0))
    steps = np.searchsorted(below, np.array([0.5, 0.99]) * below[-1])
    middles = LEAST_MS * MS_RATIO ** (np.minimum(steps, MS_STEPS - 1) + 0.5)
    return float(middles[0]), float(middles[1])


def kidnapping_line(results: Sequence[Result]) -> str | None:
    """Sum up the runs with a kidnapping in a line; None if there are none."""
    taken = [result.outcome for result in results if result.outcome.kidnapped is not None]
    if not taken:
        return None
    noticed = np.array([math.inf if o.noticed is None else o.noticed for o in taken])
    found = np.array([math.inf if o.found is None else o.found for o in taken])
    equal = [o for o in taken if o.equals]
    told = sum(o.found is not None or o.alike is not None for o in equal)
    # What was never known cannot be noticed to have changed.
    line = (
        f"kidnapped {len(taken)}: noticed after {quantile(noticed, 0.5):g} (median), "
        f"{quantile(noticed, 0.9):g} (90 %); found {np.isfinite(found).sum()}, after "
        f"{quantile(found, 0.5):g} (median), {quantile(found, 0.9):g} (90 %)"
    )
    if equal:
        line += (
            f"; of {len(equal)} in places with equal ones found {sum(o.found is not None for o in equal)}, "
            f"found up to the equal ones {told}"
        )
    return line


def said_table(results: Sequence[Result]) -> str:
    """Return how often estimates of some probability were right, as aligned columns.

    Parameters
    ----------
    results : sequence of Result

    Returns
    -------
    str
        A line for each class of `ciberrato.evaluation.task.SAID`: runs, each with its first estimate in the
        class; the mean of what these said, and the share that was right, in per cent, with the 95 % interval
        by Wilson's score; and whether that holds what was said.
    """
    rows = [["said", "runs", "mean%", "right%", "95% interval", ""]]
    for kind, (low, high) in enumerate(zip(SAID, (*SAID[1:], 1.0), strict=True)):
        said = [one for r in results if r.outcome.said and (one := r.outcome.said[kind]) is not None]
        right = sum(one[1] > 0.0 for one in said)
        mean = 100.0 * sum(one[0] for one in said) / len(said) if said else math.nan
        interval = wilson_interval(right, len(said))
        outside = "too bold" if mean > interval[1] else "too shy" if mean < interval[0] else ""
        figures = (mean, 100.0 * _share(right, len(said)))
        shown = ["-" if math.isnan(value) else f"{value:.1f}" for value in figures]
        rows.append([f"{low:g}-{high:g}", str(len(said)), *shown, _format(interval, ""), outside])
    return aligned(rows)


def table(groups: dict[tuple[str, ...], list[Result]]) -> str:
    """Return summaries of groups as aligned columns; what all groups have in common stands above."""
    keys = list(groups)
    differing = [len({key[part] for key in keys}) > 1 for part in range(len(keys[0]))] if keys else []
    common = [part for part, differs in zip(keys[0], differing, strict=True) if not differs] if keys else []
    rows = [["group", *COLUMNS]]
    for key, results in groups.items():
        figures = summary(results)
        shown = [part for part, differs in zip(key, differing, strict=True) if differs or len(keys) == 1]
        rows.append([" ".join(shown), *(_format(figures[name], name) for name in COLUMNS)])
    heading = f"all groups: {' '.join(common)}\n" if common and len(keys) > 1 else ""
    return heading + aligned(rows)


def aligned(rows: Sequence[Sequence[str]], width: int = WIDTH) -> str:
    """Return rows as aligned columns, the first to the left, the others to the right.

    Parameters
    ----------
    rows : sequence of sequence of str
        The heading is the first.
    width : int
        Greatest width; further columns follow below, with the first column again.

    Returns
    -------
    str
        Lines of at most `width` characters, unless two columns alone are wider.
    """
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    blocks: list[list[int]] = [[]]
    left = width - widths[0]
    for column in range(1, len(widths)):
        needed = widths[column] + 2
        if needed > left and blocks[-1]:
            blocks.append([])
            left = width - widths[0]
        blocks[-1].append(column)
        left -= needed
    return "\n\n".join(
        _laid_out([[row[column] for column in (0, *block)] for row in rows]) for block in blocks
    )


def _laid_out(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def _format(value: float | tuple[float, float], name: str) -> str:
    if isinstance(value, tuple):
        return "-" if math.isnan(value[0]) else f"{value[0]:.1f}-{value[1]:.1f}"
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "never"
    if name in _WHOLE:
        return f"{value:.0f}"
    return f"{value:.3f}" if name.startswith("place") else f"{value:.2f}"
