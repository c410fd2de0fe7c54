"""The teacher's hidden labs and seeds: added to a course, and left out of reports that are published."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

from ciberrato.grading.course import Course, CourseError, GradedLab, read_graded_lab, read_toml
from ciberrato.grading.fields import Fields
from ciberrato.grading.standing import Standing

HIDDEN = "hidden labs"
"""Name of all of them together in published reports."""


def with_secret(course: Course, path: Path) -> Course:
    """Add what is secret to a course.

    Parameters
    ----------
    course : Course
    path : Path
        TOML: ``seeds``, which all labs are run with, and ``[[lab]]`` as in a course; files named in it are
        looked for from its folder.

    Returns
    -------
    Course

    Raises
    ------
    CourseError
        With all faults found, a line each.
    """
    faults: list[str] = []
    top = Fields(read_toml(path), str(path), faults)
    seeds = top.seeds("seeds") if top.has("seeds") else ()
    tables = top.tables("lab") if top.has("lab") else []
    labs = [dataclasses.replace(read_graded_lab(table, path.parent), secret=True) for table in tables]
    top.end()
    if not seeds and not tables:
        top.fault("holds neither seeds nor [[lab]]")
    for seed in sorted(set(seeds) & set(course.seeds)):
        top.fault(f"seeds: {seed} is in the course already, for all to see; choose another")
    names = [lab.name for lab in (*course.labs, *labs)]
    for name in sorted({name for name in names if names.count(name) > 1}):
        top.fault(f"lab: the name {name!r} occurs more than once, here or in the course")
    if faults:
        raise CourseError(faults)
    return dataclasses.replace(
        course, labs=(*course.labs, *labs), seeds=(*course.seeds, *seeds), secret_seeds=frozenset(seeds)
    )


def published(course: Course, ranked: Sequence[Standing]) -> tuple[Course, list[Standing]]:
    """Remove what is secret, for a report that everyone may read.

    Places, totals and the points of public labs are those of all runs; hidden labs are one lab, with the mean
    of their points by their weights. Runs in hidden labs, or with hidden seeds, are not there.

    Parameters
    ----------
    course : Course
    ranked : sequence of Standing

    Returns
    -------
    course : Course
    ranked : list of Standing
    """
    hidden = [lab for lab in course.labs if lab.secret]
    labs = [lab for lab in course.labs if not lab.secret]
    if hidden:
        weight = math.fsum(lab.weight for lab in hidden)
        labs.append(GradedLab(HIDDEN, Path(), weight=weight, secret=True))
    seeds = tuple(seed for seed in course.seeds if seed not in course.secret_seeds)
    shown = []
    for standing in ranked:
        points = {lab.name: standing.labs[lab.name] for lab in labs if lab.name in standing.labs}
        rest = [(standing.labs[lab.name], lab.weight) for lab in hidden if lab.name in standing.labs]
        if rest:
            whole = math.fsum(weight for _, weight in rest)
            points[HIDDEN] = math.fsum(one * weight for one, weight in rest) / whole if whole else 0.0
        runs = [(run, one) for run, one in standing.runs if not course.hides(run.task.lab, run.task.seed)]
        shown.append(
            dataclasses.replace(standing, labs=points, runs=runs, hidden=len(standing.runs) - len(runs))
        )
    return dataclasses.replace(course, labs=tuple(labs), seeds=seeds), shown
