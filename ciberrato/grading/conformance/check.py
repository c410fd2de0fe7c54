"""Puts an agent through the rows, side by side, each in a run of its own."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ciberrato.errors import UsageError, did_you_mean
from ciberrato.grading.conformance.examiner import examiner_command
from ciberrato.grading.conformance.rows import END, NAMES, ROWS, Row
from ciberrato.grading.course import Agent, Course, GradedLab, Limits, Points
from ciberrato.grading.expressions import Formula
from ciberrato.grading.launch import Launcher
from ciberrato.grading.outcome import exit_words
from ciberrato.grading.task import Task
from ciberrato.reprs import short_repr

PATIENCE = 2.0
"""Default of the longest time for an answer, in seconds."""

_ERRORS = ("Traceback (most recent call last)", "terminate called", "Exception in thread")
"""Words of a program that has ended by an error, whatever its status."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A row, and how the agent did.

    Attributes
    ----------
    row : Row
    passed : bool
    happened : str
        In a line.
    output : str
        The agent's last words.
    """

    __repr__ = short_repr

    row: Row
    passed: bool
    happened: str
    output: str


def rows_named(names: Sequence[str]) -> list[Row]:
    """Find rows by their names, in the check's order.

    Parameters
    ----------
    names : sequence of str
        Empty = all.

    Raises
    ------
    UsageError
        If there is no such row.
    """
    for name in names:
        if name not in NAMES:
            raise UsageError(
                f"{name!r}: no such row; choose one of {', '.join(NAMES)}{did_you_mean(name, NAMES)}"
            )
    return [row for row in ROWS if not names or row.name in names]


def check_agent(
    agent: Agent,
    lab: GradedLab,
    *,
    rows: Sequence[Row] = ROWS,
    seed: int = 1,
    patience: float = PATIENCE,
    limits: Limits | None = None,
    sandbox: str = "none",
    jobs: int = 1,
    readable: tuple[Path, ...] = (),
    step: Callable[[], None] = lambda: None,
) -> list[Judged]:
    """Check an agent on rows of the conformance table.

    Parameters
    ----------
    agent : Agent
    lab : GradedLab
        Lab in which it drives.
    rows : sequence of Row
    seed : int
        Seed of the simulation.
    patience : float
        Seconds that an answer may take.
    limits : Limits, optional
    sandbox : {"bwrap", "none"}
    jobs : int
        Rows at a time.
    readable : tuple of Path
        Files and folders that a sandbox shows besides the system and Python.
    step : callable
        Called after each row.

    Returns
    -------
    list of Judged
        In the order of the rows.

    Raises
    ------
    RunError
        If a row could not be, through no fault of the agent's.
    UsageError
        If the agent's files cannot be copied.
    """
    limits = limits or Limits(time=120.0)
    course = Course(
        *("check", (agent,), (lab,), (seed,), True, 1.0, None, limits, Points(Formula("0", frozenset()))),
        readable=readable,
    )
    with tempfile.TemporaryDirectory(prefix="ciberrato-check-", ignore_cleanup_errors=True) as name:
        examiner = _Examiner(course, sandbox, Path(name), patience)

        def one(row: Row) -> Judged:
            judged = examiner.examine(row)
            step()
            return judged

        executor = ThreadPoolExecutor(jobs)
        try:
            return list(executor.map(one, rows))
        finally:
            examiner.end()
            executor.shutdown(cancel_futures=True)


class _Examiner(Launcher):
    """Does runs in which the examiner has the simulator's place."""

    def __init__(self, course: Course, kind: str, temporary: Path, patience: float) -> None:
        super().__init__(course, kind, temporary, temporary)
        self._patience = patience

    def examine(self, row: Row) -> Judged:
        """Check one row."""
        (agent,), (lab,), (seed,) = self._course.agents, self._course.labs, self._course.seeds
        files, failure = self._files(agent)
        if failure is not None:
            return Judged(row, False, "the build command failed", failure)
        task = Task(agent, lab, seed, key=row.name, file=row.name)
        document = self.document(task, files, self._temporary / row.name)
        passed, happened = judge_row(row, document, self._course.limits.registration)
        return Judged(row, passed, happened, document["tail"])

    def _simulator(self, task: Task, folder: Path, host: str, port: int) -> list[str]:
        lab = task.lab
        return examiner_command(
            row=task.key,
            host=host,
            port=port,
            lab=str(lab.lab),
            grid=None if lab.grid is None else str(lab.grid),
            parameters=str(folder / "parameters.xml"),
            seed=task.seed,
            patience=self._patience,
            result=str(folder / "result.json"),
        )

    def _wanted(self, task: Task, files: Path | None, folder: Path, port: int) -> dict[str, Any]:
        return super()._wanted(task, files, folder, port) | {"log": None}


def judge_row(row: Row, document: dict[str, Any], registration: float) -> tuple[bool, str]:
    """Return the verdict on a row.

    Parameters
    ----------
    row : Row
    document : dict
        Document that `ciberrato.grading.supervisor` writes, with the examiner's observations as its ``run``.
    registration : float
        Seconds that there were for it.

    Returns
    -------
    passed : bool
    happened : str
    """
    run, ended = document["run"], exit_words(document)
    if run is not None and run["fault"] is not None:
        return False, run["fault"] + (f"; it ended: {ended}" if ended else "")
    if not document["registered"]:
        late = (document["stopped"] or "").startswith("not registered")
        never = f"no registration came within {registration:g} s" if late else document["stopped"]
        return False, document["note"] or never or f"it ended before it had registered: {ended}"
    if run is None:
        return False, document["stopped"] or "the row did not come to its end"
    error = next((words for words in _ERRORS if words in document["tail"]), None)
    if run["ending"] == "any":
        return True, run["seen"]
    if document["signal"]:
        return False, f"{run['seen']}; it was ended by {ended}"
    if not ended:
        return False, f"{run['seen']}; it was still running {END:g} s later"
    if run["ending"] == "clean" and (error is not None or document["exit"] not in (0, 1)):
        return False, f"{run['seen']}; it ended by an error: {ended}"
    if error is not None:
        return True, f"{run['seen']}; it ended: {ended}, with an error message that could be kinder"
    return True, f"{run['seen']}; it ended: {ended}"
