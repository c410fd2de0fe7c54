"""A run from the simulator's own log, as if the agent had recorded it.

The log of the real simulator (and of ours, ``--log``) holds every robot's Measures and motor commands. The
tracker finds the crossings in them, as it does on the wire. The log does not say how the robot's sensors
were mounted: that must be given.
"""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

from agent.drives.right.controller import make_cycle
from agent.drives.right.tracker import CellTracker
from ciberrato.errors import UsageError
from ciberrato.files.log_kind import is_simulator_log as is_simulator_log
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
from ciberrato.files.simulator_log import LogHeader, LogRecord, LogStream
from ciberrato.physics.kinematics import STANDSTILL
from ciberrato.world.coordinates import PoseInDegrees, SensorAngles
from ciberrato.world.lab import Lab


class LogReplay:
    """Follows one robot through a simulator's log, record by record.

    Parameters
    ----------
    log : LogHeader
    angles : tuple of four float
        Mounting angles of the robot's IR sensors in degrees.
    robot : int
        Its position number.

    Attributes
    ----------
    poses : dict of int to (x, y, heading)
        True poses, by cycle; units and degrees.
    """

    def __init__(self, log: LogHeader, angles: SensorAngles, robot: int) -> None:
        self.poses: dict[int, PoseInDegrees] = {}
        self._log, self._angles, self._robot = log, angles, robot
        self._tracker = CellTracker(log.parameters, angles)
        self._command: tuple[float, float] | None = None
        self._cycles: list[Cycle] = []
        self._name = ""

    def add(self, record: LogRecord) -> None:
        """Add the next record; one without the robot is skipped."""
        logged = record.robot(self._robot)
        if logged is None:
            return
        self._name = logged.name
        self.poses[record.time] = (logged.x, logged.y, logged.direction_deg)
        crossing = self._tracker.observe(logged.measures, self._command)
        if logged.actions is not None:
            left, right = self._command or STANDSTILL
            self._command = (
                left if logged.actions.left_motor is None else logged.actions.left_motor,
                right if logged.actions.right_motor is None else logged.actions.right_motor,
            )
        self._cycles.append(
            make_cycle(
                logged.measures,
                self._tracker,
                crossing,
                command=self._command,
                answered=logged.actions is not None,
                phase="logged",
            )
        )

    @property
    def run(self) -> RecordedRun:
        """The run so far, as if the agent had recorded it."""
        lab = self._log.lab
        header = RunHeader(
            lab_name=lab.name,
            lab_sha256=hashlib.sha256(repr(dataclasses.astuple(lab)).encode()).hexdigest(),
            parameters=self._log.parameters,
            n_beacons=self._log.n_beacons,
            sensor_angles=self._angles,
            robot_name=self._name,
            robot_position=self._robot,
        )
        return RecordedRun(header, tuple(self._cycles))


def replay_of(path: Path, angles: SensorAngles, *, robot: int | None = None) -> tuple[LogReplay, Lab]:
    """Follow one robot through a whole log.

    Parameters
    ----------
    path : Path
    angles : tuple of four float
        Mounting angles of the robot's IR sensors in degrees.
    robot : int or None
        Its position number; None = the first in the log.

    Returns
    -------
    replay : LogReplay
    lab : Lab
        As the log holds it.

    Raises
    ------
    LabError
        If the file is not a simulator's log.
    UsageError
        If that robot is not in it.
    """
    stream = LogStream(path)
    records = iter(stream)
    first = next(records, None)
    present = [] if first is None else [logged.robot_id for logged in first.robots]
    if first is None or not present:
        raise UsageError(f"{path}: the log holds no robot")
    wanted = present[0] if robot is None else robot
    if wanted not in present:
        listed = ", ".join(map(str, present))
        raise UsageError(f"{path}: the log holds no robot {wanted}; there is {listed}")
    replay = LogReplay(stream.header, angles, wanted)
    for record in (first, *records):
        replay.add(record)
    return replay, stream.header.lab


def run_from_simulator_log(
    path: Path, angles: SensorAngles, *, robot: int | None = None
) -> tuple[RecordedRun, Lab]:
    """Read one robot's run from a simulator's log.

    Parameters
    ----------
    path : Path
    angles : tuple of four float
        Mounting angles of the robot's IR sensors in degrees.
    robot : int or None
        Its position number; None = the first in the log.

    Returns
    -------
    run : RecordedRun
    lab : Lab
        As the log holds it.

    Raises
    ------
    LabError
        If the file is not a simulator's log.
    UsageError
        If that robot is not in it.
    """
    replay, lab = replay_of(path, angles, robot=robot)
    return replay.run, lab
