"""Make labs: empty ones, and random ones of one piece that look the same nowhere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ciberrato.checks.free_space import free_space
from ciberrato.checks.likeness import ALL, turns_alike
from ciberrato.errors import UsageError
from ciberrato.files.lab import MAX_SIDE, MOST
from ciberrato.files.row_pattern import row_walls
from ciberrato.geometry.walls import WallMap
from ciberrato.labtool.maze import all_doors, random_doors, row_patterns, symmetric_doors
from ciberrato.protocol.text import attribute
from ciberrato.reprs import short_repr
from ciberrato.world.lab import CELL_SIZE, Beacon, Lab, Target, Wall

TRIES = 60
MOST_RANDOM_CELLS = 6400
"""Such a maze has nearly as many walls as a lab may have (`ciberrato.files.lab.MOST`)."""
_GAP = 1.4
"""Units between polygons, and between them and the border: a robot of diameter 1 passes."""
_CLEAR = 0.55
"""Units from starts and targets to the next wall, at least."""
_BEACON_HEIGHT = 4.0
_TARGET_RADIUS = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Description of the lab to make.

    Attributes
    ----------
    name : str
    rows, columns : int
        Cells of 2 x 2 units.
    loops, dead_ends : float
        Densities from 0 to 1, see `random_doors`; of cell walls only.
    polygons : float or None
        Share of the area in which free polygons stand instead of cell walls, 0 to 1; None = cell walls.
    starts, targets : int
        Numbers of start places and targets; every target has a beacon.
    symmetric : bool
        Ask for a lab that looks the same turned by half a turn; otherwise none that looks the same turned at
        all.
    """

    __repr__ = short_repr

    name: str = "Random"
    rows: int = 7
    columns: int = 14
    loops: float = 0.15
    dead_ends: float = 1.0
    polygons: float | None = None
    starts: int = 1
    targets: int = 1
    symmetric: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """A lab and its files.

    Attributes
    ----------
    lab : Lab
    lab_xml, grid_xml : str
    """

    __repr__ = short_repr

    lab: Lab
    lab_xml: str
    grid_xml: str


def random_lab(order: Order, seed: int) -> Made:
    """Generate a random lab.

    Parameters
    ----------
    order : Order
    seed : int

    Returns
    -------
    Made

    Raises
    ------
    UsageError
        If no such lab is found: it is too small, or so open that it looks the same turned round.
    """
    generator = np.random.default_rng(seed)
    check_order(order)
    if order.rows * order.columns > MOST_RANDOM_CELLS:
        raise UsageError(
            f"--size: {order.columns}x{order.rows} cells; random labs have up to {MOST_RANDOM_CELLS} cells"
        )
    for _ in range(TRIES):
        if order.polygons is None:
            doors = random_doors(
                order.rows, order.columns, generator, loops=order.loops, dead_ends=order.dead_ends
            )
            doors = symmetric_doors(doors, order.rows, order.columns) if order.symmetric else doors
            patterns = row_patterns(doors, order.rows, order.columns)
            walls = [wall for position, pattern in patterns for wall in row_walls(pattern, position, 4.0)[0]]
        else:
            patterns, walls = [], _polygons(order, generator)
        lab = Lab(
            name=order.name,
            width=CELL_SIZE * order.columns,
            height=CELL_SIZE * order.rows,
            walls=tuple(walls),
        )
        space = free_space(lab)
        if space is not None:
            alike = [share for _, share in turns_alike(lab, space)]
            if bool(alike) is not order.symmetric or (order.symmetric and alike[0] < ALL):
                continue
            if space.part.max() > 0:
                continue
        places = _places(order, lab, generator)
        if places is not None:
            return _made(order, lab, patterns, *places, generator)
    raise UsageError(
        f"no such lab was found in {TRIES} tries: it is too small for what is to stand in it, or so open "
        "that it looks the same turned round; ask for more cells, fewer --loops, or --symmetric"
    )


def empty_lab(order: Order) -> Made:
    """Create a lab without walls, its rows ready to be drawn in."""
    check_order(order)
    lab = Lab(name=order.name, width=CELL_SIZE * order.columns, height=CELL_SIZE * order.rows)
    patterns = row_patterns(all_doors(order.rows, order.columns), order.rows, order.columns)
    return _made(order, lab, patterns, [(1.0, 1.0)], [(lab.width - 1.0, lab.height - 1.0)], None)


def check_order(order: Order) -> None:
    """Refuse what cannot be made.

    Raises
    ------
    UsageError
    """
    attribute(order.name, "--name")
    if not (1 <= order.rows <= MAX_SIDE / CELL_SIZE and 1 <= order.columns <= MAX_SIDE / CELL_SIZE):
        raise UsageError(
            f"--size: {order.columns}x{order.rows} cells; it takes 1 to {MAX_SIDE / CELL_SIZE:g} a side"
        )
    characters = (3 * order.columns - 1) * (2 * order.rows - 1)
    if characters > MOST["characters in its rows"]:
        raise UsageError(
            f"--size: {order.columns}x{order.rows} cells take {characters} characters in the lab's rows; "
            f"programs read {MOST['characters in its rows']}"
        )
    for option, value in (
        ("--loops", order.loops),
        ("--dead-ends", order.dead_ends),
        ("--polygons", order.polygons),
    ):
        if value is not None and not 0.0 <= value <= 1.0:
            raise UsageError(f"{option} {value:g}: it takes 0 to 1")
    if order.starts < 1 or order.targets < 0:
        raise UsageError("it takes one start or more, and no target or more")


