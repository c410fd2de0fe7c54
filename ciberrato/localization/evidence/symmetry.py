"""Labs that look the same turned round: what a claim of the filter is worth there.

Competition labs are often built to be fair to several robots: turned by half or a third of a circle, what
a robot sees of them is the same, at least far from the border. A robot without a compass cannot know in
which of the equal places it is, but a filter on a square lattice comes to prefer one of them, as the
lattice does not look the same turned by 120 degrees. So the turns under which much of the lab looks the
same are looked for beforehand, and the estimate's probability is shared with its turned images, except
for those that the readings have distinguished since the estimate is where it is: by walls that are not the
same after all, by the border, a target, or the compass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, sensor_distances
from ciberrato.localization.belief.lattice import distances_to_walls
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.reprs import short_repr
from ciberrato.world.coordinates import Pose
from ciberrato.world.lab import Lab

if TYPE_CHECKING:
    from ciberrato.localization.evidence.beacons import BeaconSense
    from ciberrato.protocol.messages import BeaconReading

_PARTS = (2, 3, 4, 5, 6, 8)
_EQUAL = 0.02  # units; files give corners to some decimals only
_MUCH = 0.12  # of the free places, that must look the same
_PLACES = 300
_DIRECTIONS = 12
_DECIDED = 20.0  # evidence (natural logarithm) beyond which nothing needs to be counted
_SLIP = 0.5  # units from where dead reckoning expects it: then the estimate is another one


@dataclass(frozen=True, slots=True)
class Turn:
    """A rotation of the lab.

    Attributes
    ----------
    x, y : float
        Centre, in units.
    angle : float
        Radians.
    """

    __repr__ = short_repr

    x: float
    y: float
    angle: float

    def apply(self, pose: Pose) -> Pose:
        """Turn a pose with the lab."""
        x, y, heading = pose
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        dx, dy = x - self.x, y - self.y
        return self.x + cosine * dx - sine * dy, self.y + sine * dx + cosine * dy, heading + self.angle


def find_turns(lab: Lab, walls: WallMap, places: Floats, resolution: float) -> list[Turn]:
    """Find the rotations under which much of a lab looks the same.

    Parameters
    ----------
    lab : Lab
    walls : WallMap
        Walls that reflect IR.
    places : array, shape (n, 2)
        Free places, spread evenly over the lab, in units.
    resolution : float
        Resolution of the filter's lattice. Turns that leave its nodes in place are left out.

    Returns
    -------
    list of Turn
        Without the turn by nothing.
    """
    some = places[:: max(len(places) // _PLACES, 1)]
    # The filter treats nodes that take each other's places alike by itself.
    turns = [turn for turn in possible_turns(lab, walls) if not _keeps_nodes(turn, resolution)]
    both = [each for turn in turns for each in (turn, Turn(turn.x, turn.y, 2.0 * math.pi - turn.angle))]
    # All at once: a point more costs little then.
    moved = [_moved(each, some) for each in both]
    everywhere = distances_to_walls(walls, np.concatenate([some, *moved]), tile=4.0)
    here, *there = np.split(everywhere, len(both) + 1)
    alike = [
        _share_alike(each, walls, (some, here), after) >= _MUCH
        for each, after in zip(both, zip(moved, there, strict=True), strict=True)
    ]
    return [turn for number, turn in enumerate(turns) if alike[2 * number] or alike[2 * number + 1]]


def possible_turns(lab: Lab, walls: WallMap) -> list[Turn]:
    """List the turns that are worth looking at: about the lab's centre, and about that of its corners."""
    centres = {(lab.width / 2.0, lab.height / 2.0), tuple(np.round(walls.start.mean(axis=0), 2).tolist())}
    angles = sorted({part / parts for parts in _PARTS for part in range(1, parts)})
    return [Turn(x, y, 2.0 * math.pi * angle) for x, y in sorted(centres) for angle in angles]


