"""Simulators that tests start: each a process of its own, on a port of its own."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ciberrato.errors import CiberratoError, UsageError
from ciberrato.grading.course import GradedLab, parameters_document
from ciberrato.processes import module_command
from ciberrato.system.process import apart, ask_to_end
from ciberrato.testing.runs import result_of

if TYPE_CHECKING:
    from ciberrato.testing.truth import Truth

_PATIENCE = 60.0


class SimulatorError(CiberratoError):
    """A simulator did not start, or its run did not come to an end."""


class RunningSimulator:
    """A simulator for a test: starts when made, and is there when that returns.

    It starts the run when `autostart` robots have registered, and ends when the run is over.

    Parameters
    ----------
    lab : GradedLab
    seed : int
    folder : Path
        Folder of its files.
    options : mapping
        ``lockstep``, ``speed``, ``answer_limit``.
    autostart : int

    Attributes
    ----------
    host : str
    port : int
    address : str
        ``HOST:PORT``, as `ciberrato.Robot` takes it.
    seed : int
    folder : Path
        ``log.xml``, ``truth.csv``, ``result.json``, ``messages.txt``; complete when it has stopped.

    Raises
    ------
    SimulatorError
        If it does not start.
    """

    host = "127.0.0.1"

    def __init__(
        self, lab: GradedLab, seed: int, folder: Path, options: Mapping[str, Any], *, autostart: int
    ) -> None:
        if isinstance(autostart, bool) or not isinstance(autostart, int) or autostart < 0:
            raise UsageError(f"autostart={autostart!r}: a number of robots, 0 or more, was expected")
        self.seed = seed
        self.folder = folder
        self._world = lab
        self._lockstep = bool(options["lockstep"])
        folder.mkdir()
        (folder / "parameters.xml").write_bytes(parameters_document(lab.parameters, lab.settings))
        words = [
            *(
                "--lab",
                str(lab.lab),
                "--param",
                str(folder / "parameters.xml"),
                "--scoring",
                str(lab.scoring),
            ),
            *(("--grid", str(lab.grid)) if lab.grid is not None else ()),
            *("--scoring-files", str(folder), "--seed", str(seed), "--reproducible"),
            *("--bind", self.host, "--port", "0", "--autostart", str(autostart), "--exit-at-end"),
            *("--log", str(folder / "log.xml"), "--truth", str(folder / "truth.csv")),
            *("--result", str(folder / "result.json")),
        ]
        words += ["--lockstep"] if options["lockstep"] else ["--speed", str(options["speed"])]
        if options["answer_limit"] is not None:
            words += ["--answer-limit", str(options["answer_limit"])]
        with (folder / "messages.txt").open("wb") as messages:
            self._process = subprocess.Popen(
                module_command("ciberrato.testing.beside", *words),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=messages,
                **apart(),  # a Ctrl-C is for the tests
            )
        self.port = self._await_port()
        self.address = f"{self.host}:{self.port}"

    def _await_port(self) -> int:
        assert self._process.stdout is not None
        timer = threading.Timer(_PATIENCE, self._process.kill)
        timer.start()
        try:
            for line in self._process.stdout:
                if line.startswith(b"listening on tcp"):  # the last line that it prints
                    return int(line.rpartition(b":")[2])
        except BaseException:
            self._process.kill()
            raise
        finally:
            timer.cancel()
        self.stop()
        said = self.messages.strip().rpartition("\n")[2].removeprefix("ciberrato-simulator: ")
        raise SimulatorError(said or "the simulator did not start")

    @property
    def messages(self) -> str:
        """Messages of the simulator so far: who registered, start, end."""
        return (self.folder / "messages.txt").read_text(encoding="utf-8", errors="replace")

    @property
    def truth(self) -> Truth:
        """True path of the first robot so far: arrays ``time``, ``x``, ``y``, ``degrees``."""
        return self.truth_of(None)

    def truth_of(self, robot: int | None) -> Truth:
        """Return where a robot has been so far.

        Parameters
        ----------
        robot : int or None
            Its start position, from 1; None = the first that registered.

        Returns
        -------
        Truth
        """
        from ciberrato.testing.truth import truth_arrays

        return truth_arrays(self.folder / "truth.csv", robot)

    def result(self, seconds: float = _PATIENCE) -> dict[str, Any]:
        """Wait until the run is over, and return what came of it.

        Parameters
        ----------
        seconds : float
            Time to wait.

        Returns
        -------
        dict
            A run of the simulator's result file: ``time``, ``state``, and ``robots``, dicts with ``score``,
            ``collisions``, ``visited``, ``arrival_time`` and more.

        Raises
        ------
        SimulatorError
            If the run goes on, or never began.
        """
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            raise SimulatorError(
                f"the run is not over after {seconds:g} s; it ends when every robot has finished, or the "
                "time is over"
            ) from None
        run = result_of(self.folder)
        if run is None:
            raise SimulatorError("there was no run: no cycle was run before the simulator ended")
        return run

    def stop(self) -> None:
        """Stop it now; its files are complete then. Stopping twice does no harm."""
        if self._process.poll() is None:
            ask_to_end(self._process)
            try:
                self._process.wait(10.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def __repr__(self) -> str:
        return f"<simulator of {self._world.name} at {self.address}, seed {self.seed}>"
