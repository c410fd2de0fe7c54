"""Computes the pose filter's tables in a thread while the agent already drives: coarse ones first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agent.pose_filter.tables import PoseTables
    from ciberrato.lab import Lab

Progress = Callable[[str, float], None]
"""Told which tables are worked on (``coarse``, ``fine``) and the fraction done."""


class TableWorker:
    """Computes, or reads from disk, the tables of a lab: one after the other, in a thread of its own.

    Parameters
    ----------
    lab : Lab
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    fine : float or None
        Resolution of the second tables in units; None = `FINE`.
    progress : callable, optional
        Called in the thread.
    """

    def __init__(
        self,
        lab: Lab,
        angles: tuple[float, ...],
        *,
        fine: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        self._lab = lab
        self._angles = angles
        self._fine_resolution = fine
        self._progress = progress
        self.coarse: PoseTables | None = None
        """As soon as they are there."""
        self.fine: PoseTables | None = None
        self.error: BaseException | None = None
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="pose tables", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all tables are there, or something went wrong.

        Returns
        -------
        bool
            Whether that is so.
        """
        return self._done.wait(timeout)

    def _run(self) -> None:
        try:
            from agent.pose_filter.cache import cached_tables
            from agent.pose_filter.tables import COARSE, FINE

            self.coarse = cached_tables(self._lab, self._angles, COARSE, progress=self._reporting("coarse"))
            self.fine = cached_tables(
                self._lab, self._angles, self._fine_resolution or FINE, progress=self._reporting("fine")
            )
        except BaseException as error:
            self.error = error
        finally:
            self._done.set()

    def _reporting(self, which: str) -> Callable[[float], None] | None:
        if self._progress is None:
            return None
        report = self._progress

        def progress(done: float) -> None:
            report(which, done)

        return progress