def _keeps_nodes(turn: Turn, resolution: float) -> bool:
    if abs(turn.angle - math.pi) > 1e-9:
        return False
    # Nodes are at whole steps from 1; half a turn about c takes p to 2 c - p.
    steps = (2.0 * np.array([turn.x, turn.y]) - 2.0) / resolution
    return bool(np.abs(steps - np.round(steps)).max() < 1e-6)


def share_alike(turn: Turn, walls: WallMap, places: Floats) -> float:
    """Compute the share of places from which a lab looks the same after a turn.

    Parameters
    ----------
    turn : Turn
    walls : WallMap
        Walls that reflect IR.
    places : array, shape (n, 2)
        Units.

    Returns
    -------
    float
        From 0 to 1; 0 where it is surely less than what matters to the filter.
    """
    moved = _moved(turn, places)
    return _share_alike(turn, walls, (places, walls.distance(*places.T)), (moved, walls.distance(*moved.T)))


def _moved(turn: Turn, places: Floats) -> Floats:
    cosine, sine = math.cos(turn.angle), math.sin(turn.angle)
    centre = np.array([turn.x, turn.y])
    return np.asarray((places - centre) @ np.array([[cosine, sine], [-sine, cosine]]) + centre)


def _share_alike(
    turn: Turn, walls: WallMap, before: tuple[Floats, Floats], after: tuple[Floats, Floats]
) -> float:
    """Compute `share_alike` from places and their distances to the walls, before and after the turn."""
    (places, here), (moved, there) = before, after
    alike = np.abs(here - there) < _EQUAL
    if alike.mean() < _MUCH:
        return 0.0
    total = len(places)
    places, moved = places[alike], moved[alike]
    directions = np.arange(_DIRECTIONS) * (2.0 * math.pi / _DIRECTIONS) + 0.123
    seen = sensor_distances(walls, places[:, :1], places[:, 1:], directions)
    turned = sensor_distances(walls, moved[:, :1], moved[:, 1:], directions + turn.angle)
    # Corners just inside or outside the cone make single directions differ where corners are rounded.
    with np.errstate(invalid="ignore"):  # nothing seen from a place that is no place for a robot
        same = (np.abs(seen - turned) < _EQUAL * (1.0 + seen)).mean(axis=1) > 0.8
    return float(same.sum() / total)


class PoseScore:
    """Score of poses by their explanation of the readings, by the exact sensor model.

    Parameters
    ----------
    lab : Lab
    angles : sequence of float
        Mounting angles of the IR sensors in radians.
    obstacle_noise, compass_noise : float
        As announced.
    beacons : BeaconSense or None
        Sensor model of the beacons.
    """

    def __init__(
        self,
        lab: Lab,
        angles: tuple[float, ...],
        obstacle_noise: float,
        compass_noise: float,
        beacons: BeaconSense | None = None,
    ) -> None:
        self.walls = WallMap.from_lab(lab)
        self._beacons = beacons
        self._targets = lab.targets
        self._angles = np.array(angles)
        self._noise = obstacle_noise
        self._compass_variance = (compass_noise**2 + 9.0) * math.radians(1.0) ** 2

    def __call__(
        self,
        poses: Floats,
        infrared: tuple[float | None, ...],
        compass: float | None,
        ground: int | None,
        beacons: tuple[BeaconReading, ...] = (),
    ) -> Floats:
        """Score poses.

        Parameters
        ----------
        poses : array, shape (n, 3)
            Units and radians. The first is the reference: where expected readings are equal, so are scores.
        infrared, compass, ground, beacons
            As sensed.

        Returns
        -------
        array, shape (n,)
            Natural logarithms of likelihoods, each sensor's bounded below.
        """
        score = self._infrared_score(poses, infrared)
        if compass is not None:
            off = np.remainder(poses[:, 2] - math.radians(compass) + math.pi, 2.0 * math.pi) - math.pi
            score -= np.minimum(0.5 * off**2 / self._compass_variance, 10.0)
        if ground is not None:
            score -= 3.0 * (self._grounds(poses) != ground)
        if beacons and self._beacons is not None:
            score += self._beacons.score(poses, beacons)
        score -= 10.0 * (self.walls.distance(poses[:, 0], poses[:, 1]) < ROBOT_RADIUS - 0.15)
        return score

    def _infrared_score(self, poses: Floats, infrared: tuple[float | None, ...]) -> Floats:
        taken = [number for number, reading in enumerate(infrared) if reading is not None]
        if not taken:
            return np.zeros(len(poses))
        readings = np.array([infrared[number] for number in taken], np.float64)
        directions = poses[:, 2:] + self._angles[taken]
        distances = sensor_distances(self.walls, poses[:, :1], poses[:, 1:2], directions)
        expected = np.minimum(np.asarray(ideal_reading(distances), np.float64), 20.0)
        variance = self._noise**2 + 0.001 + (0.1 * expected**2) ** 2
        # The first row's variance for all: equal expectations shall give exactly equal scores.
        misfit = 0.5 * (np.minimum(readings, 20.0) - expected) ** 2 / variance[:1]
        return np.asarray(-np.minimum(misfit, 2.0).sum(axis=1))

    def _grounds(self, poses: Floats) -> NDArray[np.int64]:
        grounds = np.full(len(poses), -1)
        for number, target in enumerate(self._targets):
            distance = np.hypot(poses[:, 0] - target.x, poses[:, 1] - target.y)
            grounds[distance <= target.radius - ROBOT_RADIUS] = number
        return grounds


