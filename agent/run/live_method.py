"""A run of the agent with the pose filter in the loop: `--online`, and every drive but the published one."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from agent.offline.exit_status import WRONG_MAP
from agent.run.published_method import PublishedMethod

if TYPE_CHECKING:
    from collections.abc import Callable

    from agent.drives.base import Drive
    from agent.run.live_controller import LiveController
    from agent.run.reporter import Reporter
    from agent.run.session import Settings
    from agent.run.signals import Interrupts
    from ciberrato.arrays import Floats
    from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
    from ciberrato.localization.live.live_filter import LiveFilter
    from ciberrato.localization.pose_filter import PoseFilter
    from ciberrato.localization.tables.worker import TableWorker

_LINE_EVERY = 20  # cycles between two lines of what is known
_BAR = 24
_POLL = 0.05  # seconds between looks whether the user wants to wait no longer


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """User's settings of the live filter and the drive.

    Attributes
    ----------
    drive : {"right", "explore", "active", "goto"}
    goal : (float, float) or None
        Goal of ``goto``, in units.
    start : str
        Prior of the start, see `ciberrato.localization.evidence.start_prior.parse_start`.
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


class LiveMethod:
    """Has a localizer take every message in; at the end it writes the filter's beliefs.

    After a drive to the right without `smooth` the belief file is the published method's.

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
        self._settings = settings
        self._live = live
        self._interrupts = interrupts
        self._reporter = reporter
        # The published method's tables are wanted at the end, if at all; until then they are not worked out.
        self._published = PublishedMethod(settings, interrupts, reporter, late=True)
        self._bar = _ProgressBar()
        self._tables: TableWorker | None = None
        self._localizer: PoseFilter | None = None
        self._header: RunHeader | None = None
        self._controller: LiveController | None = None
        self._without_tables = self._doubted = False
        self._claimed = False
        self._restarts = 0

    def prepare(self) -> bool:
        """Fetch tables, and load what the loop will need: later, that would cost it its first cycles."""
        import gc

        from ciberrato.localization.tables.worker import TableWorker

        settings = self._settings
        self._tables = TableWorker(
            settings.lab, settings.angles, progress=None if settings.quiet else self._bar.show
        )
        self._tables.start()
        import agent.offline.expected_readings
        import agent.run.live_controller  # noqa: F401
        import ciberrato.files.run_log
        import ciberrato.localization.pose_filter  # noqa: F401
        from agent.drives.registry import load_drive
        from ciberrato.localization.belief import compiled

        load_drive(self._live.drive)
        if compiled.at_hand():
            self._tables.wait_for_loops()
        # What is here now stays: no need to look through it again and again for what can go.
        gc.collect()
        gc.freeze()
        return not self._live.lockstep or self._tables_are_there()

    def begin(self) -> None:
        """Begin the run, see `Method.begin`."""
        self._published.begin()

    def announce(self, header: RunHeader) -> None:
        """Announce the run, see `Method.announce`."""
        self._header = header
        self._published.announce(header)

    def _tables_are_there(self) -> bool:
        """Wait for everything that would come later in another cycle next time; say whether to go on."""
        assert self._tables is not None
        self._reporter.say("in lockstep: registering when the tables are ready")
        for wait in (self._tables.wait, self._tables.wait_for_loops):
            while not wait(_POLL):
                if self._interrupts.received:
                    self._reporter.warn("interrupted before anything was recorded; nothing is written")
                    return False
        if self._tables.error is not None:
            raise self._tables.error
        return True

    def controller(self, header: RunHeader) -> LiveController:
        """Return the controller, see `Method.controller`."""
        from agent.run.live_controller import LiveController
        from ciberrato.localization.evidence.other_sensors import sensors_used
        from ciberrato.localization.pose_filter import PoseFilter

        settings, live = self._settings, self._live
        sensors = ", ".join(sensors_used(settings.lab, header.parameters))
        self._reporter.say(f"the pose is estimated from {sensors}; start: {live.start}")
        self._localizer = PoseFilter(
            settings.lab,
            header.parameters,
            settings.angles,
            start=live.start,
            budget=math.inf if live.lockstep else None,
            tables=self._tables,
        )
        self._controller = LiveController(
            header,
            self._localizer,
            self._make_drive(header),
            exit_at_wall=settings.exit_at_wall,
            exit_when_finished=live.exit_when_finished,
            lockstep=live.lockstep,
        )
        return self._controller

    def _make_drive(self, header: RunHeader) -> Drive | None:
        settings, live = self._settings, self._live
        if live.drive == "right":
            return None
        from agent.drives import make_drive

        return make_drive(
            live.drive,
            settings.lab,
            header.parameters,
            settings.angles,
            goal=live.goal,
            cruise=settings.cruise,
        )

    @property
    def log_is_whole(self) -> bool:
        """Whether the log is whole, see `Method.log_is_whole`."""
        return self._published.log_is_whole

    @log_is_whole.setter
    def log_is_whole(self, value: bool) -> None:
        self._published.log_is_whole = value

    @property
    def failure(self) -> str | None:
        """Failure of the run, see `Method.failure`."""
        return self._published.failure

    def report(self, cycle: Cycle) -> None:
        """Report on the run, see `Method.report`."""
        assert self._localizer is not None
        live = self._localizer.live
        if live.doubtful_since is not None and not self._doubted:
            self._doubted = True
            self._reporter.warn(f"time {cycle.time}: {self._wrong_map()}")
        if cycle.start and not live.is_ready and not self._without_tables:
            self._without_tables = True
            how = "waiting for them" if self._live.drive == "right" else "driving by the IR sensors alone"
            self._reporter.say(f"time {cycle.time}: the lab's tables are not ready yet, {how}; no belief yet")
        if cycle.estimate is None or not self._live.show:
            return
        from agent.offline.summary import cell_name
        from ciberrato.localization.belief.estimate import CERTAIN, cell_at

        x, y, heading, probability = cycle.estimate
        assert live.filter is not None
        restarts = len(live.filter.restarts)
        news = ""
        if restarts > self._restarts:
            news = "; the robot must have been moved, starting anew"
        elif self._claimed != (probability > CERTAIN):
            self._claimed = not self._claimed
            news = "; the pose is known" if self._claimed else "; the pose is no longer certain"
        self._restarts = restarts
        if news or cycle.time % _LINE_EVERY == 0:
            self._reporter.say(
                f"time {cycle.time}: cell {cell_name(cell_at(x, y))}, "
                f"x {x:.2f} y {y:.2f} heading {round(heading)}, p {probability:.3f}, "
                f"entropy {cycle.entropy:.1f} bits{self._others(probability)}{news}"
            )

    def _wrong_map(self) -> str:
        from agent.offline.map_fit import wrong_map

        return wrong_map(self._settings.lab_file.name)

    def _summary(self, live: LiveFilter) -> list[str]:
        """Return how the filter kept up, as far as the user would see it."""
        assert self._tables is not None
        assert self._header is not None
        assert self._controller is not None
        exchange = self._controller.exchange
        return live.statistics.lines(
            self._tables,
            cycle_time=self._header.parameters.cycle_time,
            lost=exchange.lost,
            unanswered=exchange.unanswered,
        )

    def _others(self, probability: float) -> str:
        """Return what else the pose may be, if it is not certain."""
        from ciberrato.localization.belief.estimate import CERTAIN

        assert self._localizer is not None
        if probability > CERTAIN:
            return ""
        others = [mode for mode in self._localizer.live.modes() if mode.probability >= 0.05]
        if len(others) < 2:
            return ""
        listed = ", ".join(
            f"{mode.x:.1f},{mode.y:.1f},{math.degrees(mode.heading):.0f} ({mode.probability:.2f})"
            for mode in others[:5]
        )
        return f"; {len(others)} places fit: {listed}"

    def finish(self, run: RecordedRun | None, reason: str, stop: Callable[[], None]) -> int:
        """Finish the run, see `Method.finish`."""
        if self._localizer is None or not self._localizer.live.history:
            return self._published.finish(run, reason, stop)
        live = self._localizer.live
        stop()
        begin = time.monotonic()
        if live.filter is None:
            self._reporter.say("the lab's tables are not ready yet; waiting for them to process the run")
        live.finish()
        assert self._tables is not None
        self._tables.stop()
        for line in self._summary(live):
            self._reporter.say(line)
        if time.monotonic() - begin > 1.0:
            self._reporter.say(f"caught up in {time.monotonic() - begin:.1f} s")
        if self._live.drive == "right" and not self._live.smooth:
            status = self._published.finish(run, reason, stop)
        else:
            status = self._write_beliefs(reason)
        if live.doubtful_since is None:
            return status
        self._reporter.warn(f"since time {live.doubtful_since} {self._wrong_map()}")
        return status or WRONG_MAP

    def _write_beliefs(self, reason: str) -> int:
        from ciberrato.files.beliefs import write_beliefs

        assert self._localizer is not None
        live, settings = self._localizer.live, self._settings
        how = f"smoothing {len(live.history)} messages, which may take a while, and " * self._live.smooth
        self._reporter.say(
            f"{reason}; finishing: {how}writing {settings.output} (signals are ignored until then)"
        )
        beliefs = self._smoothed(live) if self._live.smooth else live.moments.blocks
        write_beliefs(settings.output, beliefs, settings.precision)
        self._reporter.say(f"{settings.output}: {len(beliefs)} blocks")
        return 0

    def _smoothed(self, live: LiveFilter) -> Floats:
        from ciberrato.localization.cell_beliefs import cell_beliefs

        assert self._tables is not None
        assert self._header is not None
        tables = self._tables.fine or self._tables.coarse
        assert tables is not None
        return cell_beliefs(
            self._settings.lab,
            tables,
            self._header.parameters,
            live.history,
            start=self._live.start,
            smooth=True,
        )

    def close(self) -> None:
        """Close the method, see `Method.close`."""
        if self._tables is not None:
            self._tables.stop()
            self._tables.join_processes()  # the program's end would leave their scratch folder
        self._published.close()


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
