"""Mode 6: find the best tour through all beacons along painted lines (2022)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.scoring.linemap import LineMap
from simulator_stub.scoring.misfits import line_notes
from simulator_stub.scoring.offline import OffLineScoring
from simulator_stub.scoring.planning import PLANNING_FILE

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot


class LinePlanning(OffLineScoring):
    """Writes the reference map with the best tour at the start; the robot's own is judged after the run."""

    mode = 6
    has_documents = True

    def begin(self, robot: Robot) -> None:
        """Write the map with the robot's start in the middle."""
        self.documents[PLANNING_FILE] = LineMap(self.world.lab, self.world.floor, robot.x, robot.y).planning()
        self.notes += line_notes(self.world.lab, robot, tour=True)
