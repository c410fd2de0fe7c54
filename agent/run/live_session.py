"""A run of the agent with the pose filter in the loop: `--online`, and every drive but the published one."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from agent.run.session import Session, Settings

if TYPE_CHECKING:
    from agent.drives.base import Drive
    from agent.drives.right.controller import Controller
    from agent.run.reporter import Reporter
    from agent.run.signals import Interrupts
    from ciberrato.files.run_log import RunWriter
    from ciberrato.files.run_records import Cycle
    from ciberrato.localization.live_filter import LiveFilter
    from ciberrato.localization.tables.worker import TableWorker
    from ciberrato.net.link import Link

_LINE_EVERY = 20  # cycles between two lines of what is known
_BAR = 24
_POLL = 0.05  # seconds between looks whether the user wants to wait no longer


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """What the user asked for of the live filter and the drive.

    Attributes
    ----------
    drive : {"right", "explore", "active", "goto"}
    goal : (float, float) or None
        Where ``goto`` goes, in units.
    start : str
        What is possible at the start, see `ciberrato.localization.evidence.start_prior.parse_start`.
    smooth : bool
        Whether the belief file is computed afterwards, from the whole run.
    exit_when_finished : bool
        Whether the run is over when the drive has nothing more to do.
    show : bool
        Whether to print what is known while driving.
    lockstep : bool
        Whether the simulator waits for every answer. Then the run begins when the tables are there, and the
        filter takes every message in at once: a run with the same seed is the same run.
    """

    drive: str = "right"
    goal: tuple[float, float] | None = None
    start: str = "anywhere"
    smooth: bool = False
    exit_when_finished: bool = False
    show: bool = True
    lockstep: bool = False


class LiveSession(Session):
    """One run of the agent with the pose filter in the loop.

    Parameters
    ----------
    settings : Settings
    live : LiveSettings
    interrupts : Interrupts
        Armed.
    reporter : Reporter
    """

    def __init__(
        self, settings: Settings, live: LiveSettings, interrupts: Interrupts, reporter: Reporter
    ) -> None:
        from ciberrato.localization.belief import compiled

        compiled.choice()  # to complain at once
        super().__init__(settings, interrupts, reporter)
        self._live_settings = live
        self._tables: TableWorker | None = None
        self._live: LiveFilter | None = None
        self._bar = _ProgressBar()
        self._claimed = False
        self._restarts = 0
        self._finished: str | None = None

    def run(self) -> int:
        """See `Session.run`."""
        try:
            self._start_tables()
            self._prepare()
            if self._live_settings.lockstep and not self._tables_are_there():
                return self._interrupts.status
            return super().run()
        finally:
            if self._tables is not None:
                self._tables.stop()

    def _prepare(self) -> None:
        """Load what the loop will need: later, that would cost it its first cycles."""
        import gc

        import agent.drives
        import agent.offline.expected_readings
        import agent.run.live_controller  # noqa: F401
        import ciberrato.files.run_log
        import ciberrato.localization.live_filter  # noqa: F401
        from ciberrato.localization.belief import compiled

        if compiled.at_hand():
            assert self._tables is not None
            self._tables.wait_for_loops()
        # What is here now stays: no need to look through it again and again for what can go.
        gc.collect()
        gc.freeze()

    def _tables_are_there(self) -> bool:
        """Wait for everything that would come later in another cycle next time; say whether to go on."""
        assert self._tables is not None
        self._reporter.say("in lockstep: registering when the tables are there")
        for wait in (self._tables.wait, self._tables.wait_for_loops):
            while not wait(_POLL):
                if self._interrupts.received:
                    self._reporter.warn("interrupted before anything was recorded; nothing is written")
                    return False
        if self._tables.error is not None:
            raise self._tables.error
        return True

    def _start_worker(self) -> None:
        # The published method's tables are wanted at the end, if at all; until then they are not worked out.
        from agent.offline.expected_readings import GroundTruthWorker

        settings = self._settings
        self._worker = GroundTruthWorker(settings.lab, settings.angles, model=settings.distance_model)

    def _start_tables(self) -> None:
        from ciberrato.localization.tables.worker import TableWorker

        settings = self._settings
        self._tables = TableWorker(
            settings.lab, settings.angles, progress=None if settings.quiet else self._bar.show
        )
        self._tables.start()

    def _make_controller(self) -> Controller:
        from agent.run.live_controller import LiveController
        from ciberrato.localization.evidence.other_sensors import sensors_used
        from ciberrato.localization.live_filter import LiveFilter

        assert self._header is not None
        assert self._tables is not None
        settings, live = self._settings, self._live_settings
        sensors = ", ".join(sensors_used(settings.lab, self._header.parameters))
        self._reporter.say(f"the pose is told by {sensors}; start: {live.start}")
        budget = math.inf if live.lockstep else None
        self._live = LiveFilter(
            settings.lab, self._header.parameters, self._tables, start=live.start, budget=budget
        )
        return LiveController(
            self._header,
            self._live,
            self._make_drive(),
            exit_at_wall=settings.exit_at_wall,
            exit_when_finished=live.exit_when_finished,
            lockstep=live.lockstep,
        )

    def _make_drive(self) -> Drive | None:
        settings, live = self._settings, self._live_settings
        if live.drive == "right":
            return None
        from agent.drives import make_drive

        assert self._header is not None
        return make_drive(
            live.drive,
            settings.lab,
            self._header.parameters,
            settings.angles,
            goal=live.goal,
            cruise=settings.cruise,
        )

    def _record(self, cycle: Cycle, writer: RunWriter) -> None:
        super()._record(cycle, writer)
        if cycle.estimate is None or not self._live_settings.show:
            return
        x, y, heading, probability = cycle.estimate
        assert self._live is not None
        assert self._live.filter is not None
        restarts = len(self._live.filter.restarts)
        news = ""
        if restarts > self._restarts:
            news = "; the robot must have been moved, starting anew"
        elif self._claimed != (probability > 0.95):
            self._claimed = not self._claimed
            news = "; the pose is known" if self._claimed else "; the pose is no longer certain"
        self._restarts = restarts
        if news or cycle.time % _LINE_EVERY == 0:
            self._reporter.say(
                f"time {cycle.time}: cell row {math.floor(y / 2.0)} column {math.floor(x / 2.0)}, "
                f"x {x:.2f} y {y:.2f} heading {round(heading)}, p {probability:.3f}, "
                f"entropy {cycle.entropy:.1f} bits{self._others(probability)}{news}"
            )

    def _others(self, probability: float) -> str:
        """Say what else the pose may be, if it is not certain."""
        assert self._live is not None
        if probability > 0.95:
            return ""
        others = [mode for mode in self._live.modes() if mode.probability >= 0.05]
        if len(others) < 2:
            return ""
        listed = ", ".join(
            f"{mode.x:.1f},{mode.y:.1f},{math.degrees(mode.heading):.0f} ({mode.probability:.2f})"
            for mode in others[:5]
        )
        return f"; {len(others)} places fit: {listed}"

    def _finish(self, link: Link, reason: str) -> int:
        if self._live is None or not self._live.history:
            return self._finish_as_published(link, reason)
        self._stop(link)
        begin = time.monotonic()
        self._live.finish()
        assert self._tables is not None
        self._tables.stop()
        for line in self._live.statistics.lines(self._tables):
            self._reporter.say(line)
        if time.monotonic() - begin > 1.0:
            self._reporter.say(f"caught up in {time.monotonic() - begin:.1f} s")
        if self._live_settings.drive == "right" and not self._live_settings.smooth:
            return self._finish_as_published(link, reason)
        return self._write_beliefs(reason)

    def _finish_as_published(self, link: Link, reason: str) -> int:
        if self._worker is not None:
            self._worker.start()
        return super()._finish(link, reason)

    def _write_beliefs(self, reason: str) -> int:
        from ciberrato.files.beliefs import write_beliefs
        from ciberrato.localization.cell_beliefs import cell_beliefs

        assert self._live is not None
        assert self._tables is not None
        settings = self._settings
        tables = self._tables.fine or self._tables.coarse
        assert tables is not None
        self._reporter.say(f"{reason}; finishing: writing {settings.output} (signals are ignored until then)")
        assert self._header is not None
        beliefs = cell_beliefs(
            settings.lab,
            tables,
            self._header.parameters,
            self._live.history,
            start=self._live_settings.start,
            smooth=self._live_settings.smooth,
        )
        write_beliefs(settings.output, beliefs, settings.precision)
        self._reporter.say(f"{settings.output}: {len(beliefs)} blocks")
        return 0


class _ProgressBar:
    """Shows on a terminal how far the tables are."""

    def __init__(self) -> None:
        self._shown = -1

    def show(self, which: str, done: float) -> None:
        """Draw the bar."""
        if not sys.stderr.isatty():
            return
        filled = int(_BAR * done)
        if filled == self._shown and done < 1.0:
            return
        self._shown = filled
        end = "\n" if done >= 1.0 else ""
        sys.stderr.write(f"\r{which} tables [{'#' * filled}{'.' * (_BAR - filled)}]{end}")
        sys.stderr.flush()
