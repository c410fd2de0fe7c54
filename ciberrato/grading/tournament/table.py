"""Points by place, and the ranking of a tournament.

In a run agents are placed by the points of the course's formula; equal ones share a place. An agent gets the
share of its opponents that it beats, in percent, equal ones counting half; or what the course says that
places are worth, where equal ones get the mean of the places that they share. One that did not register is
last and gets nothing. From there on all is as in a grading: means of runs, labs by their weights; where
totals are equal, the mean points by the formula decide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ciberrato.grading.course import Course
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.runner import Graded
from ciberrato.grading.standing import EQUAL, Standing, points_of, standings
from ciberrato.grading.task import Task
from ciberrato.grading.tournament.matches import Match
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Played(Graded):
    """An agent's part in a run.

    Attributes
    ----------
    match : Match
    start : int
        Its start place.
    place : int
        That it made; equal ones share it.
    formula : float
        Its points by the course's formula.
    worth : float
        Its points of the tournament.
    """

    __repr__ = short_repr

    match: Match = field(repr=False)
    start: int
    place: int
    formula: float
    worth: float

    @property
    def name(self) -> str:
        """Which of the agent's runs it is."""
        meeting = self.match.meeting
        return (
            f"{self.task.lab.name}, seed {self.task.seed}, round {meeting.round}, group {meeting.group}, "
            f"place {self.start}"
        )

    @property
    def row(self) -> str:
        """How a report's page calls it."""
        return f"{self.task.file}-{self.start}"

    @property
    def opponents(self) -> list[str]:
        """Names of the others."""
        return [agent.name for agent in self.match.agents if agent.name != self.task.agent.name]

    def extra(self) -> dict[str, Any]:
        """Return further columns of the results."""
        meeting = self.match.meeting
        return {
            "round": meeting.round,
            "group": meeting.group,
            "against": ", ".join(self.opponents),
            "start": self.start,
            "place": self.place,
            "formula": self.formula,
        }


def played(
    course: Course, matches: Sequence[Match], done: Mapping[str, list[tuple[Outcome, dict[str, Any]]]]
) -> list[Played]:
    """Place the agents of all runs that are done.

    Parameters
    ----------
    course : Course
    matches : sequence of Match
    done : mapping
        By a match's key what came of its agents, in order of the start places.

    Returns
    -------
    list of Played
        In order of the matches, and in each of the start places.

    Raises
    ------
    UsageError
        If the formula has no value somewhere.
    """
    found = []
    for match in matches:
        if match.key not in done:
            continue
        graded = [
            Graded(Task(agent, match.lab, match.seed, match.key, match.file), outcome, measured)
            for agent, (outcome, measured) in zip(match.agents, done[match.key], strict=True)
        ]
        own = [points_of(course, run) for run in graded]
        # Those that did not register are behind all others, whatever the formula gives.
        values = [
            points if run.outcome.registered else -math.inf for points, run in zip(own, graded, strict=True)
        ]
        for start, (run, points, value) in enumerate(zip(graded, own, values, strict=True), 1):
            better = sum(other > value + EQUAL for other in values)
            equal = sum(abs(other - value) <= EQUAL or other == value for other in values)
            worth = 0.0
            if run.outcome.registered:
                worth = _worth(course.tournament.points, better, equal, len(values))
            found.append(
                Played(
                    run.task,
                    run.outcome,
                    run.measured,
                    match=match,
                    start=start,
                    place=better + 1,
                    formula=points,
                    worth=worth,
                )
            )
    return found


def _worth(table: tuple[float, ...] | None, better: int, equal: int, robots: int) -> float:
    """Compute what a place is worth that so many are before and so many share, oneself included."""
    if table is None:
        return 100.0 * (robots - better - equal + 0.5 * (equal - 1)) / (robots - 1)
    shared = [table[place] if place < len(table) else 0.0 for place in range(better, better + equal)]
    return math.fsum(shared) / equal


def tournament_standings(course: Course, runs: Sequence[Played]) -> list[Standing]:
    """Rank the agents of a tournament, best first."""
    worth = {(run.task.key, run.start): run.worth for run in runs}
    formula = {(run.task.key, run.start): run.formula for run in runs}

    def of(values: dict[tuple[str, int], float], run: Graded) -> float:
        return values[run.task.key, getattr(run, "start", 0)]

    return standings(course, runs, points=lambda run: of(worth, run), second=lambda run: of(formula, run))
