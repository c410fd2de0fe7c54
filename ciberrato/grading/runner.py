"""Does the runs of a course side by side, and keeps each as soon as it is done.

A line of JSON a run: what is in the file already is not run again, as long as nothing has changed that it
depends on. A torn last line is run again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, TextIO, TypeVar

from ciberrato.errors import LabError, UsageError
from ciberrato.files.atomic import cut_torn_line
from ciberrato.grading.cgroups import Groups
from ciberrato.grading.course import Course
from ciberrato.grading.launch import Launcher, RunError
from ciberrato.grading.leftovers import temporary_folder
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.task import Task
from ciberrato.progress import ProgressBar
from ciberrato.reprs import short_repr
from ciberrato.system.locks import hold
from ciberrato.system.process import processors

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Graded:
    """A run that was done.

    Attributes
    ----------
    task : Task
    outcome : Outcome
    measured : dict
        ``wall`` (seconds), ``memory`` (bytes), ``threads``, ``output`` (bytes), ``exit``, ``signal``,
        ``tail`` (the last words); some may be missing.
    """

    __repr__ = short_repr

    task: Task
    outcome: Outcome
    measured: dict[str, Any]

    @property
    def name(self) -> str:
        """Number of the run among the agent's runs, as text."""
        return f"{self.task.lab.name}, seed {self.task.seed}"

    @property
    def row(self) -> str:
        """Name of the row in a report's page."""
        return self.task.file

    def extra(self) -> dict[str, Any]:
        """Return further columns of the results."""
        return {}


def read_runs(path: Path) -> dict[str, tuple[Outcome, dict[str, Any]]]:
    """Read what was done.

    Parameters
    ----------
    path : Path
        A file that is not there holds nothing.

    Returns
    -------
    dict
        Outcome and measurements by the task's key.

    Raises
    ------
    LabError
        If a line other than the last is no run.
    """
    return read_kept(path, outcome_of)


def outcome_of(document: dict[str, Any]) -> tuple[Outcome, dict[str, Any]]:
    """Return outcome and measurements of an agent from what was kept of a run."""
    return Outcome(**document["outcome"]), dict(document["measured"])


def read_kept(path: Path, content: Callable[[dict[str, Any]], T]) -> dict[str, T]:
    """Read a file of runs, a line of JSON each; a torn last line is left out.

    Parameters
    ----------
    path : Path
        A file that is not there holds nothing.
    content : callable
        Returns what is wanted of a line's document.

    Returns
    -------
    dict
        By the lines' keys.

    Raises
    ------
    LabError
        If a line other than the last is no run.
    """
    done: dict[str, T] = {}
    if not path.exists():
        return done
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        try:
            document = json.loads(line)
            done[document["key"]] = content(document)
        except (ValueError, KeyError, TypeError) as error:
            raise LabError(f"not a run: {error}; delete the line", source=str(path), line=number) from None
    return done


