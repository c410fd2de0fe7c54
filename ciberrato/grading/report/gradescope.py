"""The results of an agent as Gradescope's results.json."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from ciberrato.plaintext import plain, plain_lines

if TYPE_CHECKING:
    from ciberrato.grading.course import Course
    from ciberrato.grading.standing import Standing


def results(course: Course, standing: Standing) -> str:
    """Write the document: the agent's total as the score, a test a run, and the leader board.

    Parameters
    ----------
    course : Course
    standing : Standing

    Returns
    -------
    str
        JSON; see https://gradescope-autograders.readthedocs.io/en/latest/specs/.
    """
    from ciberrato.grading.secret import published

    _, (shown,) = published(course, [standing])  # what students see: hidden labs are one
    tests: list[dict[str, Any]] = []
    passing = course.points.passing
    for run, points in standing.runs:
        outcome = run.outcome
        passed = outcome.good and (passing is None or points >= passing)
        test: dict[str, Any] = {
            "name": plain(run.name),
            "score": round(points, 6),
            "status": "passed" if passed else "failed",
            "output": plain_lines(_words(run.outcome, str(run.measured.get("tail", "")))),
            "output_format": "text",
            "visibility": "hidden" if course.hides(run.task.lab, run.task.seed) else "visible",
        }
        if course.points.maximum is not None:
            test["max_score"] = course.points.maximum
        tests.append(test)
    document = {
        "score": round(standing.total, 6),
        "output": f"Place {standing.place}; the score is the mean of the labs by their weights.",
        "output_format": "text",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "tests": tests,
        "leaderboard": [
            {"name": "Points", "value": round(standing.total, 6)},
            *({"name": plain(name, 80), "value": round(points, 6)} for name, points in shown.labs.items()),
        ],
    }
    return json.dumps(document, indent=1) + "\n"


def _words(outcome: Any, tail: str) -> str:
    text = (
        f"{outcome.status}{': ' * bool(outcome.detail)}{outcome.detail}\n"
        f"score {outcome.score}, targets {outcome.visited} of {outcome.targets}, "
        f"{outcome.collisions} collisions, {outcome.time} of {outcome.sim_time} cycles, "
        f"{outcome.unanswered} unanswered, {outcome.late} late\n"
    )
    return text + (f"\nlast output:\n{tail}" if tail.strip() else "")
