"""Mode 7: round a circuit of painted lines at multiples of 45 degrees (2023)."""

from __future__ import annotations

import math
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

TURNS = (-135, -90, -45, 0, 45, 90, 135)
AHEAD = 0.2
"""Units from a node to where a line is looked for."""
MOST_NODES = 500


class LineControl45(CircuitScoring):
    """Nodes half a unit apart; at each one the rightmost line that leaves it. Coordinates are doubled."""

    mode = 7

    def find_circuit(self, x: float, y: float) -> Circuit:
        """Find the circuit of lines."""
        floor = self.world.floor

        def leaves(node: Node, step: tuple[int, int]) -> bool:
            ahead = AHEAD / math.hypot(*step)
            return floor.is_marked(node[0] / 2.0 + ahead * step[0], node[1] / 2.0 + ahead * step[1])

        return trace((int(2.0 * x + 0.5), int(2.0 * y + 0.5)), TURNS, leaves, MOST_NODES)

    def follow(self, robot: Robot, progress: Progress) -> None:
        """Add points at the coming node, subtract some out of reach of all nodes.

        At a sharp corner the node after the coming one will do.
        """
        circuit, coming = progress.circuit, progress.coming
        before, after = circuit[coming - 1], circuit[(coming + 1) % len(circuit)]
        if _reaches(robot, circuit[coming]):
            progress.reach()
        elif abs(before[0] - after[0]) + abs(before[1] - after[1]) <= 1 and _reaches(robot, after):
            progress.reach(2)
        elif not any(_reaches(robot, node) for node in circuit):
            progress.penalty += AWAY_PENALTY


def _reaches(robot: Robot, node: Node) -> bool:
    return abs(2.0 * robot.x - node[0]) < 1.0 and abs(2.0 * robot.y - node[1]) < 1.0
