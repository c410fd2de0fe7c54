"""The results as JUnit XML, a suite an agent: for continuous integration."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from ciberrato.plaintext import plain, xml_text

if TYPE_CHECKING:
    from ciberrato.grading.course import Course
    from ciberrato.grading.runner import Graded
    from ciberrato.grading.standing import Standing

_NOTHING: tuple[int, ...] = (0, 0, 0, 0)


def junit_document(course: Course, ranked: Sequence[Standing]) -> str:
    """Write the document.

    A run is an error if its agent did not register or was not built, a failure if it did not live through
    the run or got fewer points than the course's ``passing``. Times are those of the simulation.

    Parameters
    ----------
    course : Course
    ranked : sequence of Standing

    Returns
    -------
    str
    """
    root = ElementTree.Element("testsuites", name=xml_text(plain(course.title)))
    whole = _NOTHING
    for standing in ranked:
        suite = ElementTree.SubElement(root, "testsuite", name=xml_text(plain(standing.agent)))
        counts = _NOTHING
        for run, points in standing.runs:
            kind = _case(course, suite, run, points)
            counts = _sum(counts, (1, kind == "failure", kind == "error", _milliseconds(run)))
        _count(suite, counts)
        whole = _sum(whole, counts)
    _count(root, whole)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _sum(one: Sequence[int], other: Sequence[int]) -> tuple[int, ...]:
    return tuple(map(sum, zip(one, other, strict=True)))


def _count(element: ElementTree.Element, counts: Sequence[int]) -> None:
    """Set the counts of tests, failures and errors, and the time; no test is ever skipped."""
    for name, count in zip(("tests", "failures", "errors"), counts, strict=False):
        element.set(name, str(count))
    element.set("skipped", "0")
    element.set("time", _seconds(counts[-1]))


def _milliseconds(run: Graded) -> int:
    return run.outcome.time * run.outcome.cycle_time


def _seconds(milliseconds: int) -> str:
    return f"{milliseconds / 1000.0:.2f}"


def _case(course: Course, suite: ElementTree.Element, run: Graded, points: float) -> str | None:
    task, outcome = run.task, run.outcome
    case = ElementTree.SubElement(
        suite,
        "testcase",
        classname=xml_text(plain(f"{task.agent.name}.{task.lab.name}")),
        name=xml_text(plain(run.name)),
        time=_seconds(_milliseconds(run)),
    )
    kind, why = None, ""
    passing = course.points.passing
    words = f"{outcome.status}{': ' * bool(outcome.detail)}{outcome.detail}"
    if not outcome.registered:
        kind, why = "error", words
    elif not outcome.good:
        kind, why = "failure", words
    elif passing is not None and points < passing:
        kind, why = "failure", f"{points:g} points, {passing:g} were needed"
    if kind is not None:
        # What it is, without the cycle.
        type_ = re.sub(r" (at|since) \d+$", "", outcome.status) if not outcome.good else "points"
        fault = ElementTree.SubElement(case, kind, message=xml_text(why), type=type_)
        fault.text = xml_text(
            f"{why}; score {outcome.score}, {outcome.collisions} collisions, time {outcome.time}"
        )
    if run.measured.get("tail"):
        ElementTree.SubElement(case, "system-out").text = xml_text(run.measured["tail"])
    return kind
