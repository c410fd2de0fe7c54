"""Mode 5: draw a map of the painted lines (2022)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.scoring.linemap import LineMap
from simulator_stub.scoring.mapping import MAPPING_FILE
from simulator_stub.scoring.misfits import line_notes
from simulator_stub.scoring.offline import OffLineScoring

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot


class LineMapping(OffLineScoring):
    """Writes the reference map at the start; the robot's own map is judged by it after the run."""

    mode = 5
    has_documents = True

    def begin(self, robot: Robot) -> None:
        """Write the map with the robot's start in the middle."""
        self.documents[MAPPING_FILE] = LineMap(self.world.lab, self.world.floor, robot.x, robot.y).mapping()
        self.notes += line_notes(self.world.lab, robot)
