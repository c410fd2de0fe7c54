"""Runs tasks on the workers of a Dask cluster.

The workers need this project installed, in the same version, and the lab files at the same paths, and so
filters and drives that others wrote; all that is asked for before anything is run.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.evaluation.attempt import Failure, Result, attempt
from ciberrato.evaluation.task import Task

_PACKAGES = ("agent", "ciberrato", "simulator_stub")
_PATIENCE = "10s"


def on_cluster(tasks: Sequence[Task], address: str) -> Iterator[Result | Failure]:
    """Run tasks on a cluster.

    Parameters
    ----------
    tasks : sequence of Task
    address : str
        Address of the Dask scheduler.

    Yields
    ------
    Result or Failure
        In the order in which they are done.

    Raises
    ------
    UsageError
        If there is no such scheduler, it has no workers, or they lack what they need.
    """
    with connect(address) as client:
        distributed = importlib.import_module("distributed")
        sent = {task: _for_workers(task) for task in tasks}
        _check_workers(client, address, list(sent.values()))
        asked = dict(
            zip(client.map(attempt, list(sent.values()), folder=os.getcwd(), pure=False), sent, strict=True)
        )
        try:
            for future in distributed.as_completed(list(asked), loop=client.loop):
                yield _answer(future, asked.pop(future))
                future.release()
        finally:
            client.cancel(list(asked))


def connect(address: str) -> Any:
    """Connect to a scheduler.

    Parameters
    ----------
    address : str

    Returns
    -------
    distributed.Client

    Raises
    ------
    UsageError
        If there is none, or `distributed` is not installed.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise UsageError("--scheduler needs the package `distributed` (Dask)") from None
    try:
        # First, what is no address at all: a client that fails for that leaves threads behind.
        importlib.import_module("distributed.comm").resolve_address(address)
        return distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise UsageError(f"--scheduler {address}: {error}") from None


def _answer(future: Any, task: Task) -> Result | Failure:
    error = future.exception()
    if error is not None:  # the worker died, more than once
        return Failure(task, f"{type(error).__name__}: {' '.join(str(error).split())}")
    found: Result | Failure = future.result()
    return dataclasses.replace(found, task=task)


def _for_workers(task: Task) -> Task:
    """Name files by absolute paths: workers run elsewhere. What ships goes by its name."""
    return dataclasses.replace(
        task,
        lab=_absolute(task.lab),
        grid=None if task.grid is None else _absolute(task.grid),
        parameters=_absolute(task.parameters),
    )


def _absolute(name: str) -> str:
    return os.path.abspath(name) if os.path.isfile(name) else name


def check_versions(client: Any, address: str) -> None:
    """Raise an error if a cluster has no workers, or workers whose results would differ."""
    versions = _ask(client, address, _version)
    if not versions:
        raise UsageError(f"--scheduler {address}: it has no workers")
    ours = _version()
    for worker, theirs in versions.items():
        for what, here in ours.items():
            if theirs[what] != here:
                raise UsageError(f"worker {worker}: {what} is {theirs[what]} there, and {here} here")


def _check_workers(client: Any, address: str, tasks: Sequence[Task]) -> None:
    """Raise an error at once if every task would fail on the workers, or its results would differ."""
    check_versions(client, address)
    named = {name for task in tasks for name in (task.lab, task.grid, task.parameters) if name is not None}
    files = sorted(name for name in named if os.path.isabs(name))
    for worker, missing in _ask(client, address, _missing, files).items():
        if missing:
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            raise UsageError(f"worker {worker}: no file {missing[0]}{more}")

    parts = sorted({(task.filter, task.drive, task.code) for task in tasks if task.code})
    for worker, wrong in _ask(client, address, _wrong_part, parts, os.getcwd()).items():
        if wrong:
            raise UsageError(f"worker {worker}: {wrong}")


def _wrong_part(parts: Sequence[tuple[str, str, str]], folder: str) -> str | None:
    """Return which of the user's filters and drives are missing here or differ; None if they agree."""
    from ciberrato.evaluation.judged import code_of

    if parts and folder not in sys.path:
        sys.path.append(folder)
    for judged, drive, code in parts:
        try:
            there = code_of(judged, drive)
        except UsageError as error:
            return str(error)
        if there != code:
            return f"the code of {judged} and {drive} is {there} there, and {code} here"
    return None


def _ask(client: Any, address: str, function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
    try:
        answers = client.run(function, *arguments)
    except Exception as error:  # whatever the worker raised, ImportError above all
        raise UsageError(f"--scheduler {address}: is this project installed there? {error}") from None
    assert isinstance(answers, dict)
    return answers


def _missing(files: Sequence[str]) -> list[str]:
    return [name for name in files if not os.path.isfile(name)]


def _version() -> dict[str, str]:
    """Return what results depend on."""
    import numpy as np

    digest = hashlib.sha256()
    for package in _PACKAGES:
        folder = Path(str(importlib.import_module(package).__file__)).parent
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.xml")]):
            digest.update(path.relative_to(folder).as_posix().encode())
            digest.update(path.read_bytes())
    return {
        "Python": platform.python_version(),
        "numpy": np.__version__,
        "this project's code": digest.hexdigest()[:12],
    }
