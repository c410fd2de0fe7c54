"""The true poses as a CSV file, for those who want to judge an agent."""

from __future__ import annotations

import math
from pathlib import Path

from simulator_stub.simulation import Simulation
from simulator_stub.simulator_state import SimulatorState

HEADER = "time,robot,x,y,dir_deg,state"


class TruthFile:
    """Writes a row for each robot at its registration, and one for each robot and running cycle.

    Columns: ``time`` in cycles, ``robot`` its position number, ``x`` and ``y`` in units, ``dir_deg`` in
    degrees (with all digits that a double has), ``state`` in that cycle. Every cycle is written out at once.

    Parameters
    ----------
    path : Path
        Overwritten if it exists.

    Raises
    ------
    OSError
        If it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="ascii", buffering=1)
        self._file.write(HEADER + "\n")
        self._known: set[int] = set()

    def actions_read(self, simulation: Simulation) -> None:
        """Nothing has moved yet."""

    def cycle_done(self, simulation: Simulation) -> None:
        """Write down where everybody is."""
        robots = simulation.robots
        if not robots:
            self._known.clear()
        running = simulation.state is SimulatorState.RUNNING
        rows = []
        for robot in robots:
            if running or robot.robot_id not in self._known:
                self._known.add(robot.robot_id)
                degrees = robot.heading * 180.0 / math.pi
                rows.append(
                    f"{simulation.time},{robot.robot_id},{robot.x!r},{robot.y!r},{degrees!r},{robot.state.value}\n"
                )
        if rows:
            self._file.write("".join(rows))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
