"""The references of modes 2 and 3: a map of the cells between walls, and the best tour through it."""

from __future__ import annotations

from ciberrato.geometry.walls import WallMap
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab
from simulator_stub.scoring.cells import STEPS, cell_of, is_open
from simulator_stub.scoring.textmap import START, TextMap
from simulator_stub.scoring.tours import Links, planning_text

FREE = "X"


class CellMap:
    """Cells that can be reached from a start cell.

    Parameters
    ----------
    lab : Lab
    walls : WallMap
        Its obstacles.
    x, y : float
        Start place of the robot.
    """

    def __init__(self, lab: Lab, walls: WallMap, x: float, y: float) -> None:
        self._lab = lab
        self._start = cell_of(x, y)
        self._links: dict[Cell, list[tuple[Cell, float]]] = {}
        self._walls: list[tuple[Cell, tuple[int, int]]] = []
        waiting = [self._start]
        while waiting:
            cell = waiting.pop()
            if cell in self._links:
                continue
            self._links[cell] = []
            for step in STEPS:
                neighbour = (cell[0] + step[0], cell[1] + step[1])
                if not self._is_inside(neighbour):
                    self._walls.append((cell, step))
                elif is_open(walls, cell, step):
                    self._links[cell].append((neighbour, CELL_SIZE))
                    waiting.append(neighbour)
                else:
                    self._walls.append((cell, step))

    def _is_inside(self, cell: Cell) -> bool:
        """Return whether the centre of a cell is in the lab: a search from outside would not end."""
        x, y = (CELL_SIZE * (index + 0.5) for index in cell)
        return 0.0 < x < self._lab.width and 0.0 < y < self._lab.height

    @property
    def links(self) -> Links[Cell]:
        """The reachable cells, and which are next to which."""
        return self._links

    def mapping(self) -> str:
        """Write mapping.out: the map with the start marked."""
        drawing = self._draw()
        drawing.draw(0, 0, START)
        return str(drawing)

    def planning(self) -> str:
        """Write planning.out: the map with the numbers of the targets, the best tour, its length."""
        targets = self._lab.targets[: len(self._lab.beacons)]
        places = [cell_of(target.x, target.y) for target in targets]
        return planning_text(self._draw(), places, self._start, self._links)

    def _draw(self) -> TextMap:
        drawing = TextMap(4 * self._lab.columns - 1, 4 * self._lab.rows - 1)
        for cell, neighbours in self._links.items():
            dx, dy = 2 * (cell[0] - self._start[0]), 2 * (cell[1] - self._start[1])
            drawing.draw(dx, dy, FREE)
            for neighbour, _ in neighbours:
                drawing.draw(dx + neighbour[0] - cell[0], dy + neighbour[1] - cell[1], FREE)
        for cell, (across, up) in self._walls:
            dx, dy = 2 * (cell[0] - self._start[0]), 2 * (cell[1] - self._start[1])
            drawing.draw(dx + across, dy + up, "|" if across else "-")
        return drawing
