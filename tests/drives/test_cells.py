"""The graph of cells, the ways over it, and detours: against brute force."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from agent.drives import cell_graph as cells
from agent.drives.cell_graph import (
    LEAST_CLEARANCE,
    STEPS,
    Beginning,
    CellGraph,
    centre,
    find_stands,
    join_cells,
)
from agent.drives.detour import is_clear, shortest_detour
from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief.lattice import Lattice, build_lattice
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import Lab, Wall

NEVER = -math.inf


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


OBLIQUE = Lab(
    name="oblique",
    width=12.0,
    height=8.0,
    walls=(
        Wall(height=4.0, corners=((2.3, 1.2), (2.5, 1.2), (4.6, 4.1), (4.4, 4.1))),
        Wall(height=4.0, corners=((8.9, 2.8), (9.4, 3.1), (8.7, 3.3))),
        box(5.95, 0.0, 6.05, 2.41),
        box(5.58, 5.0, 5.62, 8.0),
        box(9.9, 4.0, 10.1, 8.0),
        Wall(height=0.0, corners=((0.0, 1.9), (2.0, 1.9), (2.0, 2.1), (0.0, 2.1))),
    ),
)


def _segment_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Least distance of two segments, by the four ends and a test whether they cross."""

    def to_segment(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        share = np.clip(np.dot(p - q, r - q) / np.dot(r - q, r - q), 0.0, 1.0)
        return float(np.hypot(*(p - q - share * (r - q))))

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    if side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0:
        return 0.0
    return min(to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b))


def room_between(lab: Lab, begin: tuple[float, float], end: tuple[float, float]) -> float:
    outlines = [wall.corners for wall in lab.walls if wall.height > 0.0]
    outlines.append(((0.0, 0.0), (lab.width, 0.0), (lab.width, lab.height), (0.0, lab.height)))
    return min(
        _segment_distance(*(np.array(point) for point in (begin, end, one, other)))
        for corners in outlines
        for one, other in zip(corners, (*corners[1:], corners[0]), strict=True)
    )


@pytest.mark.parametrize("resolution", [2.0 / 9.0, 0.1])
def test_cells_are_joined_where_the_way_is_clear(resolution: float) -> None:
    graph = join_cells(build_lattice(OBLIQUE, resolution), OBLIQUE.rows, OBLIQUE.columns)
    assert graph.joined.shape == (4, 6, 4)
    seen = {True: 0, False: 0}
    for row, column, direction in itertools.product(range(4), range(6), range(4)):
        there = row + STEPS[direction][0], column + STEPS[direction][1]
        joined = bool(graph.joined[row, column, direction])
        if not (0 <= there[0] < 4 and 0 <= there[1] < 6):
            assert not joined
            continue
        room = room_between(OBLIQUE, centre((row, column)), centre(there))
        if room >= LEAST_CLEARANCE:
            assert joined, (row, column, direction)
        elif room < LEAST_CLEARANCE - 0.012:
            assert not joined, (row, column, direction)
        seen[joined] += 1
        assert graph.joined[(*there, (direction + 2) % 4)] == joined
        assert (there in graph.neighbours((row, column))) == joined
    assert seen[True] > 30
    assert seen[False] > 15


