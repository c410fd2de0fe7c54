"""Moves a robot by hand in the middle of a run: the kidnapped robot problem, on demand."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from simulator_stub.simulation import Simulation
from simulator_stub.world.simulator_state import SimulatorState

_REAL = r"([+-]?(?:\d+\.?\d*|\.\d+))"
_PATTERN = re.compile(rf"(\d+):{_REAL},{_REAL},{_REAL}")


@dataclass(frozen=True, slots=True)
class Kidnapping:
    """Kidnapping of a robot: its new pose, and the time.

    Attributes
    ----------
    cycle : int
        Before which running cycle: the Measures of this time are the first from the new place.
    x, y : float
        Units.
    direction_deg : float
        Heading, counter-clockwise from +x.
    """

    cycle: int
    x: float
    y: float
    direction_deg: float


def parse_kidnapping(text: str) -> Kidnapping:
    """Read ``CYCLE:X,Y,DIR``.

    Parameters
    ----------
    text : str

    Returns
    -------
    Kidnapping

    Raises
    ------
    ValueError
        If the text is something else.
    """
    match = _PATTERN.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is not CYCLE:X,Y,DIR (cycles, units, degrees)")
    cycle, x, y, direction = match.groups()
    return Kidnapping(int(cycle), float(x), float(y), float(direction))


class Kidnapper:
    """Moves the robot with the lowest id at the times given.

    Parameters
    ----------
    kidnappings : sequence of Kidnapping
    """

    def __init__(self, kidnappings: list[Kidnapping]) -> None:
        self._all = sorted(kidnappings, key=lambda kidnapping: kidnapping.cycle)
        self._waiting = list(self._all)

    def before_move(self, simulation: Simulation) -> None:
        """Move the robot if the coming cycle is the one; the actions have been read."""
        if simulation.state is not SimulatorState.RUNNING or not simulation.robots:
            return
        while self._waiting and self._waiting[0].cycle <= simulation.time + 1:
            victim = self._waiting.pop(0)
            simulation.place(
                simulation.robots[0].robot_id, victim.x, victim.y, math.radians(victim.direction_deg)
            )

    def world_ended(self, simulation: Simulation) -> None:
        """Reset to the first kidnapping."""
        self._waiting = list(self._all)
