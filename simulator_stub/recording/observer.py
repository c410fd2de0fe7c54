"""Interface of observers of a run, and files that hold one world each."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from simulator_stub.simulation import Simulation


class Observer:
    """Looks on, and writes down what happens; the methods here do nothing."""

    def actions_read(self, simulation: Simulation) -> None:
        """Observe a cycle after the actions are read, before anything moves."""

    def cycle_done(self, simulation: Simulation) -> None:
        """Observe a cycle after everything has moved and been measured, before clients receive it."""

    def world_ended(self, simulation: Simulation) -> None:
        """Observe a world for the last time: it is about to be reset, or the simulator ends."""

    def close(self) -> None:
        """Finish the record."""


def overriding(observers: Iterable[Observer], name: str) -> list[Callable[[Simulation], None]]:
    """Return the methods of a name of those observers that have one of their own: others do nothing there."""
    inherited = getattr(Observer, name)
    return [getattr(one, name) for one in observers if getattr(type(one), name) is not inherited]


def numbered(path: Path, world: int) -> Path:
    """Name the file of a world: the first has the plain name, later ones a number before the suffix."""
    return path if world == 1 else path.with_name(f"{path.stem}-{world}{path.suffix}")


Lost = Callable[[str], None]
"""Told, in one line, of a record that could not be kept."""

BUFFER = 1 << 16
"""Characters that are kept until they are written, unless a flush is asked for."""


def lose_nothing(line: str) -> None:
    """Refuse to go on without a record."""
    raise UsageError(line)


class WorldFile(Observer):
    """A text file that begins anew with each world; subclasses write into it.

    The file of the first world is made at once, so that a wrong name is noticed; those of later worlds when
    there is something to write. Where a file cannot be written on, the record of this world ends with the
    last whole piece; the simulation goes on, and the next world tries again.

    Parameters
    ----------
    path : Path
        Overwritten if it exists.
    lost : callable
        Told when a record ends early.

    Raises
    ------
    UsageError
        If it cannot be opened.
    """

    def __init__(self, path: Path, lost: Lost = lose_nothing) -> None:
        self._path = path
        self._world = 1
        self._used = False
        self._broken = False
        self._lost = lost
        self._file: BinaryIO | None = None
        self._pieces: list[str] = []
        self._length = 0
        self._open()

    def heading(self) -> str:
        """Return what every file begins with."""
        return ""

    def _open(self) -> None:
        path = numbered(self._path, self._world)
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written ({error.strerror})") from None
        if self.heading():
            self._keep(self.heading())
            self.flush()

    def write(self, text: str) -> None:
        """Add a piece to the file of this world: all of it will be there, or nothing."""
        self._used = True
        if self._broken:
            return
        if self._file is None:
            try:
                self._open()
            except UsageError as error:
                self._give_up(str(error))
                return
        self._keep(text)
        if self._length > BUFFER:
            self.flush()

    def _keep(self, text: str) -> None:
        self._pieces.append(text)
        self._length += len(text)

    def flush(self) -> None:
        """Flush the output, so that other programs see what was written."""
        if self._file is None or not self._pieces:
            return
        pieces = [piece.encode() for piece in self._pieces]
        self._pieces = []
        self._length = 0
        data = b"".join(pieces)
        written = 0
        try:
            while written < len(data):
                written += self._file.write(data[written:])
        except OSError as error:
            # A torn piece must not stay: what comes last is whole.
            whole = max(end for end in accumulate(map(len, pieces), initial=0) if end <= written)
            with contextlib.suppress(OSError):
                self._file.truncate(self._file.tell() - written + whole)
            path = numbered(self._path, self._world)
            self._give_up(f"{path}: cannot be written ({error.strerror})")

    def _give_up(self, why: str) -> None:
        self._broken = True
        file, self._file = self._file, None
        if file is not None:
            with contextlib.suppress(OSError):
                file.close()
        self._lost(f"{why}; this record ends here, the run goes on")

    def world_ended(self, simulation: Simulation) -> None:
        """Close the file of this world, if anything is in it."""
        if self._used:
            self.close()
            self._world += 1
            self._used = self._broken = False

    def close(self) -> None:
        """Close the file."""
        self.flush()
        file, self._file = self._file, None
        try:
            if file is not None:
                file.close()
        except OSError as error:
            self._give_up(f"{numbered(self._path, self._world)}: cannot be written ({error.strerror})")
