"""Mode 1: round a circuit of cells between walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.scoring.cells import cell_of, is_open
from simulator_stub.scoring.circuits import DIRECTIONS, Circuit, CircuitScoring, Node, Progress, trace

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot

TURNS = (0, -90, 90)


class Control(CircuitScoring):
    """Cells of 2 x 2; at each one straight on, else right, else left, whichever has no wall before it."""

    mode = 1

    def find_circuit(self, x: float, y: float) -> Circuit:
        """Find the circuit of cells."""
        walls, lab = self.world.walls, self.world.lab

        def passes(cell: Node, step: tuple[int, int]) -> bool:
            return is_open(walls, cell, step)

        # Who gets outside the border, as from the last column on the right, meets no wall any more.
        return trace(cell_of(x, y), TURNS, passes, most=len(DIRECTIONS) * (lab.columns + 1) * (lab.rows + 1))

    def follow(self, robot: Robot, progress: Progress) -> None:
        """Add points in the coming cell; other cells do nothing."""
        if cell_of(robot.x, robot.y) == progress.circuit[progress.coming]:
            progress.reach()
