"""Modes 1, 4 and 7: points for each node of a circuit that is reached in its turn. High is good."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from simulator_stub.scoring.base import Scoring

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

NODE_REWARD = 10
AWAY_PENALTY = 10
"""For each cycle away from the circuit, where that counts."""

Node = tuple[int, int]
Circuit = tuple[Node, ...]
"""The nodes in order, the start first and not repeated; empty if there is no circuit."""


Opening = Callable[[Node, tuple[int, int]], bool]
"""Return whether one can go from a node in a direction (dx, dy)."""

DIRECTIONS = {
    0: (1, 0),
    45: (1, 1),
    90: (0, 1),
    135: (-1, 1),
    180: (-1, 0),
    225: (-1, -1),
    270: (0, -1),
    315: (1, -1),
}
"""Steps by degrees, counter-clockwise from +x."""


@dataclass(slots=True)
class Progress:
    """Progress of one robot.

    Attributes
    ----------
    circuit : tuple of (int, int)
    coming : int
        Index of the node that gives the next points.
    reward, penalty : int
    """

    circuit: Circuit
    coming: int = 1
    reward: int = 0
    penalty: int = 0

    def reach(self, nodes: int = 1) -> None:
        """Record that the next node is reached, or the one after it, in which case the next is skipped."""
        self.reward += NODE_REWARD
        self.coming += nodes
        if self.coming >= len(self.circuit):
            self.coming = 0


class CircuitScoring(Scoring):
    """Finds the circuit when a robot begins, and follows it.

    A robot that begins later than time 0, or whose start is on no circuit, gets penalties for collisions
    only (the real simulator ends itself where it finds no circuit).

    Parameters
    ----------
    world : World
    """

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._progress: dict[int, Progress] = {}

    @abstractmethod
    def find_circuit(self, x: float, y: float) -> Circuit:
        """Find the circuit that begins at a place, to the right; empty if there is none."""

    @abstractmethod
    def follow(self, robot: Robot, progress: Progress) -> None:
        """Add and subtract points for where the robot is."""

    def begin(self, robot: Robot) -> None:
        """Find the circuit."""
        circuit = self.find_circuit(robot.x, robot.y)
        if not circuit:
            self.notes.append(
                f"robot {robot.robot_id}: no circuit begins at its start; only collisions count"
            )
        self._progress[robot.robot_id] = Progress(circuit)

    def update(self, robot: Robot, time: int, robots: Sequence[Robot]) -> None:
        """Count one cycle. With EndLed on the rewards are lost, and the penalties stay."""
        progress = self._progress.get(robot.robot_id)
        if progress is None:
            progress = self._progress[robot.robot_id] = Progress(())
        progress.penalty += self.collision_penalty(robot)
        if progress.circuit:
            self.follow(robot, progress)
        robot.score = (0 if robot.end_led else progress.reward) - progress.penalty


def trace(start: Node, turns: Sequence[int], is_open: Opening, most: int | None = None) -> Circuit:
    """Follow the links from node to node until the start is met again.

    Parameters
    ----------
    start : (int, int)
    turns : sequence of int
        Turns in degrees against the direction one came in, counter-clockwise, in the order of trying.
    is_open : callable
        Whether one can go from a node in a direction (dx, dy).
    most : int or None
        Most nodes.

    Returns
    -------
    tuple of (int, int)
        Empty if it ends at a dead end, goes round without meeting the start, or is too long.
    """
    nodes = [start]
    node, direction = (start[0] + 1, start[1]), 0
    seen: set[tuple[Node, int]] = set()
    while node != start:
        if (node, direction) in seen or (most is not None and len(nodes) > most):
            return ()
        seen.add((node, direction))
        nodes.append(node)
        for turn in turns:
            onward = (direction + turn) % 360
            if is_open(node, DIRECTIONS[onward]):
                direction = onward
                break
        else:
            return ()
        dx, dy = DIRECTIONS[direction]
        node = (node[0] + dx, node[1] + dy)
    return tuple(nodes)
