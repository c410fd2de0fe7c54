"""The report's page: one file that a browser opens from a disk, without a network."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

from ciberrato.grading.report.meetings import meetings_section
from ciberrato.grading.report.pieces import asset, named, play_link, rounded, told
from ciberrato.grading.report.replay import replay
from ciberrato.grading.standing import values_of
from ciberrato.plaintext import plain

if TYPE_CHECKING:
    from ciberrato.grading.course import Course
    from ciberrato.grading.runner import Graded
    from ciberrato.grading.standing import Standing

_WIDTH, _HEIGHT = 160, 22
_MAPS = {"mapping": "Map", "planning": "Tour"}
_OPEN = 3
"""Agents whose runs are shown at once; those of others at a click."""


def index_page(course: Course, ranked: Sequence[Standing], folder: Path, *, missing: int) -> str:
    """Write the page: the ranking, and each agent's runs.

    Parameters
    ----------
    course : Course
    ranked : sequence of Standing
    folder : Path
        Folder of the report; runs whose recording is there can be played.
    missing : int
        Runs still to be done.

    Returns
    -------
    str
        HTML. Names and outputs are text in it, whatever they hold.
    """
    points = [points for standing in ranked for _, points in standing.runs]
    count = len({run.task.key for standing in ranked for run, _ in standing.runs})
    hidden = sum(standing.hidden for standing in ranked)
    # A total may lie beyond all runs that are shown, where others are hidden.
    span = [0.0, *points, *(standing.total for standing in ranked)]
    low, high = min(span), max(span)
    if course.points.maximum is not None:
        low, high = 0.0, course.points.maximum
    outcomes = [run.outcome for standing in ranked for run, _ in standing.runs]
    # Columns that no run has anything in are left out.
    maps = [name for name in _MAPS if any(getattr(one, name) is not None for one in outcomes)]
    pace = "in lockstep" if course.lockstep else f"at {course.speed:g} times real time"
    labs = [f'<th class="num">{named(lab.name)}<small>×{lab.weight:g}</small></th>' for lab in course.labs]
    notices = []
    if missing:
        whole = missing + hidden + count
        notices.append(f"Incomplete: {missing} of {whole} runs are still to be done.")
    if hidden:
        notices.append(f"{hidden} runs in hidden labs, or with hidden seeds, count, too, but are not shown.")
    return Template(asset("report.html")).substitute(
        title=escape(plain(course.title, 200)),
        summary=", ".join(
            [
                *(_many(len(ranked), "agent"), _many(len(labs), "lab"), _many(len(course.seeds), "seed")),
                *(_many(count, "run"), pace),
            ]
        ),
        notice="".join(f'<p class="notice">{notice}</p>' for notice in notices),
        labs="".join(labs),
        span=f"{low:g} to {high:g}",
        ranking="".join(
            _row(number, standing, course, low, high) for number, standing in enumerate(ranked, 1)
        ),
        worth=_worth(course, ranked),
        meetings=meetings_section(ranked, folder),
        agents="".join(
            _agent(number, standing, folder, maps, course) for number, standing in enumerate(ranked, 1)
        ),
    )


def _worth(course: Course, ranked: Sequence[Standing]) -> str:
    """Return a sentence on how many points a run is worth."""
    formula = f"<code>{escape(course.points.formula.text)}</code>"
    if not any(run.extra() for standing in ranked for run, _ in standing.runs):
        maximum = course.points.maximum
        cut = "" if maximum is None else f", cut to 0 and {maximum:g}"
        return f"Points of a run: {formula}{cut}."
    table = course.tournament.points
    worth = "the share of its opponents that it beats, in percent, equal ones counting half"
    if table is not None:
        worth = f"{', '.join(f'{one:g}' for one in table)} for place 1, 2, ..., shared by equal ones"
    return f"In a run agents are placed by {formula}. An agent gets {worth}."


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _row(number: int, standing: Standing, course: Course, low: float, high: float) -> str:
    cells = "".join(
        f'<td class="num">{rounded(standing.labs[lab.name]) if lab.name in standing.labs else "–"}</td>'
        for lab in course.labs
    )
    strip = _strip([points for _, points in standing.runs], standing.total, low, high)
    failed = f'<td class="num bad">{standing.bad}</td>' if standing.bad else '<td class="num">0</td>'
    return (
        f'<tr><td class="num place">{standing.place}</td><td><a href="#agent-{number}">'
        f'{named(standing.agent)}</a></td><td class="num total">{rounded(standing.total)}</td>{cells}'
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


def _agent(number: int, standing: Standing, folder: Path, maps: Sequence[str], course: Course) -> str:
    return Template(asset("agent.html")).substitute(
        number=number,
        open=" open" * (number <= _OPEN),
        name=named(standing.agent),
        place=standing.place,
        points=rounded(standing.total),
        commit="" if standing.commit is None else f", commit <code>{escape(standing.commit[:10])}</code>",
        extra="".join(f'<th class="num">{name.capitalize()}</th>' for name in standing.runs[0][0].extra()),
        maps="".join(f'<th class="num">{_MAPS[name]}</th>' for name in maps),
        runs="".join(_run(run, points, folder, maps, course) for run, points in standing.runs),
    )


def _run(run: Graded, points: float, folder: Path, maps: Sequence[str], course: Course) -> str:
    outcome, task = run.outcome, run.task
    words = told(outcome.status) + (f"<small>{told(outcome.detail)}</small>" if outcome.detail else "")
    words += _why(run, course)
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
    judged = [getattr(outcome, name) for name in maps]
    numbers += ["–" if value is None else f"{value:g}" for value in judged]
    cells = "".join(f'<td class="num">{value}</td>' for value in numbers)
    extra = "".join(f"<td{_kind(value)}>{_shown(value)}</td>" for value in run.extra().values())
    return (
        f'<tr data-run="{run.row}"><td>{play_link(run, folder)}</td><td>{named(task.lab.name)}</td>'
        f'<td class="num">{task.seed}</td>{extra}<td class="{"good" if outcome.good else "bad"}">{words}</td>'
        f'<td class="num total">{rounded(points)}</td>{cells}'
        f'<td class="num" data-measured="wall"></td><td class="num" data-measured="memory"></td></tr>\n'
    )


def _why(run: Graded, course: Course) -> str:
    """Write how the run's points come about, and the last lines of the agent's output."""
    text = ""
    if run.outcome.registered:
        values = values_of(run)
        formula = course.points.formula
        used = ", ".join(f"{name} = {values[name]:g}" for name in sorted(formula.names))
        text = f"{formula.text} = {rounded(formula(values))}{', with ' * bool(used)}{used}"
    else:
        text = "An agent that never registered gets no points."
    tail = str(run.measured.get("tail", "")).strip()
    output = (
        f"<p>Last lines of its output:</p><pre>{told(tail)}</pre>" if tail else "<p>It printed nothing.</p>"
    )
    commands = told(replay(run, course))
    again = f'<p>To do it again, each line in a terminal of its own:</p><pre class="again">{commands}</pre>'
    return f'<details class="why"><summary>why</summary><p>{escape(text)}</p>{output}{again}</details>'


def _kind(value: object) -> str:
    return "" if isinstance(value, str) else ' class="num"'


def _shown(value: object) -> str:
    return rounded(value) if isinstance(value, float) else named(str(value))
