"""Gets the pose filter's tables while the agent already drives: coarse ones first, then fine ones.

The compiled loops (extra `fast`) are fetched meanwhile. What takes long is done by processes of their own;
threads only wait for them and load what they leave.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ciberrato.errors import CiberratoError
from ciberrato.processes import module_command
from ciberrato.system.process import apart

if TYPE_CHECKING:
    from ciberrato.localization.tables.pose_tables import PoseTables
    from ciberrato.world.lab import Lab

_SHORT = 0.0005
"""Seconds after which a thread that imports lets the agent's loop go on."""

Progress = Callable[[str, float], None]
"""Told which tables are worked on (``coarse``, ``fine``) and the fraction done."""


class TableWorker:
    """Reads the tables of a lab from disk or has them computed by another process, one after the other.

    Parameters
    ----------
    lab : Lab
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    coarse, fine : float or None
        Resolutions in units; None = those of `ciberrato.localization.tables.pose_tables`.
    folder : Path or None
        Folder of kept tables; None = the user's cache. One that cannot be written costs time in the next run.
    progress : callable, optional
        Called in a thread of the worker.
    """

    def __init__(
        self,
        lab: Lab,
        angles: tuple[float, ...],
        *,
        coarse: float | None = None,
        fine: float | None = None,
        folder: Path | None = None,
        progress: Progress | None = None,
    ) -> None:
        self._lab = lab
        self._angles = angles
        self._resolutions = (coarse, fine)
        self._folder = folder
        self._progress = progress
        self._process: subprocess.Popen[bytes] | None = None
        self._warming: subprocess.Popen[bytes] | None = None
        self._stopped = False
        self.coarse: PoseTables | None = None
        """As soon as they are there."""
        self.fine: PoseTables | None = None
        """Never there in a lab that is too large: its filter computes tiles."""
        self.seconds: dict[str, float] = {}
        """Time from `start` until each part was there: ``coarse``, ``fine``, ``loops``."""
        self.megabytes = 0.0
        """Most memory of a process that computed tables."""
        self._began = time.monotonic()
        self.error: BaseException | None = None
        self._done = threading.Event()
        self._looped = threading.Event()
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Start the threads."""
        self._began = time.monotonic()
        for work, name in ((self._run, "pose tables"), (self._load_loops, "pose loops")):
            thread = threading.Thread(target=work, name=name, daemon=True)
            self._threads.append(thread)
            thread.start()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all tables are there, or something went wrong.

        Parameters
        ----------
        timeout : float, optional
            Seconds.

        Returns
        -------
        bool
            Whether that is so.
        """
        return self._done.wait(timeout)

    def wait_for_loops(self, timeout: float | None = None) -> bool:
        """Wait until the compiled loops are loaded, or it is known that there are none.

        Parameters
        ----------
        timeout : float, optional
            Seconds.

        Returns
        -------
        bool
            Whether that is so.
        """
        return self._looped.wait(timeout)

    def stop(self) -> None:
        """Stop the processes that compute, if there are any."""
        self._stopped = True
        for process in (self._process, self._warming):
            if process is not None:
                process.terminate()

    def join(self) -> None:
        """Wait for the threads, after `stop`: at most a second, if one is loading something."""
        for thread in self._threads:
            thread.join()

    def join_processes(self) -> None:
        """Wait, after `stop`, until the scratch folder is gone; the loops may go on loading."""
        for thread in self._threads[:1]:
            thread.join()

    def _run(self) -> None:
        try:
            from ciberrato.localization.tables.pose_tables import COARSE, fine_resolution

            coarse, fine = self._resolutions
            self.coarse = self._get("coarse", coarse or COARSE)
            self.seconds["coarse"] = time.monotonic() - self._began
            fine = fine or fine_resolution(self._lab)
            if fine < (coarse or COARSE):
                self.fine = self._get("fine", fine)
                self.seconds["fine"] = time.monotonic() - self._began
        except BaseException as error:
            if not self._stopped:
                self.error = error
        finally:
            self._end_process()
            self._done.set()

    def _load_loops(self) -> None:
        """Compile in another process what is not in numba's cache yet, then load it from there."""
        try:
            from ciberrato.localization.belief import compiled

            if compiled.choice() == "off" or not compiled.available():
                return
            if compiled.kernels() is None:
                if not compiled.at_hand() and not self._compile_loops():
                    return
                _load_gently()
            self.seconds["loops"] = time.monotonic() - self._began
        except (ImportError, MemoryError, OSError):
            return  # no room for them: the same results come from numpy
        finally:
            self._looped.set()

    def _compile_loops(self) -> bool:
        command = module_command("ciberrato.localization.belief.compiled")
        nothing = subprocess.DEVNULL
        self._warming = subprocess.Popen(command, stdin=nothing, stderr=nothing, **apart())
        if self._stopped:
            self._warming.terminate()
        return self._warming.wait() == 0 and not self._stopped

    def _get(self, which: str, resolution: float) -> PoseTables:
        from ciberrato.localization.belief import compiled
        from ciberrato.localization.belief.pose_belief import REACH
        from ciberrato.localization.tables.cache import read_tables, table_path
        from ciberrato.localization.tables.pose_tables import BINS

        path = table_path(self._lab, self._angles, resolution, 2, self._folder)
        tables = read_tables(path)
        if tables is None and _writable(path.parent):
            self._compute(which, resolution, path)
            tables = read_tables(path)
        if tables is None and not self._stopped:  # no place to keep them, or no room there
            with tempfile.TemporaryDirectory(prefix="ciberrato-", ignore_cleanup_errors=True) as scratch:
                path = Path(scratch) / path.name
                self._compute(which, resolution, path)
                tables = read_tables(path)
        if tables is None:
            raise TablesError(
                f"the {which} tables of the lab could not be computed: too little memory, or no room "
                f"in {tempfile.gettempdir()}"
            )
        tables.complete(self._lab)
        tables.lattice.move_table(REACH)
        if compiled.choice() != "off" and compiled.available():
            tables.lattice.scratch(BINS)
        return tables

    def _compute(self, which: str, resolution: float, path: Path) -> None:
        from ciberrato.localization.tables.build import TableRequest

        request = pickle.dumps(TableRequest(self._lab, self._angles, resolution, 2, path))
        process = self._process or self._begin_process()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(request)
            process.stdin.flush()
        except OSError:
            pass  # it has ended already; what it left tells
        for line in process.stdout:
            if line.startswith(b"memory "):
                self.megabytes = max(self.megabytes, float(line.split()[1]))
                break
            if self._progress is not None:
                self._progress(which, float(line))
        else:
            self._end_process()
        if self._progress is not None:
            self._progress(which, 1.0)

    def _begin_process(self) -> subprocess.Popen[bytes]:
        # A signal from the terminal is for the agent, which still needs the tables: hence the new session.
        self._process = subprocess.Popen(
            module_command("ciberrato.localization.tables.build"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            **apart(),
        )
        if self._stopped:
            self._process.terminate()
        return self._process

    def _end_process(self) -> None:
        """End the process that computes, if there is one, when it has done what it was asked to."""
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(OSError):
                process.__exit__(None, None, None)


class TablesError(CiberratoError):
    """The tables cannot be computed on this machine."""


def _load_gently() -> None:
    """Import the loops while the agent's loop runs in another thread, which is to get its turns."""
    from ciberrato.localization.belief import compiled

    interval = sys.getswitchinterval()
    sys.setswitchinterval(_SHORT)
    gc.disable()  # a look through all that is imported would hold up everybody
    try:
        compiled.load()
    finally:
        gc.freeze()
        gc.enable()
        sys.setswitchinterval(interval)


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)
