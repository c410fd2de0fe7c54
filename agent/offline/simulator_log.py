"""A run from the simulator's own log, as if the agent had recorded it.

The log of the real simulator (and of ours, ``--log``) holds every robot's Measures and motor commands. The
tracker finds the crossings in them, as it does on the wire. The log does not say how the robot's sensors
were mounted: that must be told.
"""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

from agent.drives.right.controller import make_cycle
from agent.drives.right.tracker import CellTracker
from ciberrato.errors import LabError, UsageError
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
from ciberrato.files.simulator_log import LogStream
from ciberrato.physics.kinematics import STANDSTILL
from ciberrato.world.coordinates import SensorAngles
from ciberrato.world.lab import Lab


def is_simulator_log(path: Path) -> bool:
    """Tell whether a file begins like a simulator's log and not like an agent's.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool

    Raises
    ------
    LabError
        If it cannot be read.
    """
    import gzip

    try:
        with path.open("rb") as stream:
            start = stream.read(64)
            if start.startswith(b"\x1f\x8b"):
                stream.seek(0)
                start = gzip.GzipFile(fileobj=stream).read(64)
    except (OSError, EOFError) as error:
        raise LabError(
            f"cannot read the log: {getattr(error, 'strerror', None) or error}", source=str(path)
        ) from None
    return start.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"<Log", b"<?xml", b"<!--"))


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
    log = stream.header
    tracker = CellTracker(log.parameters, angles)
    command: tuple[float, float] | None = None
    cycles: list[Cycle] = []
    name = ""
    for record in (first, *records):
        logged = record.robot(wanted)
        if logged is None:
            continue
        name = logged.name
        crossing = tracker.observe(logged.measures, command)
        if logged.actions is not None:
            left, right = command or STANDSTILL
            command = (
                left if logged.actions.left_motor is None else logged.actions.left_motor,
                right if logged.actions.right_motor is None else logged.actions.right_motor,
            )
        answered = logged.actions is not None
        cycles.append(
            make_cycle(logged.measures, tracker, crossing, command=command, answered=answered, phase="logged")
        )
    header = RunHeader(
        lab_name=log.lab.name,
        lab_sha256=hashlib.sha256(repr(dataclasses.astuple(log.lab)).encode()).hexdigest(),
        parameters=log.parameters,
        n_beacons=log.n_beacons,
        sensor_angles=angles,
        robot_name=name,
        robot_position=wanted,
    )
    return RecordedRun(header, tuple(cycles)), log.lab
