"""What the robots of a batch are told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchReadings:
    """The readings of one cycle, world by world.

    Attributes
    ----------
    time : int
        Simulated cycles so far.
    infrared : array, shape (worlds, 4)
        Readings of the IR sensors, about 1/distance.
    compass : array, shape (worlds,)
        Degrees.
    ground : array of int, shape (worlds,)
        Number of the target that the robot is in, -1 for none.
    collision : array of bool, shape (worlds,)
    line : array of bool, shape (worlds, 7), or None
        Elements of the line sensor, leftmost first; None if the batch has none.
    """

    time: int
    infrared: NDArray[np.float64]
    compass: NDArray[np.float64]
    ground: NDArray[np.int64]
    collision: NDArray[np.bool_]
    line: NDArray[np.bool_] | None
