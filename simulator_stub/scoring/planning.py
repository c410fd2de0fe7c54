"""Mode 3: find the best tour through all beacons between walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.scoring.cellmap import CellMap
from simulator_stub.scoring.misfits import cell_notes
from simulator_stub.scoring.targets import TargetScoring

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot

PLANNING_FILE = "planning.out"


class Planning(TargetScoring):
    """Writes the reference map with the best tour at the start; the robot's own is judged after the run.

    The points are counted as in mode 0, but from 0.
    """

    mode = 3
    has_documents = True

    def begin(self, robot: Robot) -> None:
        """Write the map as seen from the robot's start cell."""
        seen = CellMap(self.world.lab, self.world.walls, robot.x, robot.y)
        self.documents[PLANNING_FILE] = seen.planning()
        self.notes += cell_notes(self.world.lab, robot, tour=True)
