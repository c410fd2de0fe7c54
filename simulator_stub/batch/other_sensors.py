"""Sensors that not every robot has, for the robots of a batch in one lab: GPS and beacons, with numpy."""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.geometry.angles import wrap_each_once
from ciberrato.infrared.on_face import ray_distance_by_angles
from ciberrato.world.lab import Beacon
from simulator_stub.batch.plan import LabPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.beacons import ON_A_WALL


def gps(robots: Integers, state: BatchState, noise: Floats | None, out: Floats) -> None:
    """Read the GPS of robots, as `simulator_stub.sensors.gps`.

    Parameters
    ----------
    robots : array of int, shape (n,)
    state : BatchState
    noise : array, shape (worlds, 2), or None
        Standard normal numbers.
    out : array, shape (worlds, 2)
        Filled in at the robots; units.
    """
    places = np.stack((state.x[robots], state.y[robots]), axis=-1)
    if noise is not None:
        places += state.gps_deviation[robots, np.newaxis] * noise[robots]
    out[robots] = np.floor((places + state.gps_offset[robots]) * 10.0 + 0.5) / 10.0


def beacons(lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None, out: Floats) -> None:
    """Read the beacon sensors of robots, as `simulator_stub.sensors.beacons`.

    Parameters
    ----------
    lab : LabPlan
    robots : array of int, shape (n,)
    state : BatchState
    noise : array, shape (worlds, beacons), or None
        Standard normal numbers.
    out : array, shape (worlds, beacons)
        Filled in at the robots: degrees, nan where a beacon is not seen.
    """
    x, y, heading = state.x[robots], state.y[robots], state.heading[robots]
    out[robots] = np.nan
    for number, beacon in enumerate(lab.world.lab.beacons):
        directions = _bearings(x, y, beacon)
        angles = wrap_each_once(directions - heading)
        if noise is not None:
            angles = angles + state.beacon_deviation[robots] * noise[robots, number]
        angles = wrap_each_once(angles)
        seen = np.abs(angles) <= state.beacon_aperture[robots]
        seen[seen] = ~_hidden(lab, beacon, x[seen], y[seen], directions[seen])
        out[robots[seen], number] = np.floor(angles[seen] * 180.0 / math.pi + 0.5)


def _bearings(x: Floats, y: Floats, beacon: Beacon) -> Floats:
    """Compute the angles to a beacon, by `math`: numpy's arc tangent may differ in the last bit."""
    dx, dy = beacon.x - x, beacon.y - y
    angles = np.fromiter(map(math.atan2, dy.tolist(), dx.tolist()), np.float64, dx.size)
    above = np.where(beacon.y > y, math.pi / 2, -math.pi / 2)
    return np.where(beacon.x == x, above, angles)


def _hidden(lab: LabPlan, beacon: Beacon, x: Floats, y: Floats, directions: Floats) -> Booleans:
    walls = lab.world.walls_hiding(beacon.height)
    if not walls.touches(beacon.x, beacon.y, ON_A_WALL):
        return walls.blocked(x, y, beacon.x, beacon.y)
    hidden = np.zeros(x.size, np.bool_)
    for robot in range(x.size):
        one_x, one_y = float(x[robot]), float(y[robot])
        distance = math.sqrt((one_x - beacon.x) ** 2 + (one_y - beacon.y) ** 2)
        seen_at = ray_distance_by_angles(walls.nearby, one_x, one_y, float(directions[robot]))
        hidden[robot] = seen_at < distance
    return hidden