class SymmetryCheck:
    """Gathers the evidence between an estimate and its turned images.

    Parameters
    ----------
    lab : Lab
    turns : list of Turn
        As of `find_turns`.
    angles : sequence of float
        Mounting angles of the IR sensors in radians.
    obstacle_noise, compass_noise : float
        As announced.
    beacons : BeaconSense or None
        Sensor model of the beacons.
    """

    def __init__(
        self,
        lab: Lab,
        turns: list[Turn],
        angles: tuple[float, ...],
        obstacle_noise: float,
        compass_noise: float,
        beacons: BeaconSense | None = None,
    ) -> None:
        self._score = PoseScore(lab, angles, obstacle_noise, compass_noise, beacons)
        self.turns = turns
        self._evidence = np.zeros(len(self.turns))
        self._last: Pose | None = None

    def observe(
        self,
        pose: Pose,
        way: float,
        infrared: tuple[float | None, ...],
        compass: float | None,
        ground: int | None,
        beacons: tuple[BeaconReading, ...] = (),
    ) -> None:
        """Compare what was sensed with what is expected of the estimate and of its images.

        Parameters
        ----------
        pose : (float, float, float)
            The estimate: units and radians.
        way : float
            Units driven since the last message.
        infrared, compass, ground, beacons
            As sensed.
        """
        if self._last is not None:
            moved = math.hypot(pose[0] - self._last[0], pose[1] - self._last[1])
            if moved > abs(way) + _SLIP:
                self._evidence[:] = 0.0
        self._last = pose
        if not self.turns or self._evidence.min() > _DECIDED:
            return
        poses = np.array([pose, *(turn.apply(pose) for turn in self.turns)])
        score = self._score(poses, infrared, compass, ground, beacons)
        gained = 0.5 * (score[0] - score[1:])
        self._evidence = np.maximum(self._evidence + np.where(np.abs(gained) > 0.02, gained, 0.0), -5.0)

    def share(self, besides: Floats | float = 0.0) -> float:
        """Return the estimate's share of its own and its images' probability.

        Parameters
        ----------
        besides : float or array, shape (turns,)
            Evidence for the estimate and against each image that was not sensed of the lab.
        """
        return float(self.shares(besides)[0])

    def shares(self, besides: Floats | float = 0.0) -> Floats:
        """Return how the estimate's and its images' probability is divided; shape (1 + turns,), of sum 1.

        Parameters
        ----------
        besides : float or array, shape (turns,)
            As of `share`.
        """
        weights = np.exp(-np.clip(self._evidence + besides, -50.0, 50.0))
        return np.asarray(np.append(1.0, weights) / (1.0 + weights.sum()))
