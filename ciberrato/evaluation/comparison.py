"""Compares two drives by groups of runs: whether the one is faster where the other is slow.

Whole groups are compared, not single runs: who picks out the runs in which one drive was slow finds the other
one faster even if both are the same. Groups that are slow by chance regress to the mean as well; so the
slow groups are also picked by one half of the seeds and compared by the other half.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.evaluation.attempt import Result
from ciberrato.evaluation.report import MOST_NAME, aligned, group_by, quantile, times_to_localize
from ciberrato.plaintext import plain

SLOW_HALF, SLOW_MOST = 60.0, 150.0
"""Cycles until half and until 90 % of the runs know their pose, above which a drive is slow."""

Pairs = dict[tuple[str, ...], tuple[list[Result], list[Result]]]


def compare(results: Sequence[Result], one: str, other: str, fields: Sequence[str]) -> str:
    """Tabulate how soon two drives localize the robot.

    Parameters
    ----------
    results : sequence of Result
        Runs of other drives do not matter.
    one, other : str
        Drives; groups are slow by the first.
    fields : sequence of str
        Names of the fields of `Task` by which runs are grouped.

    Returns
    -------
    str
        A table, a line for every group that has runs of both, then what they come to.
    """
    pairs = _pairs(results, one, other, fields)
    one, other = plain(one, MOST_NAME), plain(other, MOST_NAME)
    if not pairs:
        return f"no group has runs of both {one} and {other}"
    rows = [
        [
            "group",
            "runs",
            *(f"{drive} {part}" for part in ("half", "90%") for drive in (one, other)),
            "half",
            "90%",
            "slow",
        ]
    ]
    for key, (first, second) in pairs.items():
        mine, theirs = _times(first), _times(second)
        halves, most = _quantiles(mine, theirs, 0.5), _quantiles(mine, theirs, 0.9)
        rows.append(
            [
                " ".join(key),
                f"{len(first)}/{len(second)}",
                *(_cycles(value) for value in (*halves, *most)),
                _ratio(*halves),
                _ratio(*most),
                "slow" if is_slow(first) else "",
            ]
        )
    slow = {key: pair for key, pair in pairs.items() if is_slow(pair[0])}
    return "\n".join(
        [
            aligned(rows),
            f"ratios: {other} / {one}; slow: {one} takes more than {SLOW_HALF:g} cycles for half of the runs "
            f"or {SLOW_MOST:g} for 90 %",
            _sum_up("all groups", pairs, one, other),
            _sum_up(f"where {one} is slow", slow, one, other),
            _sum_up(f"where {one} is slow by even seeds, by the odd ones", _by_other_half(pairs), one, other),
        ]
    )


def is_slow(results: Sequence[Result]) -> bool:
    """Return whether the runs of a group take long to localize."""
    times = _times(results)
    return quantile(times, 0.5) > SLOW_HALF or quantile(times, 0.9) > SLOW_MOST


def _pairs(results: Sequence[Result], one: str, other: str, fields: Sequence[str]) -> Pairs:
    groups = group_by([r for r in results if r.task.drive in (one, other)], *fields)
    pairs = {
        key: ([r for r in group if r.task.drive == one], [r for r in group if r.task.drive == other])
        for key, group in groups.items()
    }
    return {key: pair for key, pair in pairs.items() if all(pair)}


def _by_other_half(pairs: Pairs) -> Pairs:
    """Choose the slow groups by their runs with even seeds; return them with their other runs."""
    found = {}
    for key, (first, second) in pairs.items():
        even, odd = _of_seeds(first, 0), _of_seeds(first, 1)
        against = _of_seeds(second, 1)
        if even and odd and against and is_slow(even):
            found[key] = (odd, against)
    return found


def _of_seeds(results: Sequence[Result], remainder: int) -> list[Result]:
    return [result for result in results if result.task.seed % 2 == remainder]


def _times(results: Sequence[Result]) -> Floats:
    return times_to_localize([result.outcome for result in results])


def _quantiles(mine: Floats, theirs: Floats, share: float) -> tuple[float, float]:
    return quantile(mine, share), quantile(theirs, share)


def _sum_up(what: str, pairs: Pairs, one: str, other: str) -> str:
    """Sum up groups in a line: all their runs together, and how many groups are faster."""
    if not pairs:
        return f"{what}: no group"
    mine = np.concatenate([_times(first) for first, _ in pairs.values()])
    theirs = np.concatenate([_times(second) for _, second in pairs.values()])
    parts = []
    for name, share in (("half", 0.5), ("90%", 0.9)):
        pair = _quantiles(mine, theirs, share)
        parts.append(f"{name} {_cycles(pair[0])} / {_cycles(pair[1])} cycles (ratio {_ratio(*pair)})")
        parts.append(_count_faster(pairs, share))
    longest = max(result.task.cycles for pair in pairs.values() for side in pair for result in side)
    means = [float(np.minimum(times, longest).mean()) for times in (mine, theirs)]
    parts.append(f"mean {means[0]:.0f} / {means[1]:.0f}, never counted as {longest} ({_ratio(*means)})")
    return f"{what}: {len(pairs)} groups, {one} / {other}: " + ", ".join(parts)


def _count_faster(pairs: Pairs, share: float) -> str:
    values = [_quantiles(_times(first), _times(second), share) for first, second in pairs.values()]
    faster = sum(theirs <= 2.0 / 3.0 * mine for mine, theirs in values if math.isfinite(theirs))
    return f"at least a third faster in {faster}"


def _cycles(value: float) -> str:
    return "never" if math.isinf(value) else f"{value:.0f}"


def _ratio(mine: float, theirs: float) -> str:
    """Return theirs / mine; an infinite one only if they never get there."""
    if math.isinf(mine) and math.isinf(theirs):
        return "-"
    if math.isinf(theirs):
        return "never"
    if math.isinf(mine):
        return "0"
    return f"{theirs / mine:.2f}" if mine > 0.0 else "-"
