"""The report's page: one file that a browser opens from a disk, without a network."""

from __future__ import annotations

import importlib.resources
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ciberrato.grading.course import Course
    from ciberrato.grading.runner import Graded
    from ciberrato.grading.standing import Standing

_WIDTH, _HEIGHT = 160, 22


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
    labs = [lab for lab in course.labs]
    runs = [points for standing in ranked for _, points in standing.runs]
    low, high = min([0.0, *runs]), max([0.0, *runs])
    if course.points.maximum is not None:
        low, high = 0.0, course.points.maximum
    heads = "".join(f'<th class="num">{escape(lab.name)}<small>×{lab.weight:g}</small></th>' for lab in labs)
    rows = "".join(_row(number, standing, course, low, high) for number, standing in enumerate(ranked, 1))
    agents = "".join(_agent(number, standing, folder) for number, standing in enumerate(ranked, 1))
    pace = "lockstep" if course.lockstep else f"{course.speed:g} × real time"
    count = len(runs)
    notice = (
        f'<p class="notice">Incomplete: {missing} of {missing + count} runs are still to be done.</p>'
        if missing
        else ""
    )
    maximum = "" if course.points.maximum is None else f", from 0 to {course.points.maximum:g}"
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'self' file:; script-src 'self' file:; img-src 'self' file: data:; base-uri 'none'; form-action 'none'">
<title>{escape(course.title)}</title>
<link rel="icon" href="icon.svg" type="image/svg+xml">
<link rel="stylesheet" href="report.css">
</head>
<body>
<header>
<h1>{escape(course.title)}</h1>
<p>{len(ranked)} agents, {len(labs)} labs, {len(course.seeds)} seeds, {count} runs, in {pace}</p>
</header>
{notice}
<main>
<section>
<h2>Ranking</h2>
<div class="scroll"><table class="ranking">
<thead><tr><th class="num">Place</th><th>Agent</th><th class="num">Points</th>{heads}<th>Points of its runs, {low:g} to {high:g}</th><th class="num">Failed runs</th></tr></thead>
<tbody>{rows}</tbody>
</table></div>
<p class="hint">Points of a run: <code>{escape(course.points.formula.text)}</code>{maximum}. A lab counts by the mean over its seeds,
the total is the mean of the labs by their weights (×). Equal totals share a place.</p>
<p class="hint">Also as <a href="results.csv">CSV</a>, <a href="results.json">JSON</a>, <a href="junit.xml">JUnit XML</a>,
<a href="measured.csv">times and memory (CSV)</a>, and for Gradescope in <code>gradescope/</code>.</p>
</section>
{agents}
</main>
<script src="report.js"></script>
<script src="measured.js"></script>
</body>
</html>
"""


def _row(number: int, standing: Standing, course: Course, low: float, high: float) -> str:
    cells = "".join(
        f'<td class="num">{_points(standing.labs[lab.name]) if lab.name in standing.labs else "–"}</td>'
        for lab in course.labs
    )
    failed = f'<td class="num bad">{standing.bad}</td>' if standing.bad else '<td class="num">0</td>'
    return (
        f'<tr><td class="num place">{standing.place}</td><td><a href="#agent-{number}">'
        f'{escape(standing.agent)}</a></td><td class="num total">{_points(standing.total)}</td>{cells}'
        f"<td>{_strip([points for _, points in standing.runs], standing.total, low, high)}</td>{failed}</tr>\n"
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
    rows = "".join(_run(run, points, folder) for run, points in standing.runs)
    return f"""<section id="agent-{number}">
<details{" open" * (number <= 3)}>
<summary><h2>{escape(standing.agent)}</h2><span>place {standing.place}, {_points(standing.total)} points</span></summary>
<div class="scroll"><table class="runs">
<thead><tr><th></th><th>Lab</th><th class="num">Seed</th><th>What came of it</th><th class="num">Points</th><th class="num">Score</th>
<th class="num">Targets</th><th class="num">Arrival</th><th class="num">Return</th><th class="num">Collisions</th><th class="num">Cycles</th>
<th class="num" title="Cycles whose Measures were not answered">Unanswered</th><th class="num" title="Answers that came after their cycle">Late</th>
<th class="num">Map</th><th class="num">Tour</th><th class="num">Seconds</th><th class="num">MB</th><th>Output</th></tr></thead>
<tbody>{rows}</tbody>
</table></div>
</details>
</section>
"""


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
