"""The references of modes 5 and 6: a map of the painted lines, and the best tour along them."""

from __future__ import annotations

import math

from ciberrato.world.lab import CELL_SIZE, Lab
from simulator_stub.scoring.circuits import DIRECTIONS
from simulator_stub.scoring.textmap import START, TextMap
from simulator_stub.scoring.tours import Links, planning_text
from simulator_stub.world.floor import Floor

Node = tuple[int, int]
"""Column and row of a place where both coordinates are even: half of them."""

AHEAD = 0.5
"""Units from a node to where a line is looked for."""
STROKES = {0: "-", 45: "/", 90: "|", 135: "\\", 180: "-", 225: "/", 270: "|", 315: "\\"}
"""Character of a line that leaves a node in a direction in degrees."""


class LineMap:
    """The lines of a lab between the nodes where both coordinates are even.

    Parameters
    ----------
    lab : Lab
    floor : Floor
        Floor on which it is painted.
    x, y : float
        Start place of the robot.
    """

    def __init__(self, lab: Lab, floor: Floor, x: float, y: float) -> None:
        self._lab = lab
        self._start = _node_of(x, y)
        self._lines: dict[Node, list[int]] = {}
        for column in range(1, lab.columns):
            for row in range(1, lab.rows):
                self._lines[column, row] = [
                    degrees
                    for degrees, (dx, dy) in DIRECTIONS.items()
                    if floor.is_marked(
                        CELL_SIZE * column + AHEAD * dx / math.hypot(dx, dy),
                        CELL_SIZE * row + AHEAD * dy / math.hypot(dx, dy),
                    )
                ]

    @property
    def links(self) -> Links[Node]:
        """Lines that start at each node: the node at the other end, and the length."""
        links: dict[Node, list[tuple[Node, float]]] = {}
        for node, directions in self._lines.items():
            links[node] = []
            for degrees in directions:
                dx, dy = DIRECTIONS[degrees]
                links[node].append(((node[0] + dx, node[1] + dy), CELL_SIZE * math.hypot(dx, dy)))
        return links

    def mapping(self) -> str:
        """Write mapping.out: the lines, with the start marked."""
        drawing = self._draw()
        drawing.draw(0, 0, START)
        return str(drawing)

    def planning(self) -> str:
        """Write planning.out: the lines with the numbers of the targets, the best tour, its length."""
        targets = self._lab.targets[: len(self._lab.beacons)]
        places = [_node_of(target.x, target.y) for target in targets]
        return planning_text(self._draw(), places, self._start, self.links)

    def _draw(self) -> TextMap:
        drawing = TextMap(4 * (self._lab.columns - 2) + 1, 4 * (self._lab.rows - 2) + 1)
        for node, directions in self._lines.items():
            for degrees in directions:
                dx, dy = DIRECTIONS[degrees]
                drawing.draw(
                    2 * (node[0] - self._start[0]) + dx, 2 * (node[1] - self._start[1]) + dy, STROKES[degrees]
                )
        return drawing


def _node_of(x: float, y: float) -> Node:
    return math.floor(x / CELL_SIZE + 0.5), math.floor(y / CELL_SIZE + 0.5)
