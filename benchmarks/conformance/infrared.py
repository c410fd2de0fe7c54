"""IR distances, collision distances, and other robots in view, as the real simulator has them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.conformance import Finding
from benchmarks.conformance.files import numbers, read_named_lab
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.exact import exact_distance, hang_on_rounding
from ciberrato.infrared.model import (
    SENSOR_OFFSET,
    distances_at,
    ideal_reading,
    other_robot_distance,
    round_reading,
    sensor_distances,
)

TOLERANCE = 1e-9
_COLUMNS = ("x", "y", "dir_deg", "sensor_angle_deg", "distance", "wall_distance")
_FILES = ("cell_centres", "own_cell_centres", "random_poses", "own_random_poses")
_EVERY = 16
"""The path for one robot at a time is compared on every sixteenth row: it takes ten times as long."""


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield the rows of this check."""
    for file in _FILES:
        path = golden / "ir" / f"{file}.csv.gz"
        if path.is_file():
            yield from _distances(file, path, labs)
        else:
            yield Finding(f"infrared: {file}", 0, None, True, "not recorded here")
    path = golden / "ir" / "other_robots.csv.gz"
    if path.is_file():
        yield from _other_robots(path)
    else:
        yield Finding("infrared: other_robots", 0, None, True, "not recorded here")


def _distances(file: str, path: Path, labs: Path | None) -> Iterator[Finding]:
    cases = single_cases = points = missing = groups = inexact = unlike = 0
    greatest = single_greatest = wall_greatest = 0.0
    first = ""
    for name, recorded in numbers(path, _COLUMNS, "lab"):
        lab = read_named_lab(name, labs)
        if lab is None:
            missing += 1
            continue
        groups += 1
        walls = WallMap.from_lab(lab)
        x, y, heading, angle, distance, _ = recorded.T
        # In this order the recording's own arithmetic is repeated to the last bit.
        direction = heading * math.pi / 180.0 + angle / 180.0 * math.pi
        ours = sensor_distances(walls, x, y, direction)
        difference = worst(ours, distance)
        for tie in np.flatnonzero(hang_on_rounding(ours)).tolist():
            at = float(x[tie]), float(y[tie]), float(direction[tie])
            ours[tie] = exact_distance(walls, *at, SENSOR_OFFSET)
        unlike += int((round_reading(ideal_reading(ours)) != round_reading(ideal_reading(distance))).sum())
        every = zip(*(values[::_EVERY].tolist() for values in (x, y, direction)), strict=True)
        places = list(every)
        single = [distances_at(walls, at_x, at_y, [axis])[0] for at_x, at_y, axis in places]
        exact = [exact_distance(walls, at_x, at_y, axis, SENSOR_OFFSET) for at_x, at_y, axis in places]
        inexact += int((np.array(exact) != distance[::_EVERY]).sum())
        cases += len(recorded)
        single_cases += len(single)
        single_greatest = max(single_greatest, worst(np.array(single), distance[::_EVERY]))
        greatest = max(greatest, difference)
        place = np.unique(recorded[:, [0, 1, 5]], axis=0)
        points += len(place)
        wall_greatest = max(wall_greatest, worst(walls.distance(place[:, 0], place[:, 1]), place[:, 2]))
        if not first and max(difference, single_greatest, wall_greatest) > TOLERANCE:
            first = f"first in {name}"
    note = first or f"{groups} labs" + (f"; {missing} labs whose files are not here" if missing else "")
    yield Finding(f"infrared: {file}", cases, greatest, greatest <= TOLERANCE, note)
    yield Finding(
        f"infrared: {file}, one robot",
        single_cases,
        single_greatest,
        single_greatest <= TOLERANCE,
        f"every {_EVERY}th row, by the path for one robot",
    )
    yield Finding(
        f"infrared: {file}, exact",
        single_cases,
        None,
        inexact == 0,
        f"every {_EVERY}th row, by the slow path: {inexact} not equal to the last bit",
    )
    yield Finding(f"infrared: {file}, readings", cases, None, unlike == 0, f"{unlike} rounded values unlike")
    yield Finding(
        f"infrared: {file}, to walls", points, wall_greatest, wall_greatest <= TOLERANCE, "collision distance"
    )


def worst(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> float:
    """Return the greatest difference; infinite if one is not a number and the other is."""
    same = ours == theirs
    difference = np.where(same, 0.0, np.abs(ours - np.where(same, 0.0, theirs)))
    return float(np.where(np.isnan(difference), np.inf, difference).max(initial=0.0))


def _other_robots(path: Path) -> Iterator[Finding]:
    walls = WallMap.from_lab(read_lab(path.with_name("other_robots.lab.xml")))
    columns = (
        "x1",
        "y1",
        "dir1_deg",
        "x2",
        "y2",
        "sensor_angle_deg",
        "ideal_with_other",
        "ideal_walls_only",
        "ir_value_noise0",
    )
    (_, recorded), *rest = numbers(path, (*columns, "center_distance"), "center_distance")
    recorded = np.concatenate([recorded, *(group for _, group in rest)])
    x, y, heading, other_x, other_y, angle, with_other, alone, reading, _ = recorded.T
    direction = heading * math.pi / 180.0 + angle / 180.0 * math.pi
    wall = sensor_distances(walls, x, y, direction)
    other = np.array(
        [
            other_robot_distance(*pose)
            for pose in zip(*(v.tolist() for v in (x, y, direction, other_x, other_y)), strict=True)
        ]
    )
    ours = ideal_reading(np.minimum(wall, other))
    difference = max(worst(ideal_reading(wall), alone), worst(ours, with_other))
    rounded = int((round_reading(ours) != reading).sum())
    seen = int((with_other != alone).sum())
    yield Finding(
        "infrared: other_robots",
        len(recorded),
        difference,
        difference <= TOLERANCE and rounded == 0,
        f"1/distance; the other robot is seen in {seen}; {rounded} rounded values unlike",
    )
