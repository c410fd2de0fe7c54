"""A simulator's log as something to watch: every robot where it really was, in every cycle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ciberrato.files.simulator_log import LoggedRobot, LogStream
from ciberrato.overlay import OverlayMessage
from ciberrato.protocol import Acceptance, RobotStatus
from ciberrato.viewer.session import Session
from ciberrato.world.coordinates import SensorAngles


def load_simulator_log(
    path: Path, angles: SensorAngles | None = None, notify: Callable[[str], None] = lambda line: None
) -> Session:
    """Create a session that shows a log, of the real simulator or of ours.

    Parameters
    ----------
    path : Path
        Plain, or packed with gzip.
    angles : tuple of four float, or None
        Angles of the robots' IR sensors in degrees, for drawing their cones; the log does not hold them.
        None = 0, 60, -60, 180.
    notify : callable
        Called with a line if the log has no end.

    Returns
    -------
    Session

    Raises
    ------
    LabError
        If the file is no simulator's log; names the line.
    UsageError
        If it cannot be read.
    """
    stream = LogStream(path)
    header = stream.header
    session = Session(path.name, recording=True, notify=notify)
    session.show(Acceptance(parameters=header.parameters))
    session.show(header.lab)
    session.show(header.grid)
    robots: set[int] = set()
    for record in stream:
        for logged in record.robots:
            robots.add(logged.robot_id)
            session.show(_status(logged, record.time))
    if not stream.complete:
        notify(f"{path} has no end (was the simulator killed?); it is shown as far as it goes")
    if not robots:
        notify(f"{path} holds no robot")
    if angles is not None:
        for robot in sorted(robots):
            # As an agent says it: the cones of the page are those of the log's robots.
            session.overlays.receive(
                OverlayMessage(source=f"robot {robot}", robot=robot, angles=angles), now=0.0
            )
    return session


def _status(logged: LoggedRobot, time: int) -> RobotStatus:
    return RobotStatus(
        name=logged.name,
        robot_id=logged.robot_id,
        time=time,
        score=logged.score,
        arrival_time=logged.arrival_time,
        returning_time=logged.returning_time,
        collisions=logged.collisions,
        collision=logged.collision,
        visited_mask=logged.visited_mask,
        state=logged.state,
        x=logged.x,
        y=logged.y,
        direction_deg=logged.direction_deg,
    )
