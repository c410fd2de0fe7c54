"""A run by the published method: expected readings of all cells, and the filter after the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from agent.drives.right.controller import Controller
    from agent.offline.expected_readings import ExpectedReadingsWorker
    from agent.run.reporter import Reporter
    from agent.run.settings import Settings
    from agent.run.signals import Interrupts
    from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader


class PublishedMethod:
    """Drives to the right, and localizes afterwards.

    Parameters
    ----------
    settings : Settings
    interrupts : Interrupts
    reporter : Reporter
    late : bool
        Whether to work out the expected readings at the end of the run only, if at all.
    """

    def __init__(
        self, settings: Settings, interrupts: Interrupts, reporter: Reporter, *, late: bool = False
    ) -> None:
        self._settings = settings
        self._interrupts = interrupts
        self._reporter = reporter
        self._late = late
        self.log_is_whole = True
        """See `Method.log_is_whole`."""
        self.thinks_long = self.drives = False
        self._worker: ExpectedReadingsWorker | None = None

    def prepare(self) -> bool:
        """Prepare the run, see `Method.prepare`.

        In lockstep all is loaded first: the simulator waits only so long for a robot that is silent before
        the start, and a first answer that comes behind it is taken for the next one's.
        """
        if self._settings.lockstep:
            from importlib import import_module

            for name in ("numpy", "agent.drives.right.controller", "ciberrato.files.run_log"):
                import_module(name)
        return True

    def begin(self) -> None:
        """Begin the run, see `Method.begin`."""
        from agent.offline.expected_readings import ExpectedReadingsWorker

        settings = self._settings
        self._worker = ExpectedReadingsWorker(settings.lab, settings.angles, model=settings.distance_model)
        if not self._late:
            self._worker.start()

    def announce(self, header: RunHeader) -> None:
        """Send to the worker the noise for which the expected readings are to be computed."""
        assert self._worker is not None
        self._worker.announce(header.parameters)

    def controller(self, header: RunHeader) -> Controller:
        """Return the controller, see `Method.controller`."""
        from agent.drives.right.controller import Controller

        return Controller(header, exit_at_wall=self._settings.exit_at_wall)

    @property
    def failure(self) -> str | None:
        """Failure of the run, see `Method.failure`."""
        failed = self._worker is not None and self._worker.error is not None
        return "the ground truth failed" if failed else None

    def report(self, cycle: Cycle) -> None:
        """Report on the run, see `Method.report`."""

    def finish(self, run: RecordedRun | None, reason: str, stop: Callable[[], None]) -> int:
        """Finish the run, see `Method.finish`."""
        interrupts, settings = self._interrupts, self._settings
        if self._late and self._worker is not None:
            self._worker.start()
        if run is None or not any(cycle.step is not None for cycle in run.cycles):
            if not interrupts.received:
                raise UsageError(f"{reason}, before anything was recorded; nothing is written")
            self._reporter.warn(f"{reason} before anything was recorded; nothing is written")
            return interrupts.status
        self._reporter.say(f"{reason}; finishing: writing {settings.output} (signals are ignored until then)")
        stop()
        assert self._worker is not None
        from agent.offline.exit_status import WRONG_MAP
        from agent.offline.localization import fit_of, print_localization, write_localization
        from agent.offline.map_fit import wrong_map

        try:
            expected = self._worker.result()
            localization = write_localization(
                run,
                expected,
                preset=settings.preset,
                output=settings.output,
                precision=settings.precision,
            )
        except Exception:
            has = "has the whole run" if self.log_is_whole else "has the run but for its last lines"
            self._reporter.warn(f"{settings.output} is not written; the log {settings.log} {has}")
            raise
        stop()
        if not settings.quiet:
            print_localization(localization, settings.output)
        if fit_of(run, expected).is_doubtful:
            self._reporter.warn(wrong_map(settings.lab_file.name))
            return WRONG_MAP
        return 0

    def close(self) -> None:
        """Close the method, see `Method.close`."""
        if self._worker is not None:
            self._worker.abandon()
