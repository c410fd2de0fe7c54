"""Mode 4: round a circuit of painted lines on a grid of one unit (2022)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator_stub.scoring.circuits import (
    AWAY_PENALTY,
    Circuit,
    CircuitScoring,
    Node,
    Progress,
    trace,
)

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot

TURNS = (-90, 0, 90)
AHEAD = 0.5
"""Units from a node to where a line is looked for."""


class LineControl(CircuitScoring):
    """Cells of 1 x 1 centred on whole coordinates; at each one the rightmost line that leaves it."""

    mode = 4

    def find_circuit(self, x: float, y: float) -> Circuit:
        """Find the circuit of lines."""
        floor = self.world.floor

        def leaves(node: Node, step: tuple[int, int]) -> bool:
            return floor.is_marked(node[0] + AHEAD * step[0], node[1] + AHEAD * step[1])

        return trace(_cell(x, y), TURNS, leaves)

    def follow(self, robot: Robot, progress: Progress) -> None:
        """Add points in the coming cell, subtract some in cells that are not of the circuit at all."""
        cell = _cell(robot.x, robot.y)
        if cell == progress.circuit[progress.coming]:
            progress.reach()
        elif cell not in progress.circuit:
            progress.penalty += AWAY_PENALTY


def _cell(x: float, y: float) -> Node:
    return int(x + 0.5), int(y + 0.5)
