"""Follows a log while an agent writes it: for views that are processes of their own and cannot hold it up."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from agent.offline.simulator_log import replay_of
from ciberrato.errors import LabError
from ciberrato.files.run_log import SALVAGE_HINT, parse_cycle, parse_header, without_readings
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
from ciberrato.world.coordinates import PoseInDegrees, SensorAngles

_READING_SHARE = 4.0
"""A log that is read anew is left alone for so many times as long as that took."""


class LogFollower:
    """Reads a log while it is written, each complete line once.

    Parameters
    ----------
    path : Path
    salvage : callable, optional
        Told of every line that cannot be read, which is then left out; without it they are errors.
    """

    def __init__(self, path: Path, *, salvage: Callable[[str], None] | None = None) -> None:
        self._path, self._salvage = path, salvage
        self._offset = 0
        self._rest = b""
        self._lines = 0
        self._due = 0
        self.header: RunHeader | None = None
        self.cycles: list[Cycle] = []

    @property
    def run(self) -> RecordedRun | None:
        """Run read so far; None before the first line is complete."""
        return None if self.header is None else RecordedRun(self.header, tuple(self.cycles))

    def poll(self) -> bool:
        """Read what is new.

        Returns
        -------
        bool
            Whether anything was.

        Raises
        ------
        LabError
            If a line is not one of a log.
        """
        try:
            with self._path.open("rb") as stream:
                if stream.seek(0, os.SEEK_END) < self._offset:
                    self._begin_again()
                stream.seek(self._offset)
                data = stream.read()
        except FileNotFoundError:
            return False
        except OSError as error:
            raise LabError(f"cannot be read: {error.strerror}", source=str(self._path)) from None
        self._offset += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._lines += 1
            if self.header is None:
                self.header = parse_header(line, str(self._path))
                continue
            try:
                self._add(parse_cycle(line, str(self._path), self._lines))
            except LabError as error:
                if self._salvage is None:
                    raise
                self._salvage(f"{str(error).removesuffix(SALVAGE_HINT)}; the line is left out")
        return bool(lines)

    def _add(self, cycle: Cycle) -> None:
        """Add a cycle; where lines are missing, steps without readings for theirs, as `read_run` does."""
        if cycle.step is not None and self._salvage is not None:
            if cycle.step < self._due:
                problem = f"step {cycle.step} where step {self._due} was due"
                raise LabError(problem, source=str(self._path), line=self._lines)
            if cycle.step > self._due:
                where = f"{self._path}:{self._lines}"
                self._salvage(f"{where}: steps {self._due} to {cycle.step - 1} are missing")
                self.cycles += without_readings(cycle, range(self._due, cycle.step))
            self._due = cycle.step + 1
        self.cycles.append(cycle)

    def _begin_again(self) -> None:
        """Forget everything: another run has begun to write the file."""
        self._offset, self._rest, self._lines, self._due = 0, b"", 0, 0
        self.header, self.cycles = None, []


class SimulatorLogFollower:
    """Reads a simulator's log while it is written.

    It is read anew each time, as far as it goes: a log of 2,000 cycles takes a quarter of a second.

    Parameters
    ----------
    path : Path
    angles : tuple of four float
        Angles of the robot's IR sensors in degrees.
    robot : int or None
        Its position number; None = the first in the log.

    Attributes
    ----------
    lab : Lab
    run : RecordedRun
        So far.
    poses : dict of int to (x, y, heading)
        True poses of the robot, by cycle.

    Raises
    ------
    LabError
        If the file is not a simulator's log.
    UsageError
        If that robot is not in it.
    """

    def __init__(self, path: Path, angles: SensorAngles, *, robot: int | None = None) -> None:
        self._path, self._angles, self._robot = path, angles, robot
        self._seen = (-1, -1)
        self._first = True
        self._due = 0.0
        self.poses: dict[int, PoseInDegrees] = {}
        self._read()

    @property
    def header(self) -> RunHeader:
        """Header of the run."""
        return self.run.header

    def poll(self) -> bool:
        """Read what is new; see `LogFollower.poll`."""
        first, self._first = self._first, False
        if time.monotonic() < self._due or self._state() == self._seen:
            return first
        self._read()
        return True

    def _state(self) -> tuple[int, int]:
        try:
            state = self._path.stat()
        except OSError as error:
            raise LabError(f"cannot be read: {error.strerror}", source=str(self._path)) from None
        return state.st_size, state.st_mtime_ns

    def _read(self) -> None:
        began = time.monotonic()
        self._seen = self._state()
        replay, self.lab = replay_of(self._path, self._angles, robot=self._robot)
        self.run, self.poses = replay.run, replay.poses
        now = time.monotonic()
        self._due = now + _READING_SHARE * (now - began)


Follower = LogFollower | SimulatorLogFollower


def follow(
    path: Path | Follower,
    *,
    interval: float,
    ended: Callable[[], bool] = lambda: False,
    idle_limit: float | None = None,
) -> Iterator[Follower]:
    """Follow a log for as long as it may grow.

    Parameters
    ----------
    path : Path, LogFollower or SimulatorLogFollower
        An agent's log, which need not exist yet, or what follows one already.
    interval : float
        Seconds between looks.
    ended : callable
        Tells whether to end; what is new by then is still looked at.
    idle_limit : float or None
        End after so many seconds without news.

    Yields
    ------
    LogFollower or SimulatorLogFollower
        Always the same, each time there is something new.

    Raises
    ------
    LabError
        If the file is not the log of a run.
    """
    follower = LogFollower(path) if isinstance(path, Path) else path
    news = time.monotonic()
    while True:
        last = ended()
        if follower.poll():
            news = time.monotonic()
            yield follower
        if last or (idle_limit is not None and time.monotonic() - news > idle_limit):
            return
        time.sleep(interval)
