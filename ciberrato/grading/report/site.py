"""The report's page: one file that a browser opens from a disk, without a network."""

from __future__ import annotations

import importlib.resources
from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ciberrato.grading.course import Course
    from ciberrato.grading.runner import Graded
    from ciberrato.grading.standing import Standing

_WIDTH, _HEIGHT = 160, 22
_OPEN = 3
"""Agents whose runs are shown at once; those of others at a click."""


def asset(name: str) -> str:
    """Read a file that belongs to the report."""
    return importlib.resources.files("ciberrato.grading").joinpath("assets", name).read_text(encoding="utf-8")


def index_page(course: Course, ranked: Sequence[Standing], folder: Path, *, missing: int) -> str:
    """Write the page: the ranking, and each agent's runs.

    Parameters
    ----------
    course : Course
    ranked : sequence of Standing
    folder : Path
        Of the report; runs whose recording is there can be played.
    missing : int
        Runs still to be done.

    Returns
    -------
    str
        HTML. Names and outputs are text in it, whatever they hold.
    """
    points = [points for standing in ranked for _, points in standing.runs]
    low, high = min([0.0, *points]), max([0.0, *points])
    if course.points.maximum is not None:
        low, high = 0.0, course.points.maximum
    pace = "in lockstep" if course.lockstep else f"at {course.speed:g} times real time"
    labs = [f'<th class="num">{escape(lab.name)}<small>×{lab.weight:g}</small></th>' for lab in course.labs]
    notice = f"Incomplete: {missing} of {missing + len(points)} runs are still to be done."
    return Template(asset("report.html")).substitute(
        title=escape(course.title),
        summary=", ".join(
            [
                *(f"{len(ranked)} agents", f"{len(labs)} labs", f"{len(course.seeds)} seeds"),
                *(f"{len(points)} runs", pace),
            ]
        ),
        notice=f'<p class="notice">{notice}</p>' if missing else "",
        labs="".join(labs),
        span=f"{low:g} to {high:g}",
        ranking="".join(
            _row(number, standing, course, low, high) for number, standing in enumerate(ranked, 1)
        ),
        formula=escape(course.points.formula.text),
        cut="" if course.points.maximum is None else f", cut to 0 and {course.points.maximum:g}",
        agents="".join(_agent(number, standing, folder) for number, standing in enumerate(ranked, 1)),
    )


def _row(number: int, standing: Standing, course: Course, low: float, high: float) -> str:
    cells = "".join(
        f'<td class="num">{_points(standing.labs[lab.name]) if lab.name in standing.labs else "–"}</td>'
        for lab in course.labs
    )
    strip = _strip([points for _, points in standing.runs], standing.total, low, high)
    failed = f'<td class="num bad">{standing.bad}</td>' if standing.bad else '<td class="num">0</td>'
    return (
        f'<tr><td class="num place">{standing.place}</td><td><a href="#agent-{number}">'
        f'{escape(standing.agent)}</a></td><td class="num total">{_points(standing.total)}</td>{cells}'
        f"<td>{strip}</td>{failed}</tr>\n"
    )


def _strip(points: Sequence[float], mean: float, low: float, high: float) -> str:
    """Draw the points of an agent's runs as dots on a line, and their mean as a stroke."""
    span = (high - low) or 1.0

    def place(value: float) -> str:
        return f"{5 + (_WIDTH - 10) * (value - low) / span:.1f}"

    middle = _HEIGHT / 2
    dots = "".join(f'<circle cx="{place(value)}" cy="{middle}" r="4"/>' for value in points)
    return (
        f'<svg class="strip" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" height="{_HEIGHT}" role="img" '
        f'aria-label="from {min(points):g} to {max(points):g}">'
        f'<path class="axis" d="M5 {middle}H{_WIDTH - 5}"/>{dots}'
        f'<path class="mean" d="M{place(mean)} 2V{_HEIGHT - 2}"/></svg>'
    )


def _agent(number: int, standing: Standing, folder: Path) -> str:
    return Template(asset("agent.html")).substitute(
        number=number,
        open=" open" * (number <= _OPEN),
        name=escape(standing.agent),
        place=standing.place,
        points=_points(standing.total),
        commit="" if standing.commit is None else f", commit <code>{escape(standing.commit[:10])}</code>",
        runs="".join(_run(run, points, folder) for run, points in standing.runs),
    )


def _run(run: Graded, points: float, folder: Path) -> str:
    outcome, task = run.outcome, run.task
    play = ""
    if (folder / "recordings" / f"{task.file}.js").exists():
        play = f'<a class="play" href="play.html?run={task.file}" title="Play this run">▶</a>'
    words = escape(outcome.status) + (f"<small>{escape(outcome.detail)}</small>" if outcome.detail else "")
    tail = str(run.measured.get("tail", "")).strip()
    output = f"<details><summary>last lines</summary><pre>{escape(tail)}</pre></details>" if tail else ""
    if not outcome.registered:
        numbers = ["–"] * 8
    else:
        numbers = [
            str(outcome.score),
            f"{outcome.visited}/{outcome.targets}",
            str(outcome.arrival_time) if outcome.visited else "–",
            str(outcome.returning_time) if outcome.returning_time else "–",
            str(outcome.collisions),
            f"{outcome.time}/{outcome.sim_time}",
            str(outcome.unanswered),
            str(outcome.late),
        ]
    numbers += ["–" if value is None else f"{value:g}" for value in (outcome.mapping, outcome.planning)]
    cells = "".join(f'<td class="num">{value}</td>' for value in numbers)
    return (
        f'<tr data-run="{task.file}"><td>{play}</td><td>{escape(task.lab.name)}</td>'
        f'<td class="num">{task.seed}</td><td class="{"good" if outcome.good else "bad"}">{words}</td>'
        f'<td class="num total">{_points(points)}</td>{cells}'
        f'<td class="num" data-measured="wall"></td><td class="num" data-measured="memory"></td>'
        f"<td>{output}</td></tr>\n"
    )


def _points(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")
