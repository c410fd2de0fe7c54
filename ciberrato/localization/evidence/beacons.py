"""Evidence of the beacon sensors: the angle under which a beacon is visible, or that it is not visible.

The angle from a square to a beacon depends on the square alone, so that the likelihood of a reading is a
function of that angle less the state's heading, of how much the angle varies over the square, and of the
part of the square from which the beacon can be seen: three numbers that are tabulated once, in few steps.
A beacon is hidden by walls at least as high as it is, and outside the aperture.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.geometry.walls import WallMap
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.protocol.messages import BeaconReading
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Beacon, Lab

Codes = NDArray[np.int64]

_AROUND = 288
"""Steps of the angle, 1.25 degrees each: bins of headings are whole numbers of them."""
_STEP = 2.0 * math.pi / _AROUND
_SPREADS = np.radians([1.0, 2.0, 4.0, 8.0, 16.0, 40.0, 200.0])  # standard deviations over a square
_SEEN = np.array([0.0, 0.25, 0.5, 0.75, 1.0])  # parts of a square
_CLASSES = len(_SPREADS) * len(_SEEN)
_NEAR = 1e-3  # units from a beacon: one that stands on a wall is not hidden by it
_RAYS = 2048
_OUTLIER = 0.03  # probability that a beacon shows, or does not, where it should not
_POSE_ERROR = 0.15  # units, of a pose that is compared with exact readings


@dataclass(frozen=True, slots=True, eq=False)
class BeaconTable:
    """Squares from which one beacon can be seen.

    Attributes
    ----------
    codes : array of int, shape (squares,)
        Class of the square, times 2 * `_AROUND`, plus the absolute angle to the beacon in steps.
    shares : array, shape (classes,)
        Number of squares of each class.
    """

    __repr__ = short_repr

    codes: Codes
    shares: Floats


@functools.lru_cache(maxsize=32)
def hiding_walls(lab: Lab, height: float) -> WallMap:
    """Collect the walls that hide a beacon of some height; see `WallMap.from_lab`."""
    return WallMap.from_lab(lab, at_least=height)


def visible(lab: Lab, beacon: Beacon, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Return from which places a beacon can be seen.

    Parameters
    ----------
    lab : Lab
    beacon : Beacon
    x, y : array, shape (n,)
        Units.

    Returns
    -------
    array of bool, shape (n,)
    """
    walls = hiding_walls(lab, beacon.height)
    short = _NEAR / np.maximum(np.hypot(x - beacon.x, y - beacon.y), _NEAR)
    return ~walls.blocked(x, y, beacon.x + short * (x - beacon.x), beacon.y + short * (y - beacon.y))


def _first_walls(lab: Lab, beacon: Beacon) -> Floats:
    """Compute the distance from a beacon to the first wall that hides it, in each of `_RAYS` directions."""
    walls = hiding_walls(lab, beacon.height)
    width = 2.0 * math.pi / _RAYS
    to_x, to_y = walls.start[:, 0] - beacon.x, walls.start[:, 1] - beacon.y
    from_angle = np.arctan2(to_y, to_x)
    span = _wrap(np.arctan2(walls.end[:, 1] - beacon.y, walls.end[:, 0] - beacon.x) - from_angle)
    low = np.ceil(np.minimum(from_angle, from_angle + span) / width).astype(np.int64)
    high = np.floor(np.maximum(from_angle, from_angle + span) / width).astype(np.int64)
    across = to_x * walls.edge[:, 1] - to_y * walls.edge[:, 0]
    first = np.full(_RAYS, np.inf)
    for face in np.flatnonzero((high >= low) & (np.abs(across) > _NEAR * walls.length)):
        rays = np.arange(low[face], high[face] + 1)
        slope = np.cos(rays * width) * walls.edge[face, 1] - np.sin(rays * width) * walls.edge[face, 0]
        rays %= _RAYS
        first[rays] = np.minimum(first[rays], across[face] / slope)
    return first


def beacon_table(lab: Lab, lattice: Lattice, number: int) -> BeaconTable:
    """Tabulate a beacon; once for a lattice.

    Parameters
    ----------
    lab : Lab
    lattice : Lattice
    number : int
        Number of the beacon.

    Returns
    -------
    BeaconTable
    """
    known: BeaconTable | None = lattice.kept.get((lab, number))
    if known is None:
        known = lattice.kept[lab, number] = _tabulate(lab, lattice, number)
    return known


def _tabulate(lab: Lab, lattice: Lattice, number: int) -> BeaconTable:
    beacon = lab.beacons[number]
    x, y = lattice.representative.T
    angle, distance = np.arctan2(y - beacon.y, x - beacon.x), np.hypot(beacon.x - x, beacon.y - y)
    # Rays from the beacon in fixed directions, as one line of sight a square would take too long.
    ray = np.round(angle / (2.0 * math.pi) * _RAYS).astype(np.int64) % _RAYS
    seen = np.append(distance <= _first_walls(lab, beacon)[ray], False)
    # The part of a square: from how many of it and its neighbours the beacon is seen, where they are free.
    total, free = np.zeros(lattice.size), np.zeros(lattice.size)
    for row in lattice.move_table(1):
        total += seen[row]
        free += row < lattice.size
    seen_class = np.round(total / free * (len(_SEEN) - 1)).astype(np.int64)
    spread = lattice.resolution / math.sqrt(6.0) / np.maximum(distance, 1e-3)
    spread_class = np.searchsorted(_SPREADS[:-1], spread)
    step = np.round((angle + math.pi) / _STEP).astype(np.int64) % _AROUND
    classes = spread_class * len(_SEEN) + seen_class
    shares = np.bincount(classes, minlength=_CLASSES) / max(lattice.size, 1)
    return BeaconTable(codes=classes * 2 * _AROUND + step, shares=shares)