def test_stands_are_where_there_is_room() -> None:
    lattice = build_lattice(OBLIQUE, 2.0 / 9.0)
    graph = join_cells(lattice, OBLIQUE.rows, OBLIQUE.columns)
    stands = find_stands(lattice, OBLIQUE.columns)
    off_centre = 0
    for cell in itertools.product(range(4), range(6)):
        if graph.free[cell]:
            assert stands[cell] == pytest.approx(centre(cell))
        elif cell in stands:
            x, y = stands[cell]
            assert (y // 2.0, x // 2.0) == cell
            assert room_between(OBLIQUE, (x, y), (x + 1e-9, y)) >= LEAST_CLEARANCE - 1e-6
            off_centre += 1
    assert off_centre > 0


def small_graph(generator: np.random.Generator) -> CellGraph:
    joined = np.zeros((3, 3, 4), np.bool_)
    for row, column, direction in itertools.product(range(3), range(3), (0, 1)):
        there = row + STEPS[direction][0], column + STEPS[direction][1]
        if there[0] < 3 and there[1] < 3 and generator.random() < 0.8:
            joined[row, column, direction] = joined[(*there, direction + 2)] = True
    return CellGraph(free=np.ones((3, 3), np.bool_), joined=joined)


def cost_of(way: list[Cell], heading: float) -> float:
    cost = 0.0
    for here, there in itertools.pairwise(way):
        direction = STEPS.index((there[0] - here[0], there[1] - here[1])) * math.pi / 2.0
        cost += cells.turning_cycles(direction - heading) + 2.0 / 0.15
        heading = direction
    return cost


def all_ways(graph: CellGraph, way: list[Cell], closed: set[tuple[Cell, Cell]]) -> list[list[Cell]]:
    found = [way]
    for there in graph.neighbours(way[-1]):
        if there not in way and (way[-1], there) not in closed:
            found += all_ways(graph, [*way, there], closed)
    return found


@pytest.mark.parametrize("seed", range(60))
def test_the_way_leads_to_the_nearest_new_cell(seed: int) -> None:
    generator = np.random.default_rng(seed)
    graph = small_graph(generator)
    share = 0.6 if seed % 3 else 1.0
    seen = np.where(generator.random((3, 3)) < share, generator.integers(0, 50, (3, 3)), NEVER)
    begin: Cell = (int(generator.integers(3)), int(generator.integers(3)))
    seen[begin] = 99.0
    heading = float(generator.uniform(-3.0, 3.0))
    edges = [(a, b) for a in itertools.product(range(3), range(3)) for b in graph.neighbours(a)]
    closed = {edge for edge in edges if generator.random() < 0.1}
    way = graph.quickest([Beginning(begin, 0.0, heading)], seen, lambda edge: edge in closed)
    ways = [other for other in all_ways(graph, [begin], closed) if len(other) > 1]

    def worth(other: list[Cell]) -> float:
        alone = all(seen[cell] > NEVER for cell in graph.neighbours(other[-1]))
        new = seen[other[-1]] == NEVER
        return cost_of(other, heading) - (cells._STRAGGLER if alone and new else 0.0)

    if not ways:
        assert way == []
        return
    assert way[0] == begin
    assert not closed & set(itertools.pairwise(way))
    oldest = min(seen[other[-1]] for other in ways)  # minus infinity, if there is a new one
    assert seen[way[-1]] == oldest
    assert worth(way) == pytest.approx(min(worth(other) for other in ways if seen[other[-1]] == oldest))


@pytest.fixture(scope="module")
def lattice() -> Lattice:
    return build_lattice(OBLIQUE, 2.0 / 9.0)


def test_a_detour_leads_past_the_end_of_a_wall(lattice: Lattice) -> None:
    walls = WallMap.from_lab(OBLIQUE)
    begin, end = (4.9, 7.0), (7.0, 7.0)
    assert not is_clear(walls, begin, end, 0.57)
    way = shortest_detour(lattice, walls, begin, [end], LEAST_CLEARANCE)
    assert way[-1] == pytest.approx(end)
    assert len(way) > 2
    for one, other in itertools.pairwise([begin, *way]):
        assert room_between(OBLIQUE, one, other) >= 0.54
    length = sum(math.dist(one, other) for one, other in itertools.pairwise([begin, *way]))
    # A thread drawn tight around a disc of 0.57 at the wall's end is the least that is possible.
    thread = sum(math.sqrt(math.dist(place, (5.6, 5.0)) ** 2 - 0.57**2) for place in (begin, end))
    assert thread < length < 1.5 * thread


def test_there_is_no_detour_into_a_closed_room(lattice: Lattice) -> None:
    walls = WallMap.from_lab(OBLIQUE)
    closed = Lab(name="closed", width=12.0, height=8.0, walls=(box(5.9, 0.0, 6.1, 8.0),))
    assert shortest_detour(lattice, walls, (1.0, 7.0), [(11.0, 7.0)], LEAST_CLEARANCE)
    around = build_lattice(closed, 2.0 / 9.0)
    assert not shortest_detour(around, WallMap.from_lab(closed), (1.0, 7.0), [(11.0, 7.0)], LEAST_CLEARANCE)
