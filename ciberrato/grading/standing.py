"""Points, and who is first.

Points of a run are the course's formula, cut to 0 and the maximum if there is one; an agent that did not
register has none. An agent's points in a lab
are the mean of its runs there, over the seeds; its total is the mean of the labs by their weights. Agents of
equal totals, to a millionth, share a place, and the next place counts them all: 1, 2, 2, 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ciberrato.errors import UsageError
from ciberrato.grading.course import Course
from ciberrato.grading.runner import Graded
from ciberrato.reprs import short_repr

EQUAL = 1e-6
_COUNTED_UP = (1, 4, 7)


@dataclass(frozen=True, slots=True)
class Standing:
    """Standing of an agent.

    Attributes
    ----------
    place : int
        From 1.
    agent : str
    total : float
    labs : dict of str to float
        Points in each lab that it has runs in.
    runs : list of (Graded, float)
        With their points, in the course's order.
    hidden : int
        Runs that count, too, but are not to be shown.
    commit : str or None
        Commit of its files, if a git address named them.
    """

    __repr__ = short_repr

    place: int
    agent: str
    total: float
    labs: dict[str, float]
    runs: list[tuple[Graded, float]]
    hidden: int = 0
    commit: str | None = None

    @property
    def bad(self) -> int:
        """Runs that it did not live through."""
        return sum(not run.outcome.good for run, _ in self.runs)


def values_of(run: Graded) -> dict[str, float]:
    """Return what a formula of points may use.

    Besides the outcome's own quantities there is ``merit``, the score turned so that more of it is better:
    it is counted up in circuits (modes 1, 4, 7); in mode 0 it goes down from 100 and 100 a target, and the
    merit is what it went down; else it counts penalties, and the merit is its negative.
    """
    values = run.outcome.quantities()
    mode = run.task.lab.scoring
    merit = values["score"] if mode in _COUNTED_UP else -values["score"]
    return values | {"merit": merit + (100.0 * (values["targets"] + 1.0) if mode == 0 else 0.0)}


def points_of(course: Course, run: Graded) -> float:
    """Compute the points of a run; 0 if the agent did not register, whatever the formula says.

    Raises
    ------
    UsageError
        If the formula has no value there.
    """
    if not run.outcome.registered:
        return 0.0
    try:
        points = course.points.formula(values_of(run))
    except UsageError as error:
        where = f"{run.task.agent.name}, {run.task.lab.name}, seed {run.task.seed}"
        if course.hides(run.task.lab, run.task.seed):
            where = f"{run.task.agent.name}, a hidden run"
        raise UsageError(f"points of {where}: {error}") from None
    if course.points.maximum is not None:
        points = min(max(points, 0.0), course.points.maximum)
    return points + 0.0  # no -0


def standings(
    course: Course,
    runs: Sequence[Graded],
    *,
    points: Callable[[Graded], float] | None = None,
    second: Callable[[Graded], float] = lambda run: 0.0,
) -> list[Standing]:
    """Rank the agents.

    Parameters
    ----------
    course : Course
    runs : sequence of Graded
        Those that are done; an agent without any is left out.
    points : callable, optional
        Points of a run, if not those of the course's formula.
    second : callable
        Tie-break, in the same mean, where totals are equal.

    Returns
    -------
    list of Standing
        Best first; equal ones in the course's order.
    """
    found = []
    for agent in course.agents:
        own = [run for run in runs if run.task.agent.name == agent.name]
        if not own:
            continue
        counted = [(run, points_of(course, run) if points is None else points(run)) for run in own]
        labs, total = _means(course, counted)
        found.append((total, _means(course, [(run, second(run)) for run in own])[1], agent, labs, counted))
    found.sort(key=lambda one: (-round(one[0] / EQUAL), -one[1]))
    ranked: list[Standing] = []
    before = math.inf
    for number, (total, further, agent, labs, counted) in enumerate(found, 1):
        tied = bool(ranked) and abs(ranked[-1].total - total) <= EQUAL and abs(before - further) <= EQUAL
        place = ranked[-1].place if tied else number
        ranked.append(Standing(place, agent.name, total, labs, counted, commit=agent.commit))
        before = further
    return ranked


def _means(course: Course, counted: Sequence[tuple[Graded, float]]) -> tuple[dict[str, float], float]:
    """Compute the mean of each lab, and that of the labs by their weights."""
    labs, weights = {}, {}
    for lab in course.labs:
        there = [points for run, points in counted if run.task.lab.name == lab.name]
        if there:
            labs[lab.name] = math.fsum(there) / len(there)
            weights[lab.name] = lab.weight
    whole = math.fsum(weights.values())
    return labs, math.fsum(labs[name] * weights[name] for name in labs) / whole if whole else 0.0