def _places(
    order: Order, lab: Lab, generator: np.random.Generator
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]] | None:
    """Choose starts and targets: centres of cells, free and far enough from each other."""
    free = [
        ((column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE)
        for row in range(order.rows)
        for column in range(order.columns)
    ]
    if order.polygons is not None:
        clear = WallMap.from_lab(lab).distance(*np.array(free).T) >= _CLEAR
        free = [
            place
            for place, far in zip(free, clear, strict=True)
            if far and not any(_within(place, wall.corners) for wall in lab.walls)
        ]
    wanted = order.starts + order.targets
    if len(free) < wanted:
        return None
    chosen = [free[index] for index in generator.permutation(len(free))[:wanted]]
    return chosen[: order.starts], chosen[order.starts :]


def _within(place: tuple[float, float], corners: tuple[tuple[float, float], ...]) -> bool:
    """Return whether a point is inside a convex polygon, listed counter-clockwise."""
    x, y = place
    sides = zip(corners, (*corners[1:], corners[0]), strict=True)
    return all((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0.0 for (x0, y0), (x1, y1) in sides)


def _polygons(order: Order, generator: np.random.Generator) -> list[Wall]:
    """Set convex polygons so far apart that a robot passes between any two."""
    width, height = CELL_SIZE * order.columns, CELL_SIZE * order.rows
    discs: list[tuple[float, float, float]] = []
    share = order.polygons or 0.0
    aim, area = share * 0.5 * width * height, 0.0
    for _ in range(40 * order.rows * order.columns):
        radius = generator.uniform(0.3, 1.6)
        if area >= aim or min(width, height) < 2.0 * (radius + _GAP):
            continue
        x = generator.uniform(radius + _GAP, width - radius - _GAP)
        y = generator.uniform(radius + _GAP, height - radius - _GAP)
        if all(math.hypot(x - a, y - b) >= radius + r + _GAP for a, b, r in discs):
            discs.append((x, y, radius))
            area += math.pi * radius**2
    walls = []
    for x, y, radius in discs:
        corners = int(generator.integers(3, 8))
        parts = generator.uniform(0.6, 1.0, corners)
        angles = generator.uniform(0.0, 2.0 * math.pi) + np.cumsum(parts) * (2.0 * math.pi / parts.sum())
        points = tuple(
            (round(x + radius * math.cos(angle), 3), round(y + radius * math.sin(angle), 3))
            for angle in angles
        )
        walls.append(Wall(height=4.0, corners=points))
    return walls


def _made(
    order: Order,
    lab: Lab,
    patterns: list[tuple[int, str]],
    starts: list[tuple[float, float]],
    targets: list[tuple[float, float]],
    generator: np.random.Generator | None,
) -> Made:
    lines = [f'<Lab Name="{attribute(order.name, "--name")}" Height="{lab.height:g}" Width="{lab.width:g}">']
    for x, y in targets:
        lines.append(f'\t<Beacon X="{x:g}" Y="{y:g}" Height="{_BEACON_HEIGHT:g}"/>')
        lines.append(f'\t<Target X="{x:g}" Y="{y:g}" Radius="{_TARGET_RADIUS:g}"/>')
    lines += [f'\t<Row Pos="{position}" Pattern="{pattern}"/>' for position, pattern in patterns]
    for wall in () if patterns else lab.walls:
        lines.append(f'\t<Wall Height="{wall.height:g}">')
        lines += [f'\t\t<Corner X="{x:g}" Y="{y:g}"/>' for x, y in wall.corners]
        lines.append("\t</Wall>")
    directions = (
        [0] * len(starts) if generator is None else (90 * generator.integers(0, 4, len(starts))).tolist()
    )
    positions = [
        f'\t<Position X="{x:g}" Y="{y:g}" Dir="{direction}"/>'
        for (x, y), direction in zip(starts, directions, strict=True)
    ]
    finished = Lab(
        name=lab.name,
        width=lab.width,
        height=lab.height,
        walls=lab.walls,
        beacons=tuple(Beacon(x=x, y=y, height=_BEACON_HEIGHT) for x, y in targets),
        targets=tuple(Target(x=x, y=y, radius=_TARGET_RADIUS) for x, y in targets),
    )
    return Made(
        lab=finished,
        lab_xml="\n".join([*lines, "</Lab>", ""]),
        grid_xml="\n".join(["<Grid>", *positions, "</Grid>", ""]),
    )
