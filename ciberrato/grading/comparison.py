"""Two agents compared by runs in the same lab with the same seed: what differs is the agent alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ciberrato.errors import UsageError
from ciberrato.grading.standing import Standing
from ciberrato.reprs import short_repr

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Comparison:
    """Difference of two agents.

    Attributes
    ----------
    pairs : int
        Runs of both in the same lab with the same seed.
    mean : float
        Points that the first has more, in the mean of the pairs.
    interval : (float, float) or None
        Student's interval of that mean, of 95 % confidence; None with fewer than two pairs.
    better, worse : int
        Pairs in which the first has more points, and fewer.
    """

    __repr__ = short_repr

    pairs: int
    mean: float
    interval: tuple[float, float] | None
    better: int
    worse: int


def compare(ranked: Sequence[Standing], one: str, other: str) -> Comparison:
    """Compare two agents.

    Parameters
    ----------
    ranked : sequence of Standing
    one, other : str
        Names.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError
        If there is no such agent, or they have no pair of runs.
    """
    first, second = (_points(ranked, name) for name in (one, other))
    differences = [points - second[key] for key, points in first.items() if key in second]
    count = len(differences)
    if not count:
        raise UsageError(f"--compare: {one!r} and {other!r} have no runs in the same lab with the same seed")
    mean = math.fsum(differences) / count
    interval = None
    if count > 1:
        from scipy.special import stdtrit

        variance = math.fsum((one - mean) ** 2 for one in differences) / (count - 1)
        half = float(stdtrit(count - 1, 0.5 + CONFIDENCE / 2.0)) * math.sqrt(variance / count)
        interval = (mean - half, mean + half)
    better, worse = sum(one > 0.0 for one in differences), sum(one < 0.0 for one in differences)
    return Comparison(count, mean, interval, better, worse)


def _points(ranked: Sequence[Standing], name: str) -> dict[tuple[str, int], float]:
    for standing in ranked:
        if standing.agent == name:
            return {(run.task.lab.name, run.task.seed): points for run, points in standing.runs}
    known = ", ".join(repr(standing.agent) for standing in ranked)
    raise UsageError(f"--compare: no runs of an agent {name!r}; choose one of {known}")


def words(comparison: Comparison, one: str, other: str) -> str:
    """Return a comparison as one line of text."""
    span = ""
    if comparison.interval is not None:
        low, high = comparison.interval
        span = f" ({CONFIDENCE:.0%} interval {low:+.2f} to {high:+.2f})"
    equal = comparison.pairs - comparison.better - comparison.worse
    return (
        f"{one} against {other}: {comparison.mean:+.2f} points a run{span}, {comparison.pairs} pairs: "
        f"{comparison.better} better, {equal} equal, {comparison.worse} worse"
    )
