"""Runs tasks on all cores, or on a cluster, and keeps every outcome as soon as it is there.

Outcomes go to a file of JSON Lines, one line a task. What is in it already is not run again, so that an
evaluation that was interrupted goes on where it was; a torn last line is run again.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from ciberrato.errors import LabError, UsageError
from evaluation.task import Outcome, Task

_BAR = 30

Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class Result:
    """A task and what came of it."""

    task: Task
    outcome: Outcome


def read_results(path: Path) -> list[Result]:
    """Read outcomes back.

    Parameters
    ----------
    path : Path
        A file that is not there holds none.

    Returns
    -------
    list of Result

    Raises
    ------
    LabError
        If a line other than the last is not an outcome.
    """
    if not path.exists():
        return []
    lines = path.read_bytes().split(b"\n")
    lines.pop()  # empty, or torn
    results = []
    for number, line in enumerate(lines, start=1):
        try:
            document = json.loads(line)
            results.append(Result(Task(**document["task"]), Outcome(**document["outcome"])))
        except (ValueError, KeyError, TypeError) as error:
            raise LabError(f"not an outcome: {error}", source=str(path), line=number) from None
    return results


def run_tasks(
    tasks: Sequence[Task],
    path: Path,
    *,
    jobs: int = 0,
    scheduler: str | None = None,
    progress: TextIO | None = sys.stderr,
) -> list[Result]:
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
    list of Result
        One for each task, in their order, those of earlier runs included.
    """
    import dataclasses

    known = {result.task.key: result for result in read_results(path)}
    missing = [task for task in dict.fromkeys(tasks) if task.key not in known]
    bar = _Bar(len(missing), progress)
    _mend(path)
    with path.open("ab", buffering=0) as file:
        for task, outcome in _outcomes(missing, jobs, scheduler):
            document: dict[str, Any] = {"task": dataclasses.asdict(task), "outcome": outcome.to_json()}
            file.write(json.dumps(document, separators=(",", ":")).encode() + b"\n")
            known[task.key] = Result(task, outcome)
            bar.step()
    bar.close()
    return [known[task.key] for task in tasks]


def _mend(path: Path) -> None:
    """Cut off a torn last line."""
    if path.exists():
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if whole != data:
            path.write_bytes(whole)


def _outcomes(tasks: list[Task], jobs: int, scheduler: str | None) -> Iterator[tuple[Task, Outcome]]:
    if not tasks:
        return iter(())
    if scheduler is not None:
        return _on_cluster(tasks, scheduler)
    # Tasks of one lab one after the other, so that each process loads its tables once.
    ordered = sorted(tasks, key=lambda task: (task.lab, task.drive == "right", task.resolution))
    workers = min(jobs or os.cpu_count() or 1, len(ordered))
    if workers == 1:
        return map(_run, ordered)
    return _in_pool(ordered, workers)


def _in_pool(tasks: list[Task], workers: int) -> Iterator[tuple[Task, Outcome]]:
    context = multiprocessing.get_context("spawn")
    with context.Pool(workers) as pool:
        yield from pool.imap_unordered(_run, tasks, chunksize=max(min(len(tasks) // (8 * workers), 10), 1))


def _on_cluster(tasks: Iterable[Task], address: str) -> Iterator[tuple[Task, Outcome]]:
    try:
        from distributed import Client, as_completed  # type: ignore[import-not-found, unused-ignore]
    except ImportError:
        raise UsageError("--scheduler needs the package `distributed` (Dask)") from None
    try:
        client = Client(address, timeout="10s")
    except OSError as error:
        raise UsageError(f"--scheduler {address}: {error}") from None
    with client:
        futures = client.map(_run, list(tasks), pure=False)
        for future in as_completed(futures):
            yield future.result()


def _run(task: Task) -> tuple[Task, Outcome]:
    from evaluation.episode import run_task

    return task, run_task(task)


class _Bar:
    """A line that says how far things are, and when they will be done."""

    def __init__(self, total: int, stream: TextIO | None, clock: Clock = time.monotonic) -> None:
        self._total, self._done, self._stream, self._clock = total, 0, stream, clock
        self._began = clock()
        self._shown = -1.0

    def step(self) -> None:
        self._done += 1
        now = self._clock()
        if self._stream is None or (now - self._shown < 0.5 and self._done < self._total):
            return
        self._shown = now
        filled = _BAR * self._done // max(self._total, 1)
        left = (now - self._began) / self._done * (self._total - self._done)
        self._stream.write(
            f"\r[{'#' * filled}{'.' * (_BAR - filled)}] {self._done}/{self._total} runs, {left:.0f} s left "
        )
        self._stream.flush()

    def close(self) -> None:
        if self._stream is not None and self._done:
            self._stream.write("\n")
