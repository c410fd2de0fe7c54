"""One try at a task, and what comes of it: the part that runs in other processes and on other machines."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from ciberrato.errors import CiberratoError
from ciberrato.evaluation.task import Outcome, Task
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True)
class Result:
    """A task and what came of it."""

    __repr__ = short_repr

    task: Task
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class Failure:
    """A task that raised an exception, and which."""

    __repr__ = short_repr

    task: Task
    error: str


def attempt(task: Task, folder: str | None = None) -> Result | Failure:
    """Run a task; what it raises is part of what comes of it.

    Parameters
    ----------
    task : Task
    folder : str, optional
        In which a filter or a drive that others wrote is looked for, too, on another machine: last, and only
        for a task that names one.

    Returns
    -------
    Result or Failure
    """
    if folder is not None and task.code and folder not in sys.path:
        sys.path.append(folder)
    from ciberrato.evaluation.episode import run_task
    from ciberrato.localization.belief import compiled

    try:
        compiled.load()  # the same numbers sooner, where numba is there
        return Result(task, run_task(task))
    except CiberratoError as error:
        return Failure(task, str(error))
    except Exception as error:
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        assert trace is not None
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
        return Failure(task, f"{type(error).__name__}: {error} ({place})")
