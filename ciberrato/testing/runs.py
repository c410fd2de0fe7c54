"""A run of an agent, and what came of it."""

from __future__ import annotations

import filecmp
import json
import os
import shutil
import tempfile
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ciberrato.files.lab import read_lab
from ciberrato.grading.course import Agent, Course, GradedLab, Limits, Points
from ciberrato.grading.expressions import Formula
from ciberrato.grading.launch import MEASURED, Launcher
from ciberrato.grading.outcome import Outcome, exit_words, judge
from ciberrato.grading.task import Task
from ciberrato.grading.workspace import stage_folder
from ciberrato.reprs import cut

if TYPE_CHECKING:
    from ciberrato.testing.truth import Truth

_GRACE = 3.0
"""Seconds that an agent may go on after its run: the courses' clients notice the end after two."""


@dataclass(frozen=True)
class AgentRun:
    """Outcome of a run.

    Attributes
    ----------
    command : tuple of str
        With its placeholders.
    lab : str
    seed : int
    status : str
        In words: ``finished``, ``time over``, ``crashed at N``, ``left at N``, ``silent since N``, ``stopped
        at N``, ``never registered`` or ``not built``.
    detail : str
        More of it: the exit status, the limit.
    score, visited, targets, collisions : int
        As the simulator counts them; targets visited, and those of the lab.
    arrival_time, returning_time : int
        Cycles; they go on counting until the robot has arrived, or returned.
    time : int
        Cycles run.
    answered, unanswered, late : int
        Cycles, and answers that came after their cycle.
    mapping, planning : float or None
        Points of its mapping.out and planning.out, where the scoring mode asks for them.
    exit_status : int or None
        None if a signal, a limit, or the end of the run ended it.
    signal : int or None
    output : str
        Standard output and error.
    seconds : float
        By the clock on the wall.
    memory : int
        Bytes at most.
    folder : Path
        Folder with the files of the run: ``log.xml``, ``truth.csv``, ``result.json``, ``parameters.xml``, and
        ``work`` with the files that the agent wrote or changed.
    """

    command: tuple[str, ...]
    lab: str
    seed: int
    status: str
    detail: str
    score: int
    visited: int
    targets: int
    collisions: int
    arrival_time: int
    returning_time: int
    time: int
    answered: int
    unanswered: int
    late: int
    mapping: float | None
    planning: float | None
    exit_status: int | None
    signal: int | None
    output: str
    seconds: float
    memory: int
    folder: Path
    _world: GradedLab
    _lockstep: bool

    @property
    def finished(self) -> bool:
        """Return whether the robot has switched its End LED on."""
        return self.status == "finished"

    @property
    def arrived(self) -> bool:
        """Return whether the robot has visited all targets."""
        return self.targets > 0 and self.visited == self.targets

    @property
    def log(self) -> Path:
        """The simulator's log, which `ciberrato-viewer --run` shows."""
        return self.folder / "log.xml"

    @cached_property
    def truth(self) -> Truth:
        """True path of the robot: arrays ``time``, ``x``, ``y``, ``degrees``."""
        from ciberrato.testing.truth import truth_arrays

        return truth_arrays(self.folder / "truth.csv")

    @cached_property
    def files(self) -> dict[str, Path]:
        """The files that it wrote or changed in its working folder, by their names, as ``mapping.out``."""
        work = self.folder / "work"
        paths = sorted(path for path in work.rglob("*") if path.is_file())
        return {path.relative_to(work).as_posix(): path for path in paths}

    def __repr__(self) -> str:
        detail = f" ({self.detail})" if self.detail else ""
        return cut(
            f"<run in {self.lab}, seed {self.seed}: {self.status}{detail}, score {self.score}, "
            f"{self.collisions} collisions, {self.time} cycles>"
        )


