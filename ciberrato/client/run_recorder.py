"""The log and the live filter of a robot's program, beside its loop."""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from ciberrato.client.core import RobotCore
from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from ciberrato.files.run_log import RunWriter
    from ciberrato.localization import Estimate, PoseFilter
    from ciberrato.protocol.messages import Actions, Measures
    from ciberrato.world.lab import Lab


class RunRecorder:
    """Writes what a robot saw and did, and feeds the live filter, cycle by cycle.

    Parameters
    ----------
    log : str or Path or None
        File for the log, ``run.jsonl``; what it held is lost.
    localize : Lab or str or Path or None
        The lab, its file, or the name of one that ships: the live filter runs in it.
    wait : bool
        Whether to wait for the filter's tables before the run, where no clock runs meanwhile.
    """

    def __init__(
        self, log: str | Path | None, localize: Lab | str | Path | None, *, wait: bool = False
    ) -> None:
        self._wait = wait
        self._log = None if log is None else _writable(log)
        self.lab, self._lab_name, self._lab_data = _find(localize)
        self._writer: RunWriter | None = None
        self._filter: PoseFilter | None = None
        self.pose: Estimate | None = None

    def begin(self, core: RobotCore) -> None:
        """Open the log and start the filter, once the simulator has accepted the robot."""
        assert core.acceptance is not None
        if self.lab is not None:
            from ciberrato.localization import PoseFilter

            self._filter = PoseFilter(self.lab, core.acceptance.parameters, core.angles, wait=self._wait)
            self._filter.__enter__()
        if self._log is not None:
            from ciberrato.files.run_log import RunWriter
            from ciberrato.files.run_records import RunHeader

            header = RunHeader(
                lab_name=self._lab_name,
                lab_sha256=hashlib.sha256(self._lab_data).hexdigest(),
                parameters=core.acceptance.parameters,
                n_beacons=core.acceptance.n_beacons,
                sensor_angles=core.angles,
                robot_name=core.registration.name or "",
                robot_position=core.registration.robot_id,
            )
            try:
                self._writer = RunWriter(self._log, header)
            except OSError as error:
                raise UsageError(f"{self._log}: cannot be written: {error.strerror}") from None

    def observe(self, measures: Measures, command: tuple[float, float]) -> None:
        """Update the filter, before the program sees the Measures.

        Parameters
        ----------
        measures : Measures
        command : (float, float)
            Motor commands of the last answer, which moved the robot in this cycle.
        """
        if self._filter is not None:
            estimate = self._filter.observe(measures, command)
            self.pose = estimate if estimate.modes else None  # none until the tables are there

    def record(self, measures: Measures, actions: Actions) -> None:
        """Write a cycle, with its answer."""
        if self._writer is None:
            return
        from ciberrato.files.run_records import Cycle

        assert actions.left_motor is not None
        assert actions.right_motor is not None
        pose = self.pose
        cycle = Cycle(
            time=measures.time,
            start=measures.start,
            stop=measures.stop,
            collision=measures.collision,
            compass=measures.compass,
            ground=measures.ground,
            infrared=measures.infrared,
            leds=(measures.end_led, measures.returning_led, measures.visiting_led),
            command=(actions.left_motor, actions.right_motor),
            answered=True,
            phase="running" if measures.start else "waiting",
            estimate=None if pose is None else _logged(pose),
            entropy=None if pose is None else round(pose.entropy, 4),
        )
        self._writer.write(cycle)

    def close(self) -> None:
        """Close the log and end the filter's processes; again is harmless."""
        if self._writer is not None:
            self._writer.close()
            if self._writer.missing:
                lines, why = self._writer.missing, self._writer.fault
                warnings.warn(f"{self._log}: lacks the last {lines} lines: {why}", stacklevel=2)
            self._writer = None
        if self._filter is not None:
            self._filter.__exit__(None, None, None)
            self._filter = None


def _writable(log: str | Path) -> Path:
    """Return the log's path, if a file can be there: said before the robot takes its place."""
    if not isinstance(log, str | Path) or not str(log):
        raise UsageError(f"log {log!r} is not the name of a file")
    path = Path(log)
    if path.is_dir():
        raise UsageError(f"{path}: cannot be written: it is a directory")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: cannot be written: no directory {path.parent}; create it")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UsageError(f"{path}: cannot be written: no permission")
    return path


def _find(localize: Lab | str | Path | None) -> tuple[Lab | None, str, bytes]:
    from ciberrato.world.lab import Lab

    if localize is None:
        return None, "", b""
    if isinstance(localize, str | Path):
        from ciberrato.files.lab import parse_lab
        from ciberrato.files.xml import read_file
        from ciberrato.labs import find_lab

        path = find_lab(localize)
        data = read_file(path)
        return parse_lab(data, str(path)), path.name, data
    if not isinstance(localize, Lab):
        raise UsageError(f"localize {localize!r} is neither a lab nor the name of one")
    return localize, "", b""


def _logged(pose: Estimate) -> tuple[float, float, float, float]:
    """Return an estimate as logs have it: units, degrees, probability."""
    degrees = math.degrees(pose.heading)
    return round(pose.x, 4), round(pose.y, 4), round(degrees, 3), round(pose.probability, 6)
