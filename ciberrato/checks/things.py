"""Walls, beacons, targets and starts that are where they cannot be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from ciberrato.files.findings import Finding
from ciberrato.files.lab import LabFile
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import Lab, Wall

if TYPE_CHECKING:
    from ciberrato.checks.free_space import FreeSpace
    from ciberrato.world.start_grid import StartGrid

_OVER_THE_BORDER = 0.3
"""Units; files give walls along the border that stand over it by their thickness."""
_ROUNDING = 1e-9


def thing_findings(file: LabFile) -> list[Finding]:
    """Find walls, beacons and targets outside the lab, in walls, or on top of each other.

    Parameters
    ----------
    file : LabFile

    Returns
    -------
    list of Finding
    """
    return [*_walls(file), *_beacons(file), *_targets(file)]


def _walls(file: LabFile) -> list[Finding]:
    lab, found = file.lab, []
    first: dict[frozenset[tuple[float, float]], int] = {}
    for wall, line, row in zip(lab.walls, file.wall_lines, file.from_rows, strict=True):
        if row:  # the row is told of
            continue
        warn = partial(Finding, severity="warning", source=file.source, line=line)
        beyond = [point for point in wall.corners if _outside(lab, *point, _OVER_THE_BORDER)]
        if beyond:
            what = (
                "stands outside the lab" if len(beyond) == len(wall.corners) else "reaches beyond the border"
            )
            x, y = beyond[0]
            found.append(warn(kind="wall outside", found=f"a wall {what}, at ({x:g}, {y:g})", place=(x, y)))
        corners = frozenset(wall.corners)
        if corners in first:
            text = f"the wall of line {first[corners]} is there again"
            found.append(warn(kind="wall twice", found=text, place=wall.corners[0]))
        first.setdefault(corners, line)
    return found


def _beacons(file: LabFile) -> list[Finding]:
    lab, found = file.lab, []
    for number, (beacon, line) in enumerate(zip(lab.beacons, file.beacon_lines, strict=True)):
        place = (beacon.x, beacon.y)
        what = f"beacon {number} at ({beacon.x:g}, {beacon.y:g})"
        warn = partial(Finding, severity="warning", source=file.source, line=line, place=place)
        if _outside(lab, *place, 0.0):
            found.append(
                warn(kind="beacon outside", found=f"{what} is outside the lab", taken="no robot sees it")
            )
            continue
        around = [
            (wall, at) for wall, at in zip(lab.walls, file.wall_lines, strict=True) if _inside(wall, *place)
        ]
        for wall, at in around[:1]:
            if wall.height > 0.0 and wall.height >= beacon.height:
                text = f"{what} is inside the wall of line {at}, which is as high"
                found.append(warn(kind="beacon in wall", found=text, taken="no robot sees it"))
        same = [one for one in range(number) if (lab.beacons[one].x, lab.beacons[one].y) == place]
        if same:
            text = f"{what} is where beacon {same[0]} is"
            found.append(warn(kind="beacons overlap", found=text, severity="note"))
    return found


def _targets(file: LabFile) -> list[Finding]:
    lab, found = file.lab, []
    for number, (target, line) in enumerate(zip(lab.targets, file.target_lines, strict=True)):
        place = (target.x, target.y)
        what = f"target {number} at ({target.x:g}, {target.y:g})"
        warn = partial(Finding, severity="warning", source=file.source, line=line, place=place)
        if _outside(lab, *place, 0.0):
            found.append(warn(kind="target outside", found=f"{what} is outside the lab"))
        if target.radius < ROBOT_RADIUS:
            text = f"{what} has a radius of {target.radius:g}"
            advice = "a robot has one of 0.5 and must be inside whole: write more"
            found.append(
                warn(
                    kind="target too small", found=text, taken="no robot ever counts as inside", advice=advice
                )
            )
        for one, other in enumerate(lab.targets[:number]):
            apart = math.hypot(other.x - target.x, other.y - target.y)
            if apart < other.radius + target.radius - 2.0 * ROBOT_RADIUS - _ROUNDING:
                text = f"{what} overlaps target {one} of line {file.target_lines[one]}"
                taken = f"the ground sensor shows {number} where a robot is inside both"
                found.append(warn(kind="targets overlap", found=text, taken=taken))
    return found


def reach_findings(file: LabFile, space: FreeSpace, starts: Sequence[tuple[float, float]]) -> list[Finding]:
    """Find targets that no robot can be in, or that none can drive to; closed rooms, as a note.

    Parameters
    ----------
    file : LabFile
    space : FreeSpace
        Space of the lab.
    starts : sequence of (x, y)
        Start places of robots; empty: in target 0, by custom.
    """
    found = []
    sizes = [len(space.places(part)) for part in range(int(space.part.max()) + 1)]
    # Where a lab is all closed rooms, that is its point.
    severity = "warning" if 2 * sizes[0] > sum(sizes) else "note"
    where = f"the start{'s' * (len(starts) > 1)}" if starts else "target 0"
    begin = starts or [(target.x, target.y) for target in file.lab.targets[:1]]
    reached = {part for x, y in begin for part in space.parts_near(x, y, 2.0 * space.step)} or {0}
    for number, (target, line) in enumerate(zip(file.lab.targets, file.target_lines, strict=True)):
        if target.radius < ROBOT_RADIUS or _outside(file.lab, target.x, target.y, 0.0):
            continue
        parts = space.parts_near(target.x, target.y, target.radius - ROBOT_RADIUS + space.step)
        what = f"target {number} at ({target.x:g}, {target.y:g})"
        if not parts:
            text, kind = f"{what} is in a wall or too near to one: no robot fits into it", "target in wall"
        elif parts.isdisjoint(reached):
            text, kind = f"{what} cannot be reached from {where}", "target out of reach"
        else:
            continue
        place = (target.x, target.y)
        severe = severity if parts else "warning"
        found.append(
            Finding(severity=severe, kind=kind, source=file.source, line=line, found=text, place=place)
        )
    rooms = [space.places(part) for part in range(1, int(space.part.max()) + 1)]
    if rooms:
        x, y = rooms[0].mean(axis=0)
        text = f"{len(rooms)} part{'s' * (len(rooms) > 1)} of the lab cannot be reached from its largest one"
        found.append(
            Finding(
                severity="note",
                kind="closed room",
                source=file.source,
                line=1,
                found=f"{text}: one around ({x:.3g}, {y:.3g})",
                place=(float(x), float(y)),
            )
        )
    return found


def start_findings(grid: StartGrid, lab: Lab, source: str, lines: Sequence[int | None] = ()) -> list[Finding]:
    """Find starts outside the lab, in walls, or on top of each other.

    Parameters
    ----------
    grid : StartGrid
    lab : Lab
    source : str
        The grid's file, for messages.
    lines : sequence of (int or None)
        The line of each position; empty where it has none.

    Returns
    -------
    list of Finding
    """
    import numpy as np

    from ciberrato.checks.free_space import blocked, solid
    from ciberrato.geometry.walls import WallMap

    walls = WallMap.from_lab(solid(lab))
    x, y = (np.array([getattr(position, axis) for position in grid.positions]) for axis in "xy")
    inside, clearance = blocked(walls, x, y), walls.distance(x, y)
    found = []
    for number, position in enumerate(grid.positions):
        what = f"start {number + 1} at ({position.x:g}, {position.y:g})"
        place = (position.x, position.y)
        line = lines[number] if lines else None
        warn = partial(Finding, severity="warning", source=source, line=line, place=place)
        if _outside(lab, *place, 0.0):
            size = f"{lab.width:g} x {lab.height:g}"
            taken = "the robot stands there"
            found.append(
                warn(kind="start outside", found=f"{what} is outside the lab of {size}", taken=taken)
            )
        elif inside[number]:
            found.append(
                warn(kind="start in wall", found=f"{what} is in a wall", taken="the robot is stuck in it")
            )
        elif clearance[number] < ROBOT_RADIUS - _ROUNDING:
            text = f"{what} is {clearance[number]:.2g} from a wall, and a robot has a radius of 0.5"
            found.append(warn(kind="start in wall", found=text, taken="it collides until it is free"))
        for one, other in enumerate(grid.positions[:number]):
            if math.hypot(other.x - position.x, other.y - position.y) < 2.0 * ROBOT_RADIUS - _ROUNDING:
                at = f" of line {lines[one]}" if lines else ""
                text = f"{what} overlaps start {one + 1}{at}"
                found.append(warn(kind="starts overlap", found=text, taken="two robots there collide"))
                break
    return found


def _outside(lab: Lab, x: float, y: float, margin: float) -> bool:
    return not (-margin <= x <= lab.width + margin and -margin <= y <= lab.height + margin)


def _inside(wall: Wall, x: float, y: float) -> bool:
    """Return whether a point is inside a polygon, by the even-odd rule."""
    inside = False
    for (x0, y0), (x1, y1) in zip(wall.corners, (*wall.corners[1:], wall.corners[0]), strict=True):
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) * (x1 - x0) / (y1 - y0):
            inside = not inside
    return inside
