"""From a task to a run: temporary folders, command lines, sandbox, and what comes back."""

from __future__ import annotations

import contextlib
import json
import secrets
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ciberrato.client.pace import LOCKSTEP_VARIABLE
from ciberrato.errors import CiberratoError
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import parse_parameters
from ciberrato.grading import containers, sandbox
from ciberrato.grading.cgroups import Groups
from ciberrato.grading.course import Agent, Course, GradedLab, parameters_document
from ciberrato.grading.outcome import Outcome, exit_words, judge
from ciberrato.grading.supervisor import SUPERVISOR
from ciberrato.grading.task import Task
from ciberrato.grading.workspace import copy_folder
from ciberrato.processes import module_command
from ciberrato.system.process import apart
from ciberrato.system.sockets import has_address

FIXED_PORT = 6000
ATTEMPTS = 5
MEASURED = ("wall", "memory", "threads", "output", "exit", "signal", "tail")
NOWHERE = "/agent"
"""Folder of a sandboxed agent without files of its own."""


class RunError(CiberratoError):
    """A run could not be, through no fault of the agent's."""


class Launcher:
    """Does runs of a course.

    Parameters
    ----------
    course : Course
    kind : {"bwrap", "docker", "podman", "none"}
        The sandbox.
    recordings : Path
        Folder of the recordings.
    temporary : Path
        Everything else that is written lies below it.
    """

    def __init__(self, course: Course, kind: str, recordings: Path, temporary: Path) -> None:
        self._course = course
        self._kind = kind
        self._overhead = 2 if kind == "bwrap" else 0  # bwrap itself, outside and inside
        self._recordings = recordings
        self._temporary = temporary
        self._built: dict[str, tuple[Path | None, str | None]] = {}
        self._locks: dict[str, threading.Lock] = {agent.name: threading.Lock() for agent in course.agents}
        self._running: set[subprocess.Popen[bytes]] = set()
        self._ended = False
        self._addresses = _Addresses()
        self.groups = Groups()
        """Control groups that agents are put into."""

    def run(self, task: Task) -> tuple[Outcome, dict[str, Any]]:
        """Execute a run.

        Parameters
        ----------
        task : Task

        Returns
        -------
        outcome : Outcome
        measured : dict
            Time, memory and other measurements, and the agent's last lines of output.

        Raises
        ------
        RunError
            If it could not be.
        """
        files, failure = self._files(task.agent)
        targets = len(read_lab(task.lab.lab).targets)
        text = parameters_document(task.lab.parameters, task.lab.settings)
        cycle_time = parse_parameters(text).cycle_time
        if failure is not None:
            return Outcome(status="not built", detail="see the output", targets=targets), {"tail": failure}
        with tempfile.TemporaryDirectory(dir=self._temporary, ignore_cleanup_errors=True) as name:
            folder = Path(name)
            document = self.document(task, files, folder)
            outcome = judge(
                document,
                targets=targets,
                cycle_time=cycle_time,
                folder=folder / "work",
                reference=folder / "scoring",
                scoring=task.lab.scoring,
            )
        return outcome, {name: document[name] for name in MEASURED}

    def document(self, task: Task, files: Path | None, folder: Path) -> dict[str, Any]:
        """Execute a run, on another port if one is taken.

        Parameters
        ----------
        task : Task
        files : Path or None
            The agent's.
        folder : Path
            Folder for its working folder and its output; emptied first.

        Returns
        -------
        dict
            Document that `ciberrato.grading.supervisor` writes.

        Raises
        ------
        RunError
            If it could not be.
        """
        document: dict[str, Any] = {"error": "not tried"}
        for attempt in range(ATTEMPTS):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            with self._addresses.turn(task.agent.command, self._kind):
                port = self._port(attempt, task.agent.command)
                document = self._supervise(self._wanted(task, files, folder, port))
            if document["error"] is None:
                return document
            if not document["busy"]:
                break
            if not takes_port(task.agent.command):
                hint = "end the program that has the port, use --sandbox bwrap, or {port} in the command"
                raise RunError(f"{document['error']}; {hint}")
        raise RunError(str(document["error"]))

    def _port(self, attempt: int, *commands: Sequence[str]) -> int:
        """Choose a port: 6000, and others where all runs have one address or a program listens on all."""
        shared = not self._addresses.several and all(takes_port(command) for command in commands)
        if self._kind != "none" or (attempt == 0 and not shared):
            return FIXED_PORT
        return 20_000 + secrets.randbelow(12_000)

    def end(self) -> None:
        """Stop all runs that go on; those that begin afterwards stop at once."""
        self._ended = True
        for process in tuple(self._running):
            with contextlib.suppress(OSError):
                assert process.stdin is not None
                process.stdin.close()

    # --- an agent's files -----------------------------------------------------------------------

    def _files(self, agent: Agent) -> tuple[Path | None, str | None]:
        """Return the folder that runs are given a copy of, built once; and why it could not be built."""
        with self._locks[agent.name]:
            if agent.name not in self._built:
                self._built[agent.name] = self._build(agent)
            return self._built[agent.name]

    def _build(self, agent: Agent) -> tuple[Path | None, str | None]:
        if agent.folder is None:
            return None, None
        target = Path(tempfile.mkdtemp(dir=self._temporary)) / "files"
        copy_folder(agent.folder, target)
        if agent.build is None:
            return target, None
        document = self._supervise(
            {
                "simulator": None,
                "agent": self._inside(list(agent.build), agent, target),
                "environment": sandbox.environment_of_agent(dict(agent.environment))
                | self.groups.environment(),
                "work": None if self._kind == "bwrap" else str(target),
                "limits": asdict(self._course.limits) | {"time": self._course.limits.build},
                "overhead": self._overhead,
            }
        )
        why = document["note"] or document["stopped"] or exit_words(document)
        if why in ("", "exit status 0"):
            return target, None
        return target, f"{document['tail']}\n{' '.join(agent.build)}: {why}".strip()

    def _inside(self, command: list[str], agent: Agent, work: Path) -> list[str]:
        limits = self._course.limits
        if self._kind in ("docker", "podman"):
            return command
        if self._kind == "none":
            return self.groups.around(command, megabytes=limits.memory, processes=limits.processes)
        shown_as = NOWHERE if agent.folder is None else str(agent.folder)
        words = sandbox.around_agent(
            command,
            work,
            shown_as,
            megabytes=limits.disk,
            processes=limits.processes,
            readable=self._course.readable,
        )
        return self.groups.around(words, megabytes=limits.memory, processes=limits.processes)

    def _environment(self, extra: dict[str, str]) -> dict[str, str]:
        return sandbox.environment_of_agent(extra) | self.groups.environment()

    # --- a run ----------------------------------------------------------------------------------

    def _wanted(self, task: Task, files: Path | None, folder: Path, port: int) -> dict[str, Any]:
        lab, agent = task.lab, task.agent
        host = self._host()
        self._prepare(lab, folder)
        return self._program(agent, lab, task.seed, files, folder / "work", host, port, lab.position) | {
            "simulator": self._simulator(task, folder, host, port),
            "result": str(folder / "result.json"),
            "log": str(folder / "log.xml"),
            "name": agent.name,
            "title": f"of {agent.name}, {lab.name}, seed {task.seed}",
            "recording": str(self._recordings / f"{task.file}.js"),
        }

    def _host(self) -> str:
        return "127.0.0.1" if self._kind != "none" else self._addresses.take()

    def _prepare(self, lab: GradedLab, folder: Path) -> None:
        """Write the files that a simulator reads, and make the folder for those of its scoring."""
        (folder / "scoring").mkdir()
        (folder / "parameters.xml").write_bytes(parameters_document(lab.parameters, lab.settings))

    def _simulator(self, task: Task, folder: Path, host: str, port: int) -> list[str]:
        """Return the command line of the simulator."""
        options = self._options(task.lab, task.seed, folder, host, port)
        return module_command("simulator_stub", *options, "--autostart", "1", "--views", "0")

    def _options(self, lab: GradedLab, seed: int, folder: Path, host: str, port: int) -> list[str]:
        """Return the simulator's options.

        No robot may begin the run again, or see where the others are, as views do (`--views`: the caller's).
        """
        course, scoring = self._course, folder / "scoring"
        words = [
            *("--lab", str(lab.lab), "--param", str(folder / "parameters.xml")),
            *(("--grid", str(lab.grid)) if lab.grid is not None else ()),
            *("--scoring", str(lab.scoring), "--scoring-files", str(scoring), "--seed", str(seed)),
            *("--bind", host, "--port", str(port), "--exit-at-end", "--no-restart"),
            *("--exit-when-silent", str(course.limits.silence)),
            *("--result", str(folder / "result.json"), "--log", str(folder / "log.xml")),
        ]
        if not course.lockstep:
            return [*words, "--speed", str(course.speed)]
        limit = course.answer_limit
        return [*words, "--lockstep", *(() if limit is None else ("--answer-limit", str(limit)))]

    def _program(
        self,
        agent: Agent,
        lab: GradedLab,
        seed: int,
        files: Path | None,
        work: Path,
        host: str,
        port: int,
        position: int,
    ) -> dict[str, Any]:
        """Return how an agent is started for a run, in a copy of its files."""
        if files is None:
            work.mkdir()
        else:
            shutil.copytree(files, work, symlinks=True)
        values = {
            "{host}": host,
            "{port}": str(port),
            "{pos}": str(position),
            "{lab}": lab.name,
            "{name}": agent.name,
            "{seed}": str(seed),
        }
        extra = {"CIBERRATO_HOST": host, "CIBERRATO_PORT": str(port)}
        if self._course.lockstep:
            extra[LOCKSTEP_VARIABLE] = "1"  # no clock is to have a say in what a robot does
        extra |= dict(agent.environment)
        return {
            "simulator": None,
            "agent": self._inside([_filled(word, values) for word in agent.command], agent, work),
            "environment": self._environment(extra),
            "work": None if self._kind == "bwrap" else str(work),
            "files": str(work),
            "limits": asdict(self._course.limits),
            "overhead": self._overhead,
        }

    def _supervise(self, wanted: dict[str, Any], module: str = SUPERVISOR) -> dict[str, Any]:
        if self._kind in ("docker", "podman"):
            assert self._course.image is not None
            wanted, module = containers.contain(wanted, self._kind, self._course.image), containers.SUPERVISOR
        command = module_command(module)
        if self._kind == "bwrap":
            command = sandbox.around_run(command)
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            **apart(),  # a Ctrl-C is for us alone
        )
        self._running.add(process)
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            with contextlib.suppress(OSError):
                process.stdin.write(json.dumps(wanted).encode() + b"\n")
                process.stdin.flush()
            if self._ended:
                process.stdin.close()
            # Standard input stays open as long as the run is wanted.
            answer = process.stdout.read()
            complaint = process.stderr.read().decode("utf-8", "replace").strip()
            process.wait()
        finally:
            self._running.discard(process)
            for stream in (process.stdin, process.stdout, process.stderr):
                with contextlib.suppress(OSError):
                    stream.close()
        if self._ended:
            raise RunError("ended")
        try:
            return dict(json.loads(answer))
        except ValueError:
            last = complaint.rpartition("\n")[2] or f"exit status {process.returncode}"
            raise RunError(f"the process that looks after the run failed: {last}") from None


def takes_port(command: Sequence[str]) -> bool:
    """Return whether an agent gets the port; others connect to 6000."""
    return any("{port}" in word for word in command)


def _filled(word: str, values: dict[str, str]) -> str:
    for name, value in values.items():
        word = word.replace(name, value)
    return word


class _Addresses:
    """Addresses of the loopback that others are not likely to have.

    macOS has 127.0.0.1 only. There, agents that do not get the port run one after the other.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._next = secrets.randbelow(1 << 22)
        self.several = has_address("127.64.0.1")
        self._fixed_port = threading.Lock()

    def turn(self, command: Sequence[str], kind: str) -> contextlib.AbstractContextManager[object]:
        """Return what waits for the turn of a run, and ends it."""
        if self.several or kind != "none" or takes_port(command):
            return contextlib.nullcontext()
        return self._fixed_port

    def take(self) -> str:
        """Return the next one."""
        if not self.several:
            return "127.0.0.1"
        with self._lock:
            self._next += 1
            number = self._next
        return f"127.{64 + (number >> 16) % 64}.{(number >> 8) & 255}.{1 + number % 254}"
