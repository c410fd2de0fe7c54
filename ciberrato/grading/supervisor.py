"""One run, in a process of its own: starts the simulator and the agent, watches both, and ends all there is.

Reads a line of JSON from standard input, what `ciberrato.grading.runner` wants, and writes one to standard
output, what came of it. When standard input ends, so does the run: its parent has gone.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ciberrato.grading.workspace import size_of
from ciberrato.system import descendants
from ciberrato.system.process import ask_to_end, interruptible, runnable
from ciberrato.system.streams import streams

SUPERVISOR = "ciberrato.grading.supervisor"
"""This process, for `ciberrato.processes.module_command`."""

LOOK = 0.05
"""Seconds between looks at what goes on."""

GRACE = 1.0
"""Seconds that an agent may go on after the run is over."""

MORE_GRACE = 9.0
"""Seconds more for one that is at work: on a busy machine what it says last must not depend on the load."""

TAIL = 4096
"""Bytes of its last output that are kept."""

SECONDS_A_WEIGHING = 0.5
"""Between looks at how much the agent has written; more where that takes long."""

_MB = 1 << 20


class Stream:
    """Output of a process: counted up to a limit, its end kept."""

    def __init__(self, most: int, limit: float = math.inf) -> None:
        self.count = 0
        self.tail = b""
        self._most = most
        self._limit = limit

    def add(self, data: bytes) -> None:
        """Append the next bytes."""
        if self.count + len(data) > self._limit:
            # So what is kept does not depend on when the process is stopped.
            data = data[: int(self._limit) + 1 - self.count]
        self.count += len(data)
        self.tail = (self.tail + data)[-self._most :]

    def text(self) -> str:
        """Return the last of it as text."""
        return self.tail.decode("utf-8", "replace")


class Run:
    """A run.

    Parameters
    ----------
    wanted : mapping
        ``simulator`` and ``agent`` (command lines; without the first, None, the second is a build),
        ``environment``, ``work`` (the agent's working folder, or None if the command line sees to it),
        ``result`` (the simulator's result file; ``grace`` in its last run: seconds that the agent may go on
        afterwards), ``tail`` (bytes of its last output that are kept), ``limits``, ``overhead``
        (processes of the sandbox's own), ``files`` (the agent's working folder as it is seen here).
    """

    def __init__(self, wanted: Mapping[str, Any]) -> None:
        self._wanted = wanted
        self._limits: Mapping[str, float] = wanted["limits"]
        self._streams = streams()
        self._simulator_output = Stream(1 << 16)
        self._agent_output = Stream(wanted.get("tail", TAIL), self._limits["output"] * 1024)
        self._simulator: subprocess.Popen[bytes] | None = None
        self._agent: subprocess.Popen[bytes] | None = None
        self._stopped: str | None = None
        self._orphaned = False
        self._peak = descendants.Usage(0, 0)
        self._next_look = 0.0
        self._next_weighing = 0.0
        self._room: float | None = None

    def run(self) -> dict[str, Any]:
        """Execute the run.

        Returns
        -------
        dict
            ``error``: why the run could not be, or None, and ``busy``: whether it was the port; else what
            `_document` says.
        """
        try:
            return self._run()
        finally:
            self._end_everything()

    def _run(self) -> dict[str, Any]:
        self._watch(sys.stdin.buffer, self._parent)
        if self._wanted["simulator"] is None:
            return self._run_alone()
        self._simulator = start_simulator(self._wanted["simulator"])
        self._watch(self._simulator.stdout, self._simulator_output.add)
        if not self._until(lambda: self._said(b"listening on udp"), 60.0):
            text = self._simulator_output.text().strip().rpartition("\n")[2]
            return {"error": text or "the simulator does not start", "busy": "cannot listen" in text}
        limits = self._limits
        began = time.monotonic()
        failure = self._start_agent()
        if failure is not None:
            return self._document(began, note=failure)
        self._until(self._registered, limits["registration"])
        if not self._registered():
            note = None if self._agent_ended() else f"not registered after {limits['registration']:g} s"
            self._stopped = self._stopped or note
            return self._document(began)
        if not self._until(lambda: False, limits["time"] + began - time.monotonic()) and self._goes_on():
            self._stop("time limit")
            # The simulator ends by itself, as its robot is silent; only should it not, it is ended.
            self._until(lambda: False, 60.0 + 2.0 * limits["silence"])
        run = last_run(self._wanted.get("result")) or {}
        grace = run.get("grace", self._wanted.get("grace"))
        until = time.monotonic() + (GRACE if grace is None else grace)
        latest = until if grace is not None else until + MORE_GRACE
        while not self._agent_ended() and not self._orphaned:
            now = time.monotonic()
            if now >= latest or (now >= until and not descendants.at_work(self._agents_processes())):
                break
            self._look(LOOK)
        return self._document(began)

    def _start_agent(self) -> str | None:
        """Start the agent; return why it cannot be."""
        limits = self._limits
        self._is_over_disk()
        try:
            self._agent = subprocess.Popen(
                runnable(self._wanted["agent"], self._wanted["environment"]),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                cwd=self._wanted["work"],
                env=self._wanted["environment"],
                preexec_fn=descendants.limiter(
                    seconds=limits["time"],
                    memory=int(2 * limits["memory"] * _MB) + 64 * _MB,
                    files=int(limits["files"]),
                    file_size=int(limits["disk"] * _MB),
                ),
            )
        except OSError as error:
            return f"cannot be started: {error.strerror}"
        self._watch(self._agent.stdout, self._agent_output.add)
        return None

    def _run_alone(self) -> dict[str, Any]:
        began = time.monotonic()
        failure = self._start_agent()
        while failure is None and not self._agent_ended() and not self._orphaned:
            self._look(LOOK)
            if time.monotonic() - began > self._limits["time"]:
                self._stop("time limit")
        return self._document(began, note=failure)

    # --- what goes on ---------------------------------------------------------------------------

    def _watch(self, stream: Any, take: Callable[[bytes], object]) -> None:
        self._streams.watch(stream, take)

    def _parent(self, data: bytes) -> None:
        self._orphaned = self._orphaned or not data

    def _said(self, what: bytes) -> bool:
        return what in self._simulator_output.tail

    def _registered(self) -> bool:
        return self._said(b" registered from ")

    def _goes_on(self) -> bool:
        return self._simulator is not None and self._simulator.poll() is None and not self._orphaned

    def _agent_ended(self) -> bool:
        return self._agent is not None and self._agent.poll() is not None

    def _until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait for a condition, at most so many seconds and only while the simulator runs."""
        until = time.monotonic() + seconds
        while not condition():
            if not self._goes_on() or time.monotonic() > until:
                return condition()
            if self._agent_ended() and not self._registered() and not self._look(0.2):
                return False  # nothing more is to be expected
            self._look(LOOK)
        return True

    def _look(self, seconds: float) -> bool:
        """Read what was written, and compare what the agent uses with its limits."""
        any_news = self._streams.read(seconds)
        if self._agent is not None and self._stopped is None:
            limits = self._limits
            if self._agent_output.count > limits["output"] * 1024:
                self._stop("output limit")
            elif time.monotonic() >= self._next_look:
                self._next_look = time.monotonic() + descendants.SECONDS_A_LOOK
                processes = self._agents_processes()
                used = descendants.usage(processes)
                if used.memory > limits["memory"] * _MB:
                    exact = descendants.exact_memory(processes)
                    used = used._replace(memory=used.memory if exact is None else exact)
                threads = used.threads - self._wanted["overhead"]
                self._peak = descendants.Usage(
                    max(threads, self._peak.threads), max(used.memory, self._peak.memory)
                )
                if threads > limits["processes"]:
                    self._stop("process limit")
                elif used.memory > limits["memory"] * _MB:
                    self._stop("memory limit")
                elif self._is_over_disk():
                    self._stop("disk limit")
        return any_news

    def _is_over_disk(self) -> bool:
        """Weigh the working folder now and then: against its first weight and the limit."""
        began = time.monotonic()
        if self._wanted.get("files") is None or began < self._next_weighing:
            return False
        size = size_of(Path(self._wanted["files"]))
        if self._room is None:
            self._room = size + self._limits["disk"] * _MB
        end = time.monotonic()
        self._next_weighing = end + max(SECONDS_A_WEIGHING, 20.0 * (end - began))
        return size > self._room

    # --- ends -----------------------------------------------------------------------------------

    def _agents_processes(self) -> list[int]:
        simulator = self._simulator.pid if self._simulator is not None else 0
        return [process for process in descendants.descendants(os.getpid()) if process != simulator]

    def _stop(self, why: str) -> None:
        if self._agent_ended():
            return
        self._stopped = why
        descendants.end_all(self._agents_processes, child=self._agent)

    def _end_everything(self) -> None:
        descendants.end_all(self._agents_processes, child=self._agent)
        end_simulator(self._simulator)

    def _document(self, began: float, note: str | None = None) -> dict[str, Any]:
        """Return what came of it, when all has been ended."""
        wall = time.monotonic() - began
        over = not self._goes_on()
        status = self._agent.poll() if self._agent is not None else None
        self._end_everything()
        self._streams.rest()
        code, number = status, None
        if status is not None and (status < 0 or (self._wanted["overhead"] and status > 128)):
            code, number = None, -status if status < 0 else status - 128
        return {
            "error": None,
            "run": last_run(self._wanted.get("result")),
            "registered": self._registered(),
            "note": note,
            "stopped": self._stopped,
            "exit": None if self._stopped else code,
            "signal": None if self._stopped else number,
            "simulator_ended": over,
            "wall": round(wall, 3),
            "memory": self._peak.memory,
            "threads": max(self._peak.threads, 0),
            "output": self._agent_output.count,
            "tail": self._agent_output.text(),
        }


def start_simulator(command: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start the simulator of a run; what it says goes to a pipe."""
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        preexec_fn=descendants.limiter(seconds=1e9, memory=1 << 40, files=1024, file_size=1 << 32),
        **interruptible(),
    )


def end_simulator(process: subprocess.Popen[bytes] | None) -> None:
    """End the simulator of a run, which writes what it has, by force if need be."""
    if process is not None and process.poll() is None:
        ask_to_end(process)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10.0)
        process.kill()
        process.wait()


def last_run(path: str | None) -> dict[str, Any] | None:
    """Read the last run of a simulator's result file; None if there is none."""
    try:
        runs = json.loads(Path(path or os.devnull).read_text(encoding="utf-8"))["runs"]
    except (OSError, ValueError, KeyError):
        return None
    return runs[-1] if runs else None


def main() -> int:
    """Execute the run that standard input describes."""
    return look_after(lambda wanted: Run(wanted).run())


def look_after(do: Callable[[dict[str, Any]], dict[str, Any]]) -> int:
    """Execute the request in a line of standard input; write its outcome and its recording.

    Parameters
    ----------
    do : callable

    Returns
    -------
    int
        Exit status.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that started this decides
    descendants.adopt_orphans()
    line = b""
    while not line.endswith(b"\n"):  # byte for byte: what follows is watched by the run
        one = os.read(0, 1)
        if not one:
            return 1
        line += one
    wanted = json.loads(line)
    document = do(wanted)
    if wanted.get("log") and document.get("run"):
        from ciberrato.grading.recording import write_recording

        names = document.get("names")
        if names is None and document["run"]["robots"]:
            names = {str(document["run"]["robots"][0]["id"]): wanted["name"]}
        write_recording(Path(wanted["log"]), Path(wanted["recording"]), wanted["title"], names)
    print(json.dumps(document), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
