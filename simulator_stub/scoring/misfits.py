"""Labs and starts that a way of scoring was not made for: the rules say nothing of them, so people are told.

The real simulator ends itself, or hangs, in many of these; there is no right answer. We write what the rules
give, and leave out what does not fit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ciberrato.world.lab import CELL_SIZE, Lab
from simulator_stub.scoring.tours import MOST_PLACES

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot

OFF = 0.01
"""Units beside a place of the map from which on a start is worth a note."""


def cell_notes(lab: Lab, robot: Robot, *, tour: bool = False) -> list[str]:
    """Return what does not fit the maps of modes 2 and 3, which are of cells between walls.

    Parameters
    ----------
    lab : Lab
    robot : Robot
        At its start.
    tour : bool
        Whether a tour is asked for, too.

    Returns
    -------
    list of str
    """
    notes = _start_notes(lab, robot, CELL_SIZE / 2.0, "the centre of a cell")
    if not any(wall.height > 0.0 for wall in lab.walls):
        notes.append(f"robot {robot.robot_id}: the lab has no walls, and the map shows none but the border")
    return notes + (_tour_notes(lab, robot) if tour else [])


def line_notes(lab: Lab, robot: Robot, *, tour: bool = False) -> list[str]:
    """Return what does not fit the maps of modes 5 and 6, which are of painted lines; see `cell_notes`."""
    notes = _start_notes(lab, robot, 0.0, "a crossing of the grid of lines")
    if not any(wall.height <= 0.0 for wall in lab.walls):
        notes.append(
            f"robot {robot.robot_id}: the lab has no painted lines; the map shows its walls as lines"
        )
    return notes + (_tour_notes(lab, robot) if tour else [])


def _start_notes(lab: Lab, robot: Robot, origin: float, place: str) -> list[str]:
    start = f"robot {robot.robot_id}: its start ({robot.x:g}, {robot.y:g})"
    if not (0.0 < robot.x < lab.width and 0.0 < robot.y < lab.height):
        return [f"{start} is outside the lab; the map is drawn as seen from there"]
    if any(abs(math.remainder(value - origin, CELL_SIZE)) > OFF for value in (robot.x, robot.y)):
        return [f"{start} is not {place}; the map is drawn from the place that its rule gives"]
    return []


def _tour_notes(lab: Lab, robot: Robot) -> list[str]:
    targets, beacons = len(lab.targets), len(lab.beacons)
    if targets < beacons:
        return [
            f"robot {robot.robot_id}: {beacons} beacons and {targets} targets; the tour takes only these in"
        ]
    if beacons > MOST_PLACES:
        return [f"robot {robot.robot_id}: no tour is written: {beacons} places are more than {MOST_PLACES}"]
    return []
