"""Does the runs of a course side by side, and keeps each as soon as it is done.

A line of JSON a run: what is in the file already is not run again, as long as nothing has changed that it
depends on. A torn last line is run again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TextIO

from ciberrato.errors import LabError, UsageError
from ciberrato.files.atomic import cut_torn_line
from ciberrato.grading.course import Course
from ciberrato.grading.launch import Launcher, RunError
from ciberrato.grading.leftovers import temporary_folder
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.task import Task
from ciberrato.progress import ProgressBar


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

    task: Task
    outcome: Outcome
    measured: dict[str, Any]


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
    done: dict[str, tuple[Outcome, dict[str, Any]]] = {}
    if not path.exists():
        return done
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], 1):
        try:
            document = json.loads(line)
            done[document["key"]] = Outcome(**document["outcome"]), dict(document["measured"])
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
) -> list[str]:
    """Do the runs that are missing.

    Parameters
    ----------
    course : Course
    tasks : sequence of Task
    folder : Path
        Where ``runs.jsonl`` and ``recordings`` are, or are made.
    sandbox : {"bwrap", "none"}
    jobs : int
        Runs at a time.
    progress : text stream or None
        For a bar.

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
    try:
        recordings.mkdir(parents=True, exist_ok=True)
        cut_torn_line(path)
        file = path.open("ab", buffering=0)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror}") from None
    done = read_runs(path)
    missing = [task for task in tasks if task.key not in done]
    faults: list[str] = []
    bar = ProgressBar(len(missing), progress)
    with file, temporary_folder() as temporary:
        launcher = Launcher(course, sandbox, recordings, temporary)

        def keep(task: Task, future: Future[tuple[Outcome, dict[str, Any]]]) -> None:
            try:
                outcome, measured = future.result()
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
            file.write(json.dumps(document, separators=(",", ":")).encode() + b"\n")
            bar.step()

        _side_by_side(missing, launcher, jobs, keep)
    bar.close()
    return faults


def _side_by_side(
    tasks: Sequence[Task],
    launcher: Launcher,
    jobs: int,
    keep: Callable[[Task, Future[tuple[Outcome, dict[str, Any]]]], None],
) -> None:
    executor = ThreadPoolExecutor(jobs)
    running: dict[Future[tuple[Outcome, dict[str, Any]]], Task] = {}
    waiting = iter(tasks)
    try:
        while True:
            while len(running) < jobs and (task := next(waiting, None)) is not None:
                running[executor.submit(launcher.run, task)] = task
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                keep(running.pop(future), future)
    finally:
        launcher.end()
        executor.shutdown(cancel_futures=True)


def jobs_by_default(*, lockstep: bool) -> int:
    """Return how many runs there are at a time: in real time one for two processors, as clocks count."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, cores if lockstep else cores // 2)
