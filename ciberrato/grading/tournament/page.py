"""The report of a tournament: that of a grading, with who met whom."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ciberrato.grading.course import Course
from ciberrato.grading.report import write_report
from ciberrato.grading.standing import Standing
from ciberrato.grading.tournament.table import Played


def write_tournament(
    course: Course, ranked: Sequence[Standing], runs: Sequence[Played], folder: Path, *, missing: int
) -> None:
    write_report(course, ranked, folder, missing=missing)
