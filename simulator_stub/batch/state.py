"""What changes from cycle to cycle in a batch, apart from random numbers."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields, replace
from typing import Any

from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats, Integers


@dataclass(slots=True, kw_only=True)
class BatchState:
    """Robots, one in each world; all arrays have the shape (worlds,).

    Attributes
    ----------
    time : int
    x, y, heading : array
        True poses, units and radians.
    left_command, right_command : array
        As clamped.
    left_output, right_output : array
        Noisy filtered powers of the last running cycle.
    collides : array of bool
        In the last running cycle.
    collisions : array of int
        How many have begun.
    delays : dict of str to deque of array
        Readings under way, the oldest first, for each sensor with a latency.
    """

    time: int
    x: Floats
    y: Floats
    heading: Floats
    left_command: Floats
    right_command: Floats
    left_output: Floats
    right_output: Floats
    collides: Booleans
    collisions: Integers
    delays: dict[str, deque[NDArray[Any]]]

    def copy(self) -> BatchState:
        """Make an independent copy; readings under way are shared, as they are never written to."""
        arrays = {
            field.name: getattr(self, field.name).copy()
            for field in fields(self)
            if field.name not in ("time", "delays")
        }
        return replace(self, delays={name: deque(queue) for name, queue in self.delays.items()}, **arrays)

    def delay(self, sensor: str, reading: NDArray[Any]) -> NDArray[Any]:
        """Put a reading in its queue and take the oldest out."""
        queue = self.delays.get(sensor)
        if queue is None:
            return reading
        queue.append(reading)
        return queue.popleft()
