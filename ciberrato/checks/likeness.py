"""Labs that look the same turned round, and twin rooms: places that IR sensors cannot distinguish."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from ciberrato.checks.equal_places import Room, equal_rooms
from ciberrato.checks.free_space import FreeSpace
from ciberrato.files.findings import Finding
from ciberrato.infrared.model import sensor_distances
from ciberrato.localization.evidence.symmetry import Turn, possible_turns, share_alike
from ciberrato.world.lab import Lab

MUCH = 0.5
"""Share of the free places that must look the same turned round for a note."""
ALL = 0.98

_TWINS_SHOWN = 3
_PLACES = 300
_PARTS = 40
_EQUAL = 0.02


def turns_alike(lab: Lab, space: FreeSpace) -> list[tuple[Turn, float]]:
    """Find the turns under which much of a lab looks the same.

    Parameters
    ----------
    lab : Lab
    space : FreeSpace

    Returns
    -------
    list of (Turn, share)
        The share of the free places that look the same, `MUCH` to 1; the greatest first.
    """
    places = np.concatenate(
        [space.places(part) for part in range(int(space.part.max()) + 1)] or [np.empty((0, 2))]
    )
    some = places[:: max(len(places) // _PLACES, 1)]
    if not len(some):
        return []
    found = [(turn, share_alike(turn, space.walls, some)) for turn in possible_turns(lab, space.walls)]
    return sorted(((turn, share) for turn, share in found if share >= MUCH), key=lambda pair: -pair[1])


def likeness_findings(lab: Lab, space: FreeSpace, source: str, line: int) -> list[Finding]:
    """Report that a lab looks the same turned round, and rooms that look the same.

    Parameters
    ----------
    lab : Lab
    space : FreeSpace
    source : str
        The lab's file.
    line : int
        Line of its root.
    """
    found = []
    seen: set[int] = set()
    for turn, share in turns_alike(lab, space):
        degrees = round(math.degrees(turn.angle))
        if min(degrees, 360 - degrees) in seen:
            continue
        seen.add(min(degrees, 360 - degrees))
        what = "the lab looks the same" if share >= ALL else f"{share:.0%} of the lab looks the same"
        found.append(
            Finding(
                severity="note",
                kind="symmetry",
                source=source,
                line=line,
                found=f"{what} turned by {degrees}° about ({turn.x:g}, {turn.y:g})",
                taken="it takes a compass, a beacon or a GPS to know on which side one is",
                place=(turn.x, turn.y),
            )
        )
    found += _turned_rooms(lab, space, source, line)
    twins = list(itertools.islice(twin_parts(space), _TWINS_SHOWN + 1))
    for one, other in twins[:_TWINS_SHOWN]:
        (x, y), (to_x, to_y) = (tuple(space.places(part).mean(axis=0).round(1)) for part in (one, other))
        more = (
            ", and more of them"
            if len(twins) > _TWINS_SHOWN and (one, other) == twins[_TWINS_SHOWN - 1]
            else ""
        )
        found.append(
            Finding(
                severity="note",
                kind="twins",
                source=source,
                line=line,
                found=f"the closed rooms around ({x:g}, {y:g}) and ({to_x:g}, {to_y:g}) look the same{more}",
                taken="no robot can tell in which it is, with a compass neither",
                place=(float(x), float(y)),
            )
        )
    return found


def _turned_rooms(lab: Lab, space: FreeSpace, source: str, line: int) -> list[Finding]:
    """Report closed rooms that are equal to another one turned round: one note a kind of room."""
    found = []
    first: dict[int, Room] = {}
    told: set[int] = set()
    for room in equal_rooms(lab, space):
        one = first.setdefault(room.kind, room)
        degrees = round(math.degrees(room.angle))
        if degrees == 0 or room.kind in told:
            continue
        told.add(room.kind)
        found.append(
            Finding(
                severity="note",
                kind="turned rooms",
                source=source,
                line=line,
                found=f"the closed rooms around ({one.x:.1f}, {one.y:.1f}) and ({room.x:.1f}, {room.y:.1f}) "
                f"look the same turned by {degrees}°",
                taken="without a compass, a beacon or a GPS no robot can tell in which of them it is",
                place=(round(room.x, 1), round(room.y, 1)),
            )
        )
    return found


def twin_parts(space: FreeSpace) -> Iterator[tuple[int, int]]:
    """Yield pairs of parts of free space that look the same, one moved onto the other.

    Parameters
    ----------
    space : FreeSpace

    Yields
    ------
    one, other : int
        Numbers of parts.
    """
    parts = [space.places(part) for part in range(min(int(space.part.max()) + 1, _PARTS))]
    directions = np.arange(12) * (math.pi / 6.0) + 0.123
    for one, other in itertools.combinations(range(len(parts)), 2):
        if abs(len(parts[one]) - len(parts[other])) > 0.05 * len(parts[one]):
            continue
        shift = parts[other].min(axis=0) - parts[one].min(axis=0)
        if np.abs(parts[other].max(axis=0) - parts[one].max(axis=0) - shift).max() > 1e-9:
            continue
        here = parts[one][:: max(len(parts[one]) // _PLACES, 1)]
        there = here + shift
        near = np.abs(space.walls.distance(*here.T) - space.walls.distance(*there.T)) < _EQUAL
        if not near.all():
            continue
        seen = sensor_distances(space.walls, here[:, :1], here[:, 1:], directions)
        moved = sensor_distances(space.walls, there[:, :1], there[:, 1:], directions)
        same = np.isclose(seen, moved, rtol=_EQUAL, atol=_EQUAL)
        if same.mean() > ALL:
            yield one, other
