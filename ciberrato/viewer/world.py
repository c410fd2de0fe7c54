"""The world as a viewer sees it: what the simulator's messages add up to."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from ciberrato.protocol import Acceptance, Restart, RobotStatus, SimulatorMessage
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

_RATE_SECONDS = 3.0
_STOPPED = frozenset({"Stopped"})
_OUT = frozenset({"Finished", "Removed"})


@dataclass(frozen=True, slots=True)
class Frame:
    """All robots after one cycle.

    Attributes
    ----------
    time : int
        Simulated cycles so far.
    phase : str
        State of the simulator, as far as it shows: ``empty`` (no robots), ``ready`` (not started yet),
        ``running``, ``stopped`` or ``finished``.
    robots : tuple of RobotStatus
        In order of their ids, removed ones included.
    """

    __repr__ = short_repr

    time: int
    phase: str
    robots: tuple[RobotStatus, ...]


class World:
    """Puts status messages together into frames, one a cycle.

    The simulator sends a status for each robot in each cycle, in order of the ids, and nothing that says
    where a cycle ends. A cycle is over with the status of the last robot known, or when an id comes up that
    is not higher than the one before: so new robots are noticed, and lost datagrams delay one frame only.

    Attributes
    ----------
    lab : Lab or None
    grid : StartGrid or None
    parameters : Parameters or None
    frame : Frame
        The last one.
    """

    def __init__(self) -> None:
        self.lab: Lab | None = None
        self.grid: StartGrid | None = None
        self.parameters: Parameters | None = None
        self.frame = Frame(0, "empty", ())
        self._robots: dict[int, RobotStatus] = {}
        self._seen: set[int] = set()
        self._last_id = -1
        self._times: deque[tuple[float, int]] = deque()

    def receive(self, message: SimulatorMessage, now: float) -> list[Frame]:
        """Process a message of the simulator.

        Parameters
        ----------
        message : SimulatorMessage
        now : float
            Seconds of any clock that does not go back.

        Returns
        -------
        list of Frame
            The frames that this message completed: none, one, or (with lost datagrams) two.
        """
        match message:
            case Acceptance():
                self.parameters = message.parameters
            case Lab():
                self.lab = message
            case StartGrid():
                self.grid = message
            case Restart():
                self.forget_robots()
            case RobotStatus():
                return self._receive_status(message, now)
            case _:
                pass
        return []

    def forget_robots(self) -> None:
        """Remove all robots, as the simulator does after a reset."""
        self._robots = {}
        self._seen = set()
        self._last_id = -1
        self._times.clear()
        self.frame = Frame(0, "empty", ())

    def rate(self, now: float) -> float:
        """Compute the cycles per second over the last seconds; 0 when nothing moves."""
        while len(self._times) > 2 and now - self._times[0][0] > _RATE_SECONDS:
            self._times.popleft()
        if len(self._times) < 2 or now - self._times[-1][0] > _RATE_SECONDS:
            return 0.0
        (start, first), (end, last) = self._times[0], self._times[-1]
        return (last - first) / (end - start) if end > start else 0.0

    def _receive_status(self, status: RobotStatus, now: float) -> list[Frame]:
        frames = []
        if status.robot_id <= self._last_id and self._seen:
            frames.append(self._complete(now))
        if self._robots and status.time < next(iter(self._robots.values())).time:
            # Time went back: the world was reset and no message of it has come, or not yet.
            self.forget_robots()
        self._robots[status.robot_id] = status
        self._seen.add(status.robot_id)
        self._last_id = status.robot_id
        if self._seen == set(self._robots) and status.robot_id == max(self._robots):
            frames.append(self._complete(now))
        return frames

    def _complete(self, now: float) -> Frame:
        robots = tuple(self._robots[robot_id] for robot_id in sorted(self._robots))
        time = max(robot.time for robot in robots)
        self.frame = Frame(time, self._phase(time, robots), robots)
        self._seen = set()
        if not self._times or self._times[-1][1] != time:
            self._times.append((now, time))
            self.rate(now)
        return self.frame

    def _phase(self, time: int, robots: tuple[RobotStatus, ...]) -> str:
        sim_time = self.parameters.sim_time if self.parameters is not None else 0
        if 0 < sim_time <= time:
            return "finished"
        states = {robot.state for robot in robots} - _OUT
        moving = time > self.frame.time if self.frame.robots else False
        if states <= _STOPPED and not moving:
            return "ready" if time == 0 else "stopped"
        # Robots that are all finished or removed do not say whether time goes on; time itself does.
        return "running"
