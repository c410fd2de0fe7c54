"""The results as CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ciberrato.grading.outcome import Outcome

if TYPE_CHECKING:
    from ciberrato.grading.course import Course
    from ciberrato.grading.standing import Standing

FORMAT = 1
MEASURED = ("wall", "memory", "threads", "output", "exit", "signal")
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")


def results_csv(ranked: Sequence[Standing]) -> str:
    """Write a row a run: agent, lab, seed, points, and all of its outcome, the agent's commit."""
    fields = list(Outcome.__dataclass_fields__)
    rows: list[list[Any]] = [["agent", "lab", "seed", *_extra_names(ranked), "points", *fields, "commit"]]
    for standing in ranked:
        for run, points in standing.runs:
            task = run.task
            values = [points, *asdict(run.outcome).values(), task.agent.commit]
            rows.append([task.agent.name, task.lab.name, task.seed, *run.extra().values(), *values])
    return _csv(rows)


def _extra_names(ranked: Sequence[Standing]) -> list[str]:
    """Return the columns that a tournament has more."""
    return next((list(run.extra()) for standing in ranked for run, _ in standing.runs), [])


def measured_csv(ranked: Sequence[Standing]) -> str:
    """Write a row a run: wall time in seconds, memory in bytes, threads, bytes of output, how it ended."""
    rows: list[list[Any]] = [["agent", "lab", "seed", *_extra_names(ranked), *MEASURED]]
    for standing in ranked:
        for run, _ in standing.runs:
            task = run.task
            values = [run.measured.get(name) for name in MEASURED]
            rows.append([task.agent.name, task.lab.name, task.seed, *run.extra().values(), *values])
    return _csv(rows)


def measured_script(ranked: Sequence[Standing]) -> str:
    """Write wall time and memory for the page, by the recording's name."""
    values = {
        run.row: [run.measured.get("wall"), run.measured.get("memory")]
        for standing in ranked
        for run, _ in standing.runs
    }
    return f"ciberratoMeasured({json.dumps(values, separators=(',', ':'))});\n"


def results_json(course: Course, ranked: Sequence[Standing], *, missing: int) -> str:
    """Write ranking and runs as JSON."""
    document = {
        "format": FORMAT,
        "title": course.title,
        "formula": course.points.formula.text,
        "maximum": course.points.maximum,
        "weights": {lab.name: lab.weight for lab in course.labs},
        "missing": missing,
        "hidden": sum(standing.hidden for standing in ranked),
        "ranking": [
            {
                "place": standing.place,
                "agent": standing.agent,
                "commit": standing.commit,
                "points": standing.total,
                "labs": standing.labs,
                "runs": [
                    {
                        "lab": run.task.lab.name,
                        "seed": run.task.seed,
                        **run.extra(),
                        "points": points,
                        "recording": f"recordings/{run.task.file}.js",
                        **asdict(run.outcome),
                    }
                    for run, points in standing.runs
                ],
            }
            for standing in ranked
        ],
    }
    return json.dumps(document, indent=1) + "\n"


def _csv(rows: list[list[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([[_cell(value) for value in row] for row in rows])
    return text.getvalue()


def _cell(value: Any) -> Any:
    """Return a cell; text that a spreadsheet would read as a formula gets an apostrophe in front."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULAS) else value
