"""A run as a moving picture: the belief of each step, the robot with its cones on its way."""

from __future__ import annotations

import math
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from agent.offline.pose_replay import replay_poses
from agent.offline.summary import cell_name, normalized_entropy, peak
from agent.offline.track import estimated_track
from ciberrato import plot
from ciberrato.arrays import Floats, Integers
from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file
from ciberrato.files.run_records import RecordedRun
from ciberrato.geometry.walls import WallMap
from ciberrato.plot.beliefs import ring_cell
from ciberrato.plot.canvas import LINE_COLOURS, new_figure
from ciberrato.plot.conepoint import nearest_point, sensor_point
from ciberrato.plot.labs import draw_cone, draw_robot
from ciberrato.world.coordinates import PoseInDegrees
from ciberrato.world.lab import CELL_SIZE, Lab

KINDS = (".gif", ".mp4", ".html")
_Moment: TypeAlias = tuple[str, int | None]
"""Name of a belief, and its cycle."""
_BEFORE: _Moment = ("prior", None)


def check_animation(path: Path) -> None:
    """Refuse what cannot be made, before anything is computed.

    Parameters
    ----------
    path : Path

    Raises
    ------
    UsageError
        If the ending is not a kind of animation, or it is mp4 and there is no ffmpeg.
    """
    if path.suffix.lower() not in KINDS:
        raise UsageError(f"{path}: animations are {', '.join(KINDS)}, by the ending of the name")
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise UsageError(
            f"{path}: mp4 needs the program ffmpeg, which is not installed; .gif and .html do not"
        )


def animate_run(
    run: RecordedRun,
    beliefs: Floats,
    lab: Lab,
    path: str | os.PathLike[str],
    *,
    truth: Mapping[int, PoseInDegrees] | None = None,
    every: int = 4,
    frames_per_second: float = 10.0,
) -> int:
    """Draw a run as an animation.

    Parameters
    ----------
    run : RecordedRun
    beliefs : ndarray, shape (steps + 1, rows, columns)
        The prior first.
    lab : Lab
    path : path-like
        ``.gif``, ``.mp4`` (only where ffmpeg is installed) or ``.html`` (one file, nothing is loaded).
    truth : mapping of int to (x, y, heading), or None
        The robot is drawn there; without it, where the last belief says that the way must have been.
    every : int
        Cycles a frame.
    frames_per_second : float

    Returns
    -------
    int
        Frames.

    Raises
    ------
    UsageError
        If the ending is unknown, ffmpeg is wanted and not there, the beliefs are not of this run, or the file
        cannot be written.
    """
    path = Path(path)
    check_animation(path)
    if len(beliefs) != len(run.steps) + 1:
        raise UsageError(
            f"the log has {len(run.steps)} steps, the belief file {len(beliefs) - 1}: give those of one run"
        )
    if beliefs.shape[1:] != (lab.rows, lab.columns):
        raise UsageError(
            f"the beliefs are not of the lab {lab.name!r}, which has {lab.rows} x {lab.columns} cells"
        )
    steps = [-1 if cycle.step is None else cycle.step for cycle in run.cycles]
    shown = np.maximum.accumulate(steps or [-1]) + 1
    track = estimated_track(run, beliefs)
    poses = None if track is None else [(float(x), float(y), float(heading)) for x, y, heading in track]
    moments = [
        _BEFORE,
        *((f"belief of step {step.index} (cycle {step.time})", step.time) for step in run.steps),
    ]
    scene = _Scene(run, beliefs, lab, truth, shown, poses, moments)
    return _save(scene, _frames(run, every), path, frames_per_second)


def animate_poses(
    run: RecordedRun,
    lab: Lab,
    path: str | os.PathLike[str],
    *,
    truth: Mapping[int, PoseInDegrees] | None = None,
    every: int = 4,
    frames_per_second: float = 10.0,
) -> int:
    """Draw a run of any drive as an animation, with the belief of the pose filter as it goes on.

    Parameters
    ----------
    run, lab, path, truth, every, frames_per_second
        As for `animate_run`; without the truth the robot is drawn where the filter is certain that it is, if
        it is.

    Returns
    -------
    int
        Frames.

    Raises
    ------
    UsageError
        If the ending is unknown, ffmpeg is wanted and not there, or the file cannot be written.
    """
    path = Path(path)
    check_animation(path)
    end = len(run.cycles) - 1
    frames = sorted({*_frames(run, every), end}) + [end] * 10
    wanted = set(frames)
    replay = replay_poses(run, lab, lambda index, _: index in wanted)
    shown = np.cumsum([index in wanted for index in range(len(run.cycles))])
    times = (run.cycles[index].time for index in sorted(wanted))
    moments = [_BEFORE, *((f"belief of cycle {time}", time) for time in times)]
    scene = _Scene(run, replay.beliefs, lab, truth, shown, replay.poses, moments)
    return _save(scene, frames, path, frames_per_second)


