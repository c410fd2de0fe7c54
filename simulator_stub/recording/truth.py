"""The true poses as a CSV file, for those who want to judge an agent."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.recording.observer import Lost, WorldFile, lose_nothing
from simulator_stub.world.simulator_state import SimulatorState

if TYPE_CHECKING:
    from pathlib import Path

    from simulator_stub.simulation import Simulation

HEADER = "time,robot,x,y,dir_deg,state"


class TruthFile(WorldFile):
    """Writes a row for each robot at its registration, and one for each robot and running cycle.

    Columns: ``time`` in cycles, ``robot`` its position number, ``x`` and ``y`` in units, ``dir_deg`` in
    degrees (with all digits that a double has), ``state`` in that cycle. Every cycle is written out at once.

    Parameters
    ----------
    path : Path
        Overwritten if it exists. Worlds after the first go into files of their own (see `WorldFile`).
    lost : callable
        Told when the record ends early.

    Raises
    ------
    UsageError
        If it cannot be opened.
    """

    def __init__(self, path: Path, lost: Lost = lose_nothing) -> None:
        self._known: set[int] = set()
        super().__init__(path, lost)

    def heading(self) -> str:
        """Return the line with the columns' names."""
        return HEADER + "\n"

    def actions_read(self, simulation: Simulation) -> None:
        """Do nothing: nothing has moved yet."""

    def cycle_done(self, simulation: Simulation) -> None:
        """Write down where everybody is."""
        running = simulation.state is SimulatorState.RUNNING
        rows = []
        for robot in simulation.robots:
            if running or robot.robot_id not in self._known:
                self._known.add(robot.robot_id)
                pose = f"{robot.x!r},{robot.y!r},{robot.heading_degrees!r}"
                rows.append(f"{simulation.time},{robot.robot_id},{pose},{robot.state.value}\n")
        if rows:
            self.write("".join(rows))
            self.flush()

    def world_ended(self, simulation: Simulation) -> None:
        """Close the file of this world."""
        super().world_ended(simulation)
        self._known = set()
