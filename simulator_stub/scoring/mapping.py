"""Mode 2: draw a map of the cells between walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.scoring.cellmap import CellMap
from simulator_stub.scoring.misfits import cell_notes
from simulator_stub.scoring.targets import TargetScoring

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot

MAPPING_FILE = "mapping.out"


class Mapping(TargetScoring):
    """Writes the reference map at the start; the robot's own map is judged by it after the run.

    The points are counted as in mode 0, but from 0.
    """

    mode = 2
    has_documents = True

    def begin(self, robot: Robot) -> None:
        """Write the map as seen from the robot's start cell."""
        seen = CellMap(self.world.lab, self.world.walls, robot.x, robot.y)
        self.documents[MAPPING_FILE] = seen.mapping()
        self.notes += cell_notes(self.world.lab, robot)
