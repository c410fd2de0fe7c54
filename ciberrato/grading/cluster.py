"""Does runs on the workers of a Dask cluster, which need nothing but this project in the same version.

Agents' files and labs are sent along; recordings come back. A worker builds an agent once.
"""

from __future__ import annotations

import atexit
import contextlib
import dataclasses
import hashlib
import importlib
import io
import tarfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ciberrato.errors import CiberratoError
from ciberrato.evaluation.cluster import check_versions, connect
from ciberrato.grading import sandbox
from ciberrato.grading.course import Course
from ciberrato.grading.launch import Launcher, RunError
from ciberrato.grading.leftovers import temporary_folder
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.task import Task
from ciberrato.grading.workspace import LEFT_OUT
from ciberrato.reprs import short_repr

_LOCK = threading.Lock()
_KEPT = contextlib.ExitStack()
_LAUNCHERS: dict[str, tuple[Launcher, Path]] = {}
"""Of this process, a worker's: by what was sent of an agent."""


@dataclasses.dataclass(frozen=True, slots=True)
class Done:
    """Result of a worker: a run and its recording, or the reason why there is none."""

    __repr__ = short_repr

    outcome: Outcome | None = None
    measured: dict[str, Any] | None = None
    recording: bytes | None = None
    fault: str = ""


def on_cluster(
    course: Course, tasks: Sequence[Task], kind: str, address: str, recordings: Path
) -> Iterator[tuple[Task, tuple[Outcome, dict[str, Any]] | RunError]]:
    """Run tasks on a cluster.

    Parameters
    ----------
    course : Course
    tasks : sequence of Task
    kind : {"auto", "bwrap", "docker", "none"}
        The sandbox, which each worker must have.
    address : str
        Address of the scheduler.
    recordings : Path
        Folder for the recordings.

    Yields
    ------
    task : Task
    outcome and measured, or RunError
        In the order in which they are done.

    Raises
    ------
    UsageError
        If there is no such scheduler, it has no workers, or theirs is another version.
    """
    from ciberrato.files.atomic import replace_file

    with connect(address) as client:
        check_versions(client, address)
        distributed = importlib.import_module("distributed")
        files = {
            agent.name: client.scatter(pack(agent.folder), hash=False)
            for agent in {task.agent.name: task.agent for task in tasks}.values()
        }
        asked = {
            client.submit(
                run_there, course, task, read_files(task), files[task.agent.name], kind, pure=False
            ): task
            for task in tasks
        }
        try:
            for future in distributed.as_completed(list(asked), loop=client.loop):
                task, error = asked.pop(future), future.exception()
                done = Done(fault=f"the worker: {error}") if error is not None else future.result()
                future.release()
                if done.outcome is None or done.measured is None:
                    yield task, RunError(" ".join(done.fault.split()))
                    continue
                if done.recording is not None:
                    replace_file(recordings / f"{task.file}.js", done.recording)
                yield task, (done.outcome, done.measured)
        finally:
            client.cancel(list(asked))


def pack(folder: Path | None) -> bytes | None:
    """Pack an agent's files, so that the same files are the same bytes."""
    if folder is None:
        return None
    target = io.BytesIO()

    def plain(info: tarfile.TarInfo) -> tarfile.TarInfo | None:
        if Path(info.name).name in LEFT_OUT or not (info.isfile() or info.isdir() or info.issym()):
            return None
        info.uid = info.gid = info.mtime = 0
        info.uname = info.gname = ""
        return info

    with tarfile.open(fileobj=target, mode="w", format=tarfile.PAX_FORMAT) as archive:
        archive.add(folder, "files", filter=plain)
    return target.getvalue()


def read_files(task: Task) -> dict[str, bytes]:
    """Read what a run needs of this computer's files, by the names of the lab's entries."""
    named = {name: getattr(task.lab, name) for name in ("lab", "grid", "parameters")}
    return {name: path.read_bytes() for name, path in named.items() if path is not None}


def run_there(course: Course, task: Task, texts: dict[str, bytes], files: bytes | None, kind: str) -> Done:
    """Execute a run on a worker.

    Parameters
    ----------
    course : Course
    task : Task
    texts : dict of str to bytes
        As `read_files` has them.
    files : bytes or None
        As `pack` has them.
    kind : str

    Returns
    -------
    Done
    """
    try:
        launcher, folder = _launcher(course, task, files, kind)
        agent = task.agent if files is None else dataclasses.replace(task.agent, folder=folder / "files")
        paths: dict[str, Any] = {}
        for name, contents in texts.items():
            paths[name] = folder / f"{hashlib.sha256(contents).hexdigest()[:24]}.xml"
            if not paths[name].exists():
                from ciberrato.files.atomic import replace_file

                replace_file(paths[name], contents)
        lab = dataclasses.replace(task.lab, **paths)
        outcome, measured = launcher.run(dataclasses.replace(task, agent=agent, lab=lab))
    except CiberratoError as error:
        return Done(fault=str(error))
    path = folder / "recordings" / f"{task.file}.js"
    recording = path.read_bytes() if path.exists() else None
    path.unlink(missing_ok=True)
    return Done(outcome, measured, recording)


def _launcher(course: Course, task: Task, files: bytes | None, kind: str) -> tuple[Launcher, Path]:
    key = hashlib.sha256(repr((course.limits, course.lockstep, course.answer_limit, course.speed)).encode())
    key.update(repr((course.image, course.readable, task.agent, kind)).encode() + b"\0" + (files or b""))
    with _LOCK:
        if key.hexdigest() not in _LAUNCHERS:
            if not _LAUNCHERS:
                atexit.register(_KEPT.close)
            folder = _KEPT.enter_context(temporary_folder())
            if files is not None:
                with tarfile.open(fileobj=io.BytesIO(files)) as archive:
                    archive.extractall(folder, filter="fully_trusted")
            (folder / "recordings").mkdir()
            (folder / "runs").mkdir()
            alone = dataclasses.replace(course, agents=(task.agent,))
            chosen = sandbox.choose(kind, course.image)
            _LAUNCHERS[key.hexdigest()] = (
                Launcher(alone, chosen, folder / "recordings", folder / "runs"),
                folder,
            )
        return _LAUNCHERS[key.hexdigest()]
