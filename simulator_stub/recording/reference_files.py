"""The files that some ways of scoring leave behind: mapping.out and planning.out."""

from __future__ import annotations

from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file
from simulator_stub.recording.observer import Lost, Observer, lose_nothing
from simulator_stub.simulation import Simulation


class ReferenceFiles(Observer):
    """Writes what the scoring has worked out, when a run has begun.

    Parameters
    ----------
    folder : Path
        The real simulator uses its working directory.
    lost : callable
        Told when a file cannot be written.

    Raises
    ------
    UsageError
        If it is no folder.
    """

    def __init__(self, folder: Path, lost: Lost = lose_nothing) -> None:
        if not folder.is_dir():
            raise UsageError(f"argument --scoring-files: {folder}: no such folder")
        self._folder = folder
        self._lost = lost
        self._written: dict[str, str] = {}

    def actions_read(self, simulation: Simulation) -> None:
        """Write what is new since the cycle before."""
        documents = simulation.scoring.documents
        if documents != self._written:
            for name, text in documents.items():
                try:
                    replace_file(self._folder / name, text.encode("ascii"))
                except UsageError as error:
                    self._lost(f"{error}; the run goes on without it")
            self._written = dict(documents)