def _frames(run: RecordedRun, every: int) -> list[int]:
    """Choose the cycles: every so many while it moves, each reading, and a rest at the end."""
    chosen = {
        index
        for index, cycle in enumerate(run.cycles)
        if cycle.step is not None or (cycle.time % every == 0 and cycle.phase != "holding")
    }
    last = max((index for index, cycle in enumerate(run.cycles) if cycle.step is not None), default=0)
    return sorted(chosen or {0}) + [last] * 10


def _save(scene: _Scene, frames: list[int], path: Path, frames_per_second: float) -> int:
    """Write the animation, whole or not at all; return the number of frames."""
    from matplotlib.animation import FuncAnimation, HTMLWriter, PillowWriter

    animation = FuncAnimation(
        scene.figure, scene.draw, frames=frames, init_func=list, interval=1000.0 / frames_per_second
    )
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / f"animation{path.suffix.lower()}"
        writer: Any
        if draft.suffix == ".gif":
            writer = PillowWriter(fps=round(frames_per_second))
        elif draft.suffix == ".html":
            writer = HTMLWriter(fps=round(frames_per_second), embed_frames=True)
        else:
            writer = "ffmpeg"
        animation.save(str(draft), writer=writer, dpi=80)
        replace_file(path, draft.read_bytes())
    return len(frames)


class _Scene:
    """The picture that changes from frame to frame."""

    def __init__(
        self,
        run: RecordedRun,
        beliefs: Floats,
        lab: Lab,
        truth: Mapping[int, PoseInDegrees] | None,
        shown: Integers,
        poses: Sequence[PoseInDegrees | None] | None,
        moments: Sequence[_Moment],
    ) -> None:
        # `shown`: which of `beliefs` and `moments` is in effect at each cycle; `poses`: the estimates.
        self._run, self._beliefs, self._truth = run, beliefs, truth
        self._shown, self._poses, self._moments = shown, poses, moments
        self._walls = WallMap.from_lab(lab)
        self.figure = new_figure(10.0, 8.6 * lab.height / lab.width + 0.9)
        self._axis = plot.cells(beliefs[0], self.figure.subplots(), lab=lab)
        self._image = self._axis.images[-1]
        bar = self.figure.colorbar(self._image, ax=self._axis, shrink=0.8, fraction=0.03, pad=0.01)
        bar.set_label("probability of the cell")
        # A title that grows would move the picture: the text has a fixed place.
        self._title = self._axis.set_title(" ", fontsize=11, loc="left", family="monospace")
        self._moving: list[Any] = []
        # The layout is worked out once: doing it in every frame takes most of the time.
        self.figure.canvas.draw()
        self.figure.set_layout_engine("none")

    def draw(self, index: int) -> list[Any]:
        """Draw one cycle."""
        for artist in self._moving:
            artist.remove()
        self._moving = []
        cycle = self._run.cycles[index]
        belief = self._beliefs[self._shown[index]]
        self._image.set_data(belief)
        pose = self._pose(index)
        if pose is not None:
            self._draw_robot(*pose)
        self._ring_truth(index)
        self._title.set_text(f"cycle {cycle.time:4d}   {self._text(index, belief)}")
        return [self._image, self._title, *self._moving]

    def _pose(self, index: int) -> PoseInDegrees | None:
        if self._truth is not None:
            return self._truth.get(self._run.cycles[index].time)
        return None if self._poses is None else self._poses[index]

    def _ring_truth(self, index: int) -> None:
        """Draw a ring around the true cell at the moment of the belief: the robot is leaving it."""
        time = self._moments[self._shown[index]][1]
        if self._truth is None or time is None:
            return
        pose = self._truth.get(time)
        if pose is not None:
            self._moving += ring_cell(self._axis, (int(pose[1] // CELL_SIZE), int(pose[0] // CELL_SIZE)))

    def _draw_robot(self, x: float, y: float, heading: float) -> None:
        self._moving += draw_robot(self._axis, x, y, math.radians(heading))
        for number, angle in enumerate(self._run.header.sensor_angles):
            direction = math.radians(heading + angle)
            point = nearest_point(self._walls, x, y, direction)
            if point is None:
                continue
            start = sensor_point(x, y, direction)
            colour = LINE_COLOURS[number % len(LINE_COLOURS)]
            self._moving.append(draw_cone(self._axis, start, direction, math.dist(start, point), colour))
            self._moving += self._axis.plot(*point, "o", color=colour, markersize=5, zorder=9)

    def _text(self, index: int, belief: Floats) -> str:
        name = f"{self._moments[self._shown[index]][0]:30}"
        if np.isnan(belief).any():
            return f"{name} undefined"
        best = peak(belief)
        return (
            f"{name} most likely {cell_name(best.cells[0]):9} p = {best.probability:.3f}   "
            f"{normalized_entropy(belief):.2f} bits"
        )
