"""Tournament's part of the page: who beat whom, and every run with the places reached in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from ciberrato.grading.report.pieces import asset, named, play_link, rounded, told
from ciberrato.plaintext import plain

if TYPE_CHECKING:
    from ciberrato.grading.runner import Graded
    from ciberrato.grading.standing import Standing

_Part = tuple["Graded", float, Mapping[str, Any]]
MOST_ACROSS = 40
"""Agents up to which there is a table of all against all."""


def meetings_section(ranked: Sequence[Standing], folder: Path) -> str:
    """Write both tables; nothing if the runs are not those of a tournament.

    Parameters
    ----------
    ranked : sequence of Standing
    folder : Path
        Folder of the report; runs whose recording is there can be played.

    Returns
    -------
    str
        HTML.
    """
    runs: dict[str, list[_Part]] = {}
    for standing in ranked:
        for run, points in standing.runs:
            extra = run.extra()
            if extra:
                runs.setdefault(run.task.key, []).append((run, points, extra))
    if not runs:
        return ""
    names = [standing.agent for standing in ranked]
    return Template(asset("meetings.html")).substitute(
        duels=_duels(names, list(runs.values())) if len(names) <= MOST_ACROSS else "",
        count=len(runs),
        rows="".join(_row(parts, folder) for parts in sorted(runs.values(), key=_order)),
    )


def duels(runs: Sequence[Sequence[_Part]]) -> dict[tuple[str, str], tuple[int, int, int]]:
    """Count for every two agents that have met how often one was before, level with, and behind the other."""
    counts: dict[tuple[str, str], tuple[int, int, int]] = {}
    for parts in runs:
        for run, _, own in parts:
            for other, _, its in parts:
                if other is not run:
                    pair = run.task.agent.name, other.task.agent.name
                    won, level, lost = counts.get(pair, (0, 0, 0))
                    gap = its["place"] - own["place"]
                    counts[pair] = (won + (gap > 0), level + (gap == 0), lost + (gap < 0))
    return counts


def _duels(names: Sequence[str], runs: Sequence[Sequence[_Part]]) -> str:
    counts = duels(runs)

    def cell(one: str, other: str) -> str:
        if (one, other) not in counts:
            return '<td class="num">' + ("–" if one != other else "") + "</td>"
        won, level, lost = counts[one, other]
        kind = "good" if won > lost else "bad" if won < lost else ""
        text = f"before it {won} times, level {level}, behind it {lost}"
        return f'<td class="num {kind}" title="{text}">{won}–{level}–{lost}</td>'

    head = "".join(
        f'<th class="num" title="{escape(plain(name))}">{escape(plain(name, 12))}</th>' for name in names
    )
    rows = "".join(
        f'<tr><th scope="row">{named(one)}</th>{"".join(cell(one, other) for other in names)}</tr>\n'
        for one in names
    )
    return f'<table class="duels"><thead><tr><th></th>{head}</tr></thead><tbody>\n{rows}</tbody></table>'


def _order(parts: Sequence[_Part]) -> tuple[Any, ...]:
    run, _, extra = parts[0]
    return run.task.lab.name, run.task.seed, extra["round"], extra["group"], run.task.file


def _row(parts: Sequence[_Part], folder: Path) -> str:
    run, _, extra = parts[0]
    made = "".join(
        f'<li value="{own["place"]}"><span>{named(one.task.agent.name)}</span> <b>{rounded(points)}</b> '
        f"<small>from place {own['start']}, {rounded(own['formula'])} by the formula"
        f"{'' if one.outcome.good else f', {told(one.outcome.status)}'}</small></li>"
        for one, points, own in sorted(parts, key=lambda part: (part[2]["place"], part[2]["start"]))
    )
    where = f"round {extra['round']}, group {extra['group']}"
    return (
        f"<tr><td>{play_link(run, folder)}</td><td>{named(run.task.lab.name)}, seed {run.task.seed}"
        f'<small>{where}</small></td><td><ol class="made">{made}</ol></td></tr>\n'
    )
