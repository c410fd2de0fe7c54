"""True poses of a robot, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """True poses of one robot, a row a cycle.

    Attributes
    ----------
    time : numpy.ndarray, shape (n,), int
        Cycles; the first is 0, when the robot registered.
    x, y : numpy.ndarray, shape (n,)
        Units.
    degrees : numpy.ndarray, shape (n,)
        Heading, counter-clockwise from the x axis.
    """

    time: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    degrees: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        if not len(self):
            return "<truth: no cycle>"
        ends = [f"({self.x[index]:.2f}, {self.y[index]:.2f})" for index in (0, -1)]
        return f"<truth of {len(self)} cycles, from {ends[0]} to {ends[1]}>"


def truth_arrays(path: Path, robot: int | None = None) -> Truth:
    """Read the truth of a robot.

    Parameters
    ----------
    path : Path
        As the simulator writes it.
    robot : int or None
        None = the first in the file.

    Returns
    -------
    Truth
        Without rows if there was no robot.
    """
    from ciberrato.errors import LabError
    from ciberrato.files.truth import read_truth

    try:
        poses = read_truth(path, robot=robot)
    except LabError:
        poses = {}
    rows = np.array([(time, *pose) for time, pose in sorted(poses.items())], dtype=np.float64).reshape(-1, 4)
    return Truth(rows[:, 0].astype(np.int64), rows[:, 1], rows[:, 2], rows[:, 3])
