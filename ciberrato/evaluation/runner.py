"""Runs tasks on all cores, or on a cluster, and keeps every outcome as soon as it is there.

Outcomes go to a file of JSON Lines, one line a task. What is in it already is not run again, so that an
evaluation that was interrupted goes on where it was; a torn last line is run again, and so is a task that
failed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, NamedTuple, TextIO

from ciberrato.errors import CiberratoError, LabError
from ciberrato.evaluation.attempt import Failure, Result, attempt
from ciberrato.evaluation.task import Outcome, Task
from ciberrato.evaluation.workers import worker_processes
from ciberrato.files.atomic import cut_torn_line
from ciberrato.progress import ProgressBar
from ciberrato.reprs import short_repr
from ciberrato.system.process import processors


class Evaluation(NamedTuple):
    """Outcomes and failures of some tasks."""

    results: list[Result]
    failures: list[Failure]

    def __repr__(self) -> str:
        return short_repr(self)


def read_evaluation(path: Path) -> Evaluation:
    """Read outcomes back.

    Parameters
    ----------
    path : Path
        A file that is not there holds none.

    Returns
    -------
    Evaluation
        Every task once; one that failed and was run again later counts by what came of it last.

    Raises
    ------
    LabError
        If a line other than the last is not an outcome.
    """
    if not path.exists():
        return Evaluation([], [])
    lines = path.read_bytes().split(b"\n")
    lines.pop()  # empty, or torn
    last: dict[str, Result | Failure] = {}
    for number, line in enumerate(lines, start=1):
        try:
            document = json.loads(line)
            task = Task(**document["task"])
            if "error" in document:
                last[task.key] = Failure(task, str(document["error"]))
            else:
                last[task.key] = Result(task, Outcome(**document["outcome"]))
        except (ValueError, KeyError, TypeError) as error:
            raise LabError(f"not an outcome: {error}", source=str(path), line=number) from None
    return _sorted_out(last.values())


def run_tasks(
    tasks: Sequence[Task],
    path: Path,
    *,
    jobs: int = 0,
    scheduler: str | None = None,
    progress: TextIO | None = sys.stderr,
) -> Evaluation:
    """Run the tasks that have no outcome yet.

    Parameters
    ----------
    tasks : sequence of Task
    path : Path
        File of outcomes, appended to.
    jobs : int
        Processes; 0 = as many as there are cores.
    scheduler : str or None
        Address of a Dask scheduler whose workers run the tasks instead.
    progress : text stream or None
        For the progress bar.

    Returns
    -------
    Evaluation
        Results and failures in the order of the tasks, results of earlier runs included.

    Raises
    ------
    UsageError
        If the scheduler or its workers cannot do this.
    CiberratoError
        If a process of ours was killed.
    """
    tasks = list(dict.fromkeys(tasks))
    known: dict[str, Result | Failure] = {result.task.key: result for result in read_evaluation(path).results}
    missing = [task for task in tasks if task.key not in known]
    bar = ProgressBar(len(missing), progress)
    cut_torn_line(path)
    with path.open("ab", buffering=0) as file:
        for result in _outcomes(missing, jobs, scheduler):
            document: dict[str, Any] = {"task": dataclasses.asdict(result.task)}
            if isinstance(result, Result):
                document["outcome"] = result.outcome.to_json()
            else:
                document["error"] = result.error
            file.write(json.dumps(document, separators=(",", ":")).encode() + b"\n")
            known[result.task.key] = result
            bar.step()
    bar.close()
    return _sorted_out(known[task.key] for task in tasks)


def _sorted_out(all_of_them: Any) -> Evaluation:
    evaluation = Evaluation([], [])
    for one in all_of_them:
        if isinstance(one, Result):
            evaluation.results.append(one)
        else:
            evaluation.failures.append(one)
    return evaluation


def _outcomes(tasks: list[Task], jobs: int, scheduler: str | None) -> Iterator[Result | Failure]:
    if not tasks:
        return iter(())
    if scheduler is not None:
        from ciberrato.evaluation.cluster import on_cluster

        return on_cluster(tasks, scheduler)
    # Tasks of one lab one after the other, so that each process loads its tables once.
    ordered = sorted(tasks, key=lambda task: (task.lab, task.drive == "right", task.resolution))
    workers = min(jobs or processors(), len(ordered))
    if workers == 1:
        return map(attempt, ordered)
    return _in_pool(ordered, workers)


def _in_pool(tasks: list[Task], workers: int) -> Iterator[Result | Failure]:
    """Submit the tasks one by one, so that all processes end together."""
    from ciberrato.evaluation.episode import tables_needed

    with _named_if_killed(), worker_processes(workers) as executor:
        # Before the first run, or each process would compute the same tables for itself.
        needed = dict.fromkeys(tables for task in tasks for tables in tables_needed(task))
        wait([executor.submit(_prepare, *tables) for tables in needed])
        waiting = iter(tasks)
        running: set[Future[Result | Failure]] = set()
        while True:
            while len(running) < 2 * workers and (task := next(waiting, None)) is not None:
                running.add(executor.submit(attempt, task))
            if not running:
                break
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()


@contextlib.contextmanager
def _named_if_killed() -> Iterator[None]:
    try:
        yield
    except BrokenProcessPool:
        raise CiberratoError("a process was killed (memory?); the same command continues from here") from None


def _prepare(lab: str, angles: tuple[float, ...], resolution: float) -> None:
    from ciberrato.evaluation.episode import prepare

    try:
        prepare(lab, angles, resolution)
    except Exception:
        return  # the tasks that need these tables will say so
