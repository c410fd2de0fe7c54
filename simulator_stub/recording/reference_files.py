"""The files that some ways of scoring leave behind: mapping.out and planning.out."""

from __future__ import annotations

from pathlib import Path

from ciberrato.errors import UsageError
from simulator_stub.recording.observer import Observer
from simulator_stub.simulation import Simulation


class ReferenceFiles(Observer):
    """Writes what the scoring has worked out, when a run has begun.

    Parameters
    ----------
    folder : Path
        The real simulator uses its working directory.

    Raises
    ------
    UsageError
        If it is no folder; later, if a file cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        if not folder.is_dir():
            raise UsageError(f"argument --scoring-files: {folder}: no such folder")
        self._folder = folder
        self._written: dict[str, str] = {}

    def actions_read(self, simulation: Simulation) -> None:
        """Write what is new since the cycle before."""
        documents = simulation.scoring.documents
        if documents != self._written:
            for name, text in documents.items():
                try:
                    (self._folder / name).write_text(text, encoding="ascii", newline="\n")
                except OSError as error:
                    raise UsageError(f"{self._folder / name}: {error.strerror}") from None
            self._written = dict(documents)