def grade(
    course: Course,
    tasks: Sequence[Task],
    folder: Path,
    *,
    sandbox: str,
    jobs: int,
    progress: TextIO | None,
    scheduler: str | None = None,
    groups: Groups | None = None,
) -> list[str]:
    """Execute the runs that are missing.

    Parameters
    ----------
    course : Course
    tasks : sequence of Task
    folder : Path
        Folder of ``runs.jsonl`` and ``recordings``; made if it is not there.
    sandbox : {"bwrap", "docker", "podman", "none"}
        With a scheduler also ``auto``: each worker chooses.
    jobs : int
        Runs at a time.
    progress : text stream or None
        For a bar.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers do the runs.
    groups : Groups, optional
        Control groups for the agents.

    Returns
    -------
    list of str
        A line for each run that could not be.

    Raises
    ------
    UsageError
        If the folder cannot be written to, or an agent's files cannot be copied.
    """
    path, recordings = folder / "runs.jsonl", folder / "recordings"
    file = open_runs(path, recordings)
    done = read_runs(path)
    missing = [task for task in tasks if task.key not in done]
    faults: list[str] = []
    bar = ProgressBar(len(missing), progress)
    with file, temporary_folder() as temporary:
        launcher = Launcher(course, sandbox, recordings, temporary)
        if groups is not None:
            launcher.groups = groups

        def note(task: Task, get: Callable[[], tuple[Outcome, dict[str, Any]]]) -> None:
            try:
                outcome, measured = get()
            except RunError as error:
                # A server's output is for all to see.
                where = f"{task.lab.name}, seed {task.seed}"
                where = "a hidden run" if course.hides(task.lab, task.seed) else where
                faults.append(f"{task.agent.name}, {where}: {error}")
                return
            document = {
                "key": task.key,
                "agent": task.agent.name,
                "lab": task.lab.name,
                "seed": task.seed,
                **({"commit": task.agent.commit} if task.agent.commit else {}),
                "outcome": asdict(outcome),
                "measured": measured,
            }
            add_run(file, document)
            bar.step()

        def keep(task: Task, future: Future[tuple[Outcome, dict[str, Any]]]) -> None:
            note(task, future.result)

        if scheduler is None:
            side_by_side(missing, launcher.run, launcher.end, jobs, keep)
        elif missing:
            from ciberrato.grading.cluster import on_cluster

            for task, answer in on_cluster(course, missing, sandbox, scheduler, recordings):
                note(task, partial(_answer, answer))
    bar.close()
    return faults


def _answer(answer: tuple[Outcome, dict[str, Any]] | RunError) -> tuple[Outcome, dict[str, Any]]:
    if isinstance(answer, RunError):
        raise answer
    return answer


def open_runs(path: Path, recordings: Path) -> BinaryIO:
    """Open the file of runs to add to it, without a torn last line; and make the recordings' folder.

    Raises
    ------
    UsageError
        If that cannot be, or another grading has it open.
    """
    try:
        recordings.mkdir(parents=True, exist_ok=True)
        file = path.open("ab", buffering=0)
        if not hold(file):
            file.close()
            raise UsageError(
                f"{path.parent}: another grading is at work there; wait, or name another --output"
            )
        cut_torn_line(path)
    except OSError as error:
        raise UsageError(f"{path.parent}: cannot be written: {error.strerror}") from None
    return file


def add_run(file: BinaryIO, document: dict[str, Any]) -> None:
    """Add a run to the file, a line of JSON.

    Raises
    ------
    UsageError
        If there is no room for it; a part that was written is a torn line, which the next grading cuts off.
    """
    line = json.dumps(document, separators=(",", ":")).encode() + b"\n"
    try:
        written = file.write(line)
    except OSError as error:
        raise UsageError(f"{file.name}: cannot be written: {error.strerror}") from None
    if written != len(line):
        raise UsageError(f"{file.name}: cannot be written: there is no room")


def side_by_side(
    tasks: Sequence[T],
    do: Callable[[T], R],
    end: Callable[[], None],
    jobs: int,
    keep: Callable[[T, Future[R]], None],
) -> None:
    """Run tasks in threads, a given number at a time.

    Parameters
    ----------
    tasks : sequence
    do : callable
        Does one.
    end : callable
        Ends those that go on; called at the end, and when something interrupts.
    jobs : int
    keep : callable
        Told of each as soon as it is done, in this thread.
    """
    executor = ThreadPoolExecutor(jobs)
    running: dict[Future[R], T] = {}
    waiting = iter(tasks)
    try:
        while True:
            while len(running) < jobs and (task := next(waiting, None)) is not None:
                running[executor.submit(do, task)] = task
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                keep(running.pop(future), future)
    finally:
        end()
        executor.shutdown(cancel_futures=True)


def jobs_by_default(*, lockstep: bool) -> int:
    """Return how many runs there are at a time: in real time one for two processors, as clocks count."""
    return max(1, processors() if lockstep else processors() // 2)
