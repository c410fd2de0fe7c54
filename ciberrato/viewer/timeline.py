"""The run so far, to be looked at again: frames in bounded memory, and what happened when."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

from ciberrato.protocol import RobotStatus
from ciberrato.reprs import short_repr
from ciberrato.viewer.world import Frame

MOST_FRAMES = 8192
"""Most frames that are kept; of more, every second one of the older half is forgotten."""

MOST_BYTES = 24_000_000
MOST_MARKS = 2000


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happened.

    Attributes
    ----------
    time : int
        Simulated cycles.
    kind : str
        ``joined``, ``started``, ``stopped``, ``ended``, ``collision``, ``target``, ``returning``,
        ``finished`` or ``removed``.
    robot : int
        Its id, 0 = none in particular.
    """

    __repr__ = short_repr

    time: int
    kind: str
    robot: int = 0


class Timeline:
    """Frames by time, already encoded for the page, and marks.

    Attributes
    ----------
    epoch : int
        Counts the runs: it changes whenever everything before is forgotten.
    marks : list of Mark
    """

    def __init__(self) -> None:
        self.epoch = 0
        self.marks: list[Mark] = []
        self._times: list[int] = []
        self._frames: list[str] = []
        self._bytes = 0
        self._before: Frame | None = None

    def __len__(self) -> int:
        return len(self._times)

    @property
    def span(self) -> tuple[int, int]:
        """First and last time."""
        return (self._times[0], self._times[-1]) if self._times else (0, 0)

    def clear(self) -> None:
        """Clear the time line and begin a new epoch."""
        self.epoch += 1
        self.marks = []
        self._times = []
        self._frames = []
        self._bytes = 0
        self._before = None

    def add(self, frame: Frame, encoded: str) -> None:
        """Append a frame; one of the same time as the last replaces it, an earlier one begins a new epoch.

        Parameters
        ----------
        frame : Frame
        encoded : str
            Text to return for it.
        """
        if self._times and frame.time < self._times[-1]:
            self.clear()
        self._mark(frame)
        if self._times and frame.time == self._times[-1]:
            self._bytes += len(encoded) - len(self._frames[-1])
            self._frames[-1] = encoded
        else:
            self._times.append(frame.time)
            self._frames.append(encoded)
            self._bytes += len(encoded)
            if len(self._times) > MOST_FRAMES or self._bytes > MOST_BYTES:
                self._thin()
        self._before = frame

    def window(self, first: int, last: int, most: int) -> list[str]:
        """Return the frames from one time to another.

        Parameters
        ----------
        first, last : int
            Cycles, both included. The frame in effect at `first` comes along if there is none of that time.
        most : int
            At most so many, evenly spread, the last one included.

        Returns
        -------
        list of str
            As given to `add`.
        """
        begin = max(0, bisect.bisect_right(self._times, first) - 1)
        end = bisect.bisect_right(self._times, last)
        count = end - begin
        if count <= most:
            return self._frames[begin:end]
        return [self._frames[end - 1 - (i * (count - 1)) // (most - 1)] for i in range(most - 1, -1, -1)]

    def _thin(self) -> None:
        # The recent half stays as it is: that is what people scrub through.
        half = len(self._times) // 2
        self._times = self._times[:half:2] + self._times[half:]
        self._frames = self._frames[:half:2] + self._frames[half:]
        self._bytes = sum(map(len, self._frames))

    def _mark(self, frame: Frame) -> None:
        before = self._before
        old = {robot.robot_id: robot for robot in before.robots} if before is not None else {}
        marks = []
        if before is not None and frame.phase != before.phase:
            kind = {"running": "started", "stopped": "stopped", "finished": "ended"}.get(frame.phase)
            if kind is not None:
                marks.append(Mark(frame.time, kind))
        for robot in frame.robots:
            marks += [
                Mark(frame.time, kind, robot.robot_id) for kind in _news(old.get(robot.robot_id), robot)
            ]
        self.marks += marks[: MOST_MARKS - len(self.marks)]


def _news(before: RobotStatus | None, robot: RobotStatus) -> list[str]:
    """Return what happened to a robot since the frame before."""
    if before is None:
        return ["joined"]
    kinds = []
    if robot.collisions > before.collisions:
        kinds.append("collision")
    if robot.visited_mask != before.visited_mask and "1" in robot.visited_mask:
        kinds.append("target")
    if robot.state != before.state and robot.state in ("Returning", "Finished", "Removed"):
        kinds.append(robot.state.lower())
    return kinds