class _Kept(Launcher):
    """Does runs of which everything is kept."""

    def _simulator(self, task: Task, folder: Path, host: str, port: int) -> list[str]:
        words = super()._simulator(task, folder, host, port)
        return [*words, "--truth", str(folder / "truth.csv"), "--reproducible"]

    def _wanted(self, task: Task, files: Path | None, folder: Path, port: int) -> dict[str, Any]:
        output = int(self._course.limits.output) * 1024
        return super()._wanted(task, files, folder, port) | {"log": None, "tail": output, "grace": _GRACE}

    def keep(self, folder: Path) -> tuple[Outcome, dict[str, Any]]:
        """Execute the run in `folder`, which must not exist."""
        (agent,), (lab,), (seed,) = self._course.agents, self._course.labs, self._course.seeds
        files, failure = self._files(agent)
        if failure is not None:
            folder.mkdir()
            (folder / "work").mkdir()
            measured: dict[str, Any] = dict.fromkeys(MEASURED, None) | {
                "tail": failure,
                "wall": 0.0,
                "memory": 0,
            }
            return Outcome(status="not built", detail="see its output"), measured
        document = self.document(Task(agent, lab, seed, key="", file="run"), files, folder)
        outcome = judge(
            document,
            targets=len(read_lab(lab.lab).targets),
            cycle_time=0,
            folder=folder / "work",
            reference=folder / "scoring",
            scoring=lab.scoring,
        )
        if outcome.good and not outcome.detail:
            outcome = replace(outcome, detail=exit_words(document))
        return outcome, document


def run_agent(
    agent: Agent,
    lab: GradedLab,
    seed: int,
    folder: Path,
    *,
    lockstep: bool,
    speed: float,
    answer_limit: float | None,
    limits: Limits,
    sandbox: str,
) -> AgentRun:
    """Run an agent once.

    Parameters
    ----------
    agent : Agent
        Its folder is copied, and not written to.
    lab : GradedLab
    seed : int
    folder : Path
        Folder for all files; must not exist.
    lockstep : bool
    speed : float
        Times real time, if not in lockstep.
    answer_limit : float or None
        Seconds that lockstep waits for an answer; None = as the simulator does by default.
    limits : Limits
    sandbox : {"auto", "bwrap", "none"}

    Returns
    -------
    AgentRun

    Raises
    ------
    CiberratoError
        If the run could not be, through no fault of the agent's.
    """
    from ciberrato.grading.sandbox import choose

    assert agent.folder is not None
    with tempfile.TemporaryDirectory(prefix="ciberrato-run-", ignore_cleanup_errors=True) as name:
        staged = Path(name) / "agent"
        stage_folder(agent.folder, staged)
        points = Points(Formula("0", frozenset()))
        course = Course(
            *("test", (replace(agent, folder=staged),), (lab,), (seed,), lockstep, speed, answer_limit),
            *(limits, points),
        )
        launcher = _Kept(course, choose(sandbox), Path(name), Path(name))
        try:
            outcome, measured = launcher.keep(folder)
        finally:
            launcher.end()
        _leave_changes(folder / "work", staged)
    shutil.rmtree(folder / "scoring", ignore_errors=True)
    names = (
        "status",
        "detail",
        "score",
        "visited",
        "targets",
        "collisions",
        "arrival_time",
        "returning_time",
    )
    counts = ("time", "answered", "unanswered", "late", "mapping", "planning")
    return AgentRun(
        command=agent.command,
        lab=lab.name,
        seed=seed,
        **{one: getattr(outcome, one) for one in (*names, *counts)},
        exit_status=measured["exit"],
        signal=measured["signal"],
        output=measured["tail"],
        seconds=measured["wall"],
        memory=measured["memory"],
        folder=folder,
        _world=lab,
        _lockstep=lockstep,
    )


def _leave_changes(work: Path, before: Path) -> None:
    """Remove from a folder all that is the same as before."""
    for place, folders, names in os.walk(work, topdown=False):
        for name in (*names, *folders):
            path = Path(place, name)
            former = before / path.relative_to(work)
            if path.is_symlink():
                if former.is_symlink() and os.readlink(path) == os.readlink(former):
                    path.unlink()
            elif path.is_dir():
                if former.is_dir() and not any(path.iterdir()):
                    path.rmdir()
            elif path.is_file() and former.is_file() and filecmp.cmp(path, former, shallow=False):
                path.unlink()


def result_of(folder: Path) -> dict[str, Any] | None:
    """Read the last run of a simulator's result file; None if there is none."""
    try:
        runs = json.loads((folder / "result.json").read_text(encoding="utf-8"))["runs"]
    except (OSError, ValueError, KeyError):
        return None
    return dict(runs[-1]) if runs else None
