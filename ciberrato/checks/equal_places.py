"""Poses of a lab that are equal for a robot: wherever it drives, it finds the same room and readings.

Two poses are equal if a turn and a shift take the room of one onto that of the other, or onto itself, and the
free space and the readings of all places in it stay what they are, within the noise. No filter can tell
equal poses apart; at most it can find out that the robot is in one of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ciberrato.checks.free_space import FreeSpace
from ciberrato.infrared.model import ideal_reading, sensor_distances
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.reprs import short_repr
from ciberrato.world.coordinates import Pose
from ciberrato.world.lab import Lab

ALL = 0.98
"""Share of places and directions that must be the same; where files round corners, a few are not."""

_PARTS = (2, 3, 4, 5, 6, 8)
_TURNS = (0.0, *sorted({2.0 * math.pi * part / parts for parts in _PARTS for part in range(1, parts)}))
_MOST_ROOMS = 40
_PLACES = 300
_DIRECTIONS = np.arange(12) * (math.pi / 6.0) + 0.123
_EQUAL = 0.02  # units
_NEARLY = 0.1  # units
_SHIFT = 0.01
_AT = 0.15  # units from a node of the room that a pose is in


@dataclass(frozen=True, slots=True)
class Room:
    """A part of the free space, from which no robot gets to another one.

    Attributes
    ----------
    part : int
        Its number in the free space.
    x, y : float
        Its middle, in units: what turns leave in place where it is equal to itself; what is taken onto the
        middle of its like where rooms are equal; else the mean of its places.
    kind : int
        Equal rooms are of one kind.
    angle : float
        Radians by which it is turned against the first room of its kind.
    symmetries : tuple of float
        Turns about its mean, in radians, after which it is the same; 0 is the first.
    """

    __repr__ = short_repr

    part: int
    x: float
    y: float
    kind: int
    angle: float
    symmetries: tuple[float, ...]


def equal_rooms(lab: Lab, space: FreeSpace, noise: float = 0.1) -> list[Room]:
    """Find which rooms of a lab are equal to which, and to themselves turned round.

    Parameters
    ----------
    lab : Lab
    space : FreeSpace
        Of the lab; its first 40 rooms are looked at.
    noise : float
        Difference of readings up to which they count as equal: ObstacleNoise.

    Returns
    -------
    list of Room
        The largest first.
    """
    firsts: list[tuple[Room, NDArray[np.float64]]] = []
    found = []
    for part in range(min(int(space.part.max()) + 1, _MOST_ROOMS)):
        places = space.places(part)
        x, y = (float(value) for value in places.mean(axis=0))
        for first, known in firsts:
            if not _as_large(places, known):
                continue
            centre = (first.x, first.y)
            for turn in _TURNS:
                onto = _aligned(space, known, centre, (x, y), turn)
                if _same(lab, space, known, centre, onto, turn, noise):
                    found.append(Room(part, *onto, first.kind, turn, first.symmetries))
                    break
            else:
                continue
            break
        else:
            centre = (x, y)
            for turn in _TURNS[1:]:
                onto = _aligned(space, places, (x, y), (x, y), turn)
                if _same(lab, space, places, (x, y), onto, turn, noise):
                    centre = _fixed((x, y), onto, turn)
                    break
            turns = [turn for turn in _TURNS[1:] if _same(lab, space, places, centre, centre, turn, noise)]
            firsts.append((Room(part, *centre, len(firsts), 0.0, (0.0, *turns)), places))
            found.append(firsts[-1][0])
    return found


def equal_poses(space: FreeSpace, rooms: list[Room], pose: Pose, *, compass: bool = False) -> list[Pose]:
    """List the other poses that are equal to one.

    Parameters
    ----------
    space : FreeSpace
    rooms : list of Room
        As of `equal_rooms`.
    pose : (float, float, float)
        Units and radians.
    compass : bool
        Whether the robot knows its heading, by a compass or a GPS: then equal poses have the same one.

    Returns
    -------
    list of (float, float, float)
        None if the pose is in no room.
    """
    x, y, heading = pose
    parts = space.parts_near(x, y, _AT)
    here = next((room for room in rooms if room.part in parts), None)
    if here is None:
        return []
    found = []
    for room in rooms:
        if room.kind != here.kind:
            continue
        for symmetry in room.symmetries:
            turn = math.remainder(room.angle + symmetry - here.angle, 2.0 * math.pi)
            if (compass and abs(turn) > 1e-9) or (room is here and abs(turn) < 1e-9):
                continue
            (moved,) = _moved(np.array([[x, y]]), (here.x, here.y), (room.x, room.y), turn).tolist()
            found.append((moved[0], moved[1], math.remainder(heading + turn, 2.0 * math.pi)))
    return found


def _as_large(places: NDArray[np.float64], others: NDArray[np.float64]) -> bool:
    """Compare what no turn changes: the number of places, and how far they are spread."""
    if abs(len(places) - len(others)) > 0.05 * len(others):
        return False
    spreads = [float(np.hypot(*(each - each.mean(axis=0)).T).mean()) for each in (places, others)]
    return abs(spreads[0] - spreads[1]) < _EQUAL * (1.0 + spreads[1])


def _moved(
    places: NDArray[np.float64], centre: tuple[float, float], onto: tuple[float, float], turn: float
) -> NDArray[np.float64]:
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.asarray((places - centre) @ np.array([[cosine, sine], [-sine, cosine]]) + onto)


def _some(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return as many of a room's places as are compared in full."""
    return places[:: max(len(places) // _PLACES, 1)]


def _aligned(
    space: FreeSpace,
    places: NDArray[np.float64],
    centre: tuple[float, float],
    onto: tuple[float, float],
    turn: float,
) -> tuple[float, float]:
    """Return where a turn takes the centre so that the distances to walls fit best, near a first guess.

    The mean of a room's places is out by some hundredths, as their lattice is not turned with it.
    """
    here = _some(places)
    before, at = space.walls.distance(*here.T), np.array(onto)
    for _ in range(3):
        there = _moved(here, centre, (float(at[0]), float(at[1])), turn)
        after = space.walls.distance(*there.T)
        if (np.abs(after - before) < _NEARLY).mean() < ALL:
            break
        slopes = [(space.walls.distance(*(there + by).T) - after) / _SHIFT for by in _SHIFT * np.eye(2)]
        change, *_ = np.linalg.lstsq(np.stack(slopes, axis=1), before - after, rcond=None)
        at = at + np.clip(change, -_NEARLY, _NEARLY)
    return float(at[0]), float(at[1])


def _fixed(centre: tuple[float, float], onto: tuple[float, float], turn: float) -> tuple[float, float]:
    """Return the point that a turn which takes a centre onto a place leaves where it is."""
    cosine, sine = math.cos(turn), math.sin(turn)
    rotation = np.array([[cosine, -sine], [sine, cosine]])
    fixed = np.linalg.solve(np.eye(2) - rotation, np.array(onto) - rotation @ np.array(centre))
    return float(fixed[0]), float(fixed[1])


def _same(
    lab: Lab,
    space: FreeSpace,
    places: NDArray[np.float64],
    centre: tuple[float, float],
    onto: tuple[float, float],
    turn: float,
    noise: float,
) -> bool:
    """Return whether all is the same at some places and after they have been moved."""
    here = _some(places)
    there = _moved(here, centre, onto, turn)
    walls = space.walls
    if (np.abs(walls.distance(*here.T) - walls.distance(*there.T)) < _EQUAL).mean() < ALL:
        return False
    everywhere = _moved(places, centre, onto, turn)
    for target in lab.targets:
        before, after = (
            np.hypot(each[:, 0] - target.x, each[:, 1] - target.y) - (target.radius - ROBOT_RADIUS)
            for each in (places, everywhere)
        )
        # One place is enough, if it is not on the rim.
        if ((before < -_NEARLY) & (after > _NEARLY) | (after < -_NEARLY) & (before > _NEARLY)).any():
            return False
    with np.errstate(invalid="ignore"):  # nothing seen from a place that is no place for a robot
        seen, after = (
            np.asarray(ideal_reading(sensor_distances(walls, at[:, :1], at[:, 1:], _DIRECTIONS + by)))
            for at, by in ((here, 0.0), (there, turn))
        )
        return bool((np.abs(seen - after) <= noise).mean() >= ALL)
