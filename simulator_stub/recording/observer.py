"""What an observer of a run is, and files that hold one world each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from simulator_stub.simulation import Simulation


class Observer:
    """Looks on, and writes down what happens; the methods here do nothing."""

    def actions_read(self, simulation: Simulation) -> None:
        """Look at a cycle after the actions are read, before anything moves."""

    def cycle_done(self, simulation: Simulation) -> None:
        """Look at a cycle after everything has moved and been measured, before anybody is told."""

    def world_ended(self, simulation: Simulation) -> None:
        """Look at a world for the last time: it is about to begin anew, or the simulator ends."""

    def close(self) -> None:
        """Finish the record."""


def numbered(path: Path, world: int) -> Path:
    """Name the file of a world: the first has the plain name, later ones a number before the suffix."""
    return path if world == 1 else path.with_name(f"{path.stem}-{world}{path.suffix}")


class WorldFile(Observer):
    """A text file that begins anew with each world; subclasses write into it.

    The file of the first world is made at once, so that a wrong name is noticed; those of later worlds when
    there is something to write.

    Parameters
    ----------
    path : Path
        Overwritten if it exists.

    Raises
    ------
    UsageError
        If it cannot be written; also later, when the disk is full.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._world = 1
        self._used = False
        self._file: TextIO | None = None
        self._open()

    def _open(self) -> TextIO:
        path = numbered(self._path, self._world)
        try:
            self._file = path.open("w", encoding="utf-8", newline="\n")
        except OSError as error:
            raise UsageError(f"{path}: cannot be written ({error.strerror})") from None
        return self._file

    def write(self, text: str) -> None:
        """Add to the file of this world."""
        self._used = True
        try:
            (self._file or self._open()).write(text)
        except OSError as error:
            raise self._failed(error) from None

    def flush(self) -> None:
        """Let others see what was written."""
        try:
            if self._file is not None:
                self._file.flush()
        except OSError as error:
            raise self._failed(error) from None

    def _failed(self, error: OSError) -> UsageError:
        return UsageError(f"{numbered(self._path, self._world)}: cannot be written ({error.strerror})")

    def world_ended(self, simulation: Simulation) -> None:
        """Close the file of this world, if anything is in it."""
        if self._used:
            self.close()
            self._world += 1
            self._used = False

    def close(self) -> None:
        """Close the file."""
        file, self._file = self._file, None
        try:
            if file is not None:
                file.close()
        except OSError as error:
            raise self._failed(error) from None