class BeaconSense:
    """The likelihood of beacon readings.

    Parameters
    ----------
    lab : Lab
    noise : float
        Standard deviation of an angle in degrees (BeaconNoise).
    aperture : float
        Half angle within which beacons are seen, in radians (BeaconAperture).
    """

    def __init__(self, lab: Lab, noise: float, aperture: float) -> None:
        self._lab = lab
        self._noise = math.radians(noise)
        self._aperture = aperture

    def weigh(self, belief: PoseBelief, readings: tuple[BeaconReading, ...], exponent: float) -> float | None:
        """Multiply a belief by the likelihood of readings; it is not normalized.

        Parameters
        ----------
        belief : PoseBelief
        readings : tuple of BeaconReading
        exponent : float
            Power to which the likelihoods are raised.

        Returns
        -------
        float or None
            Natural logarithm of the likelihood that is to be expected of a pose anywhere; None if there is
            nothing to weigh.
        """
        elsewhere = None
        for reading in readings:
            if not 0 <= reading.beacon < len(self._lab.beacons):
                continue
            table = beacon_table(self._lab, belief.lattice, reading.beacon)
            likelihood = self.likelihood(reading.bearing, belief.heading_offset) ** exponent
            _multiply(belief, table.codes, likelihood.astype(np.float32))
            if belief.lattice.whole is not None:
                table = beacon_table(self._lab, belief.lattice.whole, reading.beacon)
            mean = float(table.shares @ likelihood.mean(axis=1))
            elsewhere = (elsewhere or 0.0) + math.log(max(mean, 1e-30))
        return elsewhere

    def likelihood(self, bearing: float | None, heading_offset: float) -> Floats:
        """Tabulate the likelihood of a reading, scaled to 1 at most where the beacon is seen well.

        Parameters
        ----------
        bearing : float or None
            Degrees from the robot's heading; None: not visible.
        heading_offset : float
            Radians that the robot's heading is ahead of multiples of 5 degrees.

        Returns
        -------
        array, shape (classes, steps)
            By class of the square, and by the absolute angle to the beacon less the bin's nominal heading.
        """
        angle = np.asarray(np.arange(_AROUND) * _STEP - heading_offset, np.float64)
        bin_width = math.radians(5.0)
        base = self._noise**2 + (math.radians(1.0) ** 2 + 2.0 * bin_width**2) / 12.0
        seen = np.clip(_SEEN, _OUTLIER, 1.0 - _OUTLIER)
        result = np.empty((len(_SPREADS), len(_SEEN), _AROUND))
        for row, spread in enumerate(_SPREADS):
            deviation = math.sqrt(base + float(spread) ** 2)
            if bearing is None:
                shown = self._within_aperture(angle, deviation)
                result[row] = 1.0 - seen[:, np.newaxis] * shown
            else:
                off = _wrap(angle - math.radians(bearing))
                density = math.sqrt(base) / deviation * np.exp(-0.5 * (off / deviation) ** 2)
                result[row] = seen[:, np.newaxis] * np.maximum(density, 1e-3)
        return result.reshape(_CLASSES, _AROUND)

    def _within_aperture(self, angle: Floats, deviation: float) -> Floats:
        if self._aperture >= math.pi - 1e-3:
            return np.ones(len(angle))
        off = np.abs(_wrap(angle))
        # The logistic distribution in place of the normal one: near enough, and it needs no special function.
        beyond = (off - self._aperture) / (0.55 * deviation)
        return np.asarray(1.0 / (1.0 + np.exp(np.clip(beyond, -50.0, 50.0))))

    def score(self, poses: Floats, readings: tuple[BeaconReading, ...]) -> Floats:
        """Return how well poses explain readings.

        Parameters
        ----------
        poses : array, shape (n, 3)
            Units and radians.
        readings : tuple of BeaconReading

        Returns
        -------
        array, shape (n,)
            Natural logarithms of likelihoods, bounded below.
        """
        total = np.zeros(len(poses))
        variance = self._noise**2 + (3.0 * math.radians(1.0)) ** 2
        for reading in readings:
            if not 0 <= reading.beacon < len(self._lab.beacons):
                continue
            beacon = self._lab.beacons[reading.beacon]
            seen = visible(self._lab, beacon, poses[:, 0], poses[:, 1])
            to_x, to_y = beacon.x - poses[:, 0], beacon.y - poses[:, 1]
            angle = _wrap(np.arctan2(to_y, to_x) - poses[:, 2])
            if reading.bearing is None:
                total -= 2.0 * (seen & (np.abs(angle) < self._aperture))
                continue
            off = _wrap(angle - math.radians(reading.bearing))
            near = (_POSE_ERROR / np.maximum(np.hypot(to_x, to_y), _POSE_ERROR)) ** 2
            total -= np.where(seen, np.minimum(0.5 * off**2 / (variance + near), 6.0), 6.0)
        return total


def _multiply(belief: PoseBelief, codes: Codes, likelihood: NDArray[np.float32]) -> None:
    """Multiply each state by the likelihood at its square's angle less its bin's heading."""
    flat = np.concatenate([likelihood, likelihood], axis=1).ravel()
    per_bin = _AROUND // belief.bins
    ahead = -per_bin * np.arange(belief.bins) % _AROUND
    if belief.dense is None:
        belief.weight *= flat[codes[belief.square] + ahead[belief.bin]]
        return
    taken = np.empty(belief.lattice.size, np.float32)
    for row, first in enumerate(ahead):
        flat[first:].take(codes, out=taken, mode="clip")
        belief.dense[row, :-1] *= taken


def _wrap(angles: Floats) -> Floats:
    return np.asarray(np.remainder(angles + math.pi, 2.0 * math.pi) - math.pi)
