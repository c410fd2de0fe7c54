"""The IR sensors: what distance one takes, what it reads, and how likely a reading is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Booleans, Floats
from ciberrato.geometry.angles import wrap_once
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.cone_pairs import HALF_APERTURE, cone_distances
from ciberrato.infrared.cone_scalar import single_cone_distances
from ciberrato.physics.kinematics import ROBOT_RADIUS, wrap_angle
from ciberrato.world.lab import CELL_SIZE, Lab

__all__ = [
    "CONTACT",
    "HALF_APERTURE",
    "SATURATION",
    "SENSOR_OFFSET",
    "cell_centres",
    "cell_openings",
    "cell_readings",
    "distances_at",
    "ideal_reading",
    "nearest_in_cone",
    "other_robot_distance",
    "reading_log_likelihood",
    "round_reading",
    "sensor_distances",
]


SENSOR_OFFSET = 0.5
"""Units from the robot's centre to each sensor."""
SATURATION = 100.0
"""Reading of a sensor at `CONTACT` and below."""
CONTACT = 0.01
"""Units; at this distance and below a reading saturates."""
HALF_STEP = 0.05
"""Readings are rounded to twice that."""


def sensor_distances(walls: WallMap, x: ArrayLike, y: ArrayLike, direction: ArrayLike) -> Floats:
    """Compute the distance that an IR sensor measures: the least of three rays and the corners in its cone.

    The rays go along the axis and along both edges of the cone. A corner in the cone counts even if it is
    hidden behind a wall, as in the real simulator.

    Parameters
    ----------
    walls : WallMap
    x, y : array_like, broadcastable
        Centre of the robot, in units.
    direction : array_like, broadcastable
        Axis of the sensor in the lab's frame, in radians.

    Returns
    -------
    array
        Units from the sensor, which is mounted `SENSOR_OFFSET` from the centre; shape as broadcast.
        Infinite where no wall is seen. Equal to the real simulator's distance within 1e-13.
    """
    return _cone_distances(walls, x, y, direction, every_point=False)


def nearest_in_cone(walls: WallMap, x: ArrayLike, y: ArrayLike, direction: ArrayLike) -> Floats:
    """Compute the distance of the nearest wall point anywhere in the sensor's cone of 60 degrees.

    Parameters and result are those of `sensor_distances`, which it never exceeds, and which it equals where
    walls and sensor are aligned. A sensor that lies on a face is at distance 0.
    """
    return _cone_distances(walls, x, y, direction, every_point=True)


def _cone_distances(
    walls: WallMap, x: ArrayLike, y: ArrayLike, direction: ArrayLike, *, every_point: bool
) -> Floats:
    px, py, axis = np.broadcast_arrays(
        np.asarray(x, np.float64), np.asarray(y, np.float64), np.asarray(direction, np.float64)
    )
    wrapped = wrap_angle(axis.reshape(-1))
    sensor_x = px.reshape(-1) + SENSOR_OFFSET * np.cos(wrapped)
    sensor_y = py.reshape(-1) + SENSOR_OFFSET * np.sin(wrapped)
    distances = cone_distances(walls, sensor_x, sensor_y, wrapped, every_point=every_point)
    return distances.reshape(axis.shape)


def distances_at(walls: WallMap, x: float, y: float, directions: Iterable[float]) -> list[float]:
    """Compute the distances that one robot's sensors measure: `sensor_distances`, fast for a few sensors.

    Parameters
    ----------
    walls : WallMap
    x, y : float
        Centre of the robot, in units.
    directions : iterable of float
        Axes of the sensors in the lab's frame, in radians.

    Returns
    -------
    list of float
        Units from each sensor; infinite where no wall is seen. Equal to `sensor_distances` within 1e-12.
    """
    return single_cone_distances(walls, x, y, directions, SENSOR_OFFSET)


def other_robot_distance(x: float, y: float, direction: float, other_x: float, other_y: float) -> float:
    """Compute the distance at which an IR sensor sees another robot, a disc that no wall hides.

    With D and δ the distance and the angle off the axis of the other's centre: D - r within the cone; up to
    asin(r/D) beside it, the distance of the disc along the edge of the cone.

    Parameters
    ----------
    x, y : float
        Centre of the robot with the sensor, in units.
    direction : float
        Axis of the sensor in the lab's frame, in radians.
    other_x, other_y : float
        Centre of the other robot.

    Returns
    -------
    float
        Units from the sensor; infinite where the other is not seen, 0 where the sensor is inside it.
    """
    axis = wrap_once(direction)
    dx = other_x - (x + SENSOR_OFFSET * math.cos(axis))
    dy = other_y - (y + SENSOR_OFFSET * math.sin(axis))
    distance = math.sqrt(dx * dx + dy * dy)
    if distance <= ROBOT_RADIUS:
        return 0.0
    aside = abs(wrap_once(math.atan2(dy, dx) - axis)) - HALF_APERTURE
    if aside <= 0.0:
        return distance - ROBOT_RADIUS
    if aside > math.asin(ROBOT_RADIUS / distance):
        return math.inf
    across = distance * math.sin(aside)
    return distance * math.cos(aside) - math.sqrt(max(0.0, ROBOT_RADIUS * ROBOT_RADIUS - across * across))


@overload
def ideal_reading(distance: float) -> float: ...
@overload
def ideal_reading(distance: Floats | Sequence[float]) -> Floats: ...
def ideal_reading(distance: ArrayLike) -> float | Floats:
    """Convert a distance to the reading of a sensor without noise and rounding: 1/distance, saturated.

    Parameters
    ----------
    distance : float or array_like
        Units; infinite where nothing is seen.

    Returns
    -------
    float or array
        1/units, at most `SATURATION`; that where the distance is at most `CONTACT`, and where nothing
        is seen.
    """
    if isinstance(distance, float):
        return 1.0 / distance if CONTACT < distance < math.inf else SATURATION
    distance = np.asarray(distance, np.float64)
    usable = (distance > CONTACT) & (distance < np.inf)
    return np.asarray(np.where(usable, 1.0 / np.where(usable, distance, 1.0), SATURATION))


@overload
def round_reading(value: float) -> float: ...
@overload
def round_reading(value: Floats | Sequence[float]) -> Floats: ...
def round_reading(value: ArrayLike) -> float | Floats:
    """Round as the simulator does: to the nearest multiple of 0.1, half way upwards.

    Parameters
    ----------
    value : float or array_like

    Returns
    -------
    float or array
    """
    if isinstance(value, float):
        return math.floor(10.0 * value + 0.5) / 10.0
    return np.asarray(np.floor(10.0 * np.asarray(value, np.float64) + 0.5) / 10.0)


def reading_log_likelihood(reading: ArrayLike, ideal: ArrayLike, sigma: ArrayLike) -> Floats:
    """Compute the logarithm of the probability that a sensor reports a reading.

    The sensor adds Gaussian noise to its ideal reading and rounds the sum to 0.1, so the report r has the
    probability that the sum falls in [r - 0.05, r + 0.05).

    Parameters
    ----------
    reading : array_like
        Reported reading.
    ideal : array_like
        `ideal_reading` of the distance.
    sigma : array_like
        Standard deviation of the noise, ObstacleNoise; not negative.

    Returns
    -------
    array
        Shape as broadcast. With sigma 0 it is 0 where the rounded ideal is the reading, -inf elsewhere.
    """
    from ciberrato.bayes.sensors.normal import log_interval  # which a simulator has no use for

    reading, ideal, sigma = np.broadcast_arrays(
        np.asarray(reading, np.float64), np.asarray(ideal, np.float64), np.asarray(sigma, np.float64)
    )
    noisy = sigma > 0.0
    scale = np.where(noisy, sigma, 1.0)
    deviation = reading - ideal
    log_mass = log_interval(
        (deviation - HALF_STEP) / scale,
        (deviation + HALF_STEP) / scale,
    )
    exact = np.abs(round_reading(np.asarray(ideal)) - reading) < HALF_STEP
    return np.asarray(np.where(noisy, log_mass, np.where(exact, 0.0, -np.inf)))


def cell_centres(lab: Lab) -> Floats:
    """Return the centres of all cells of a lab.

    Parameters
    ----------
    lab : Lab

    Returns
    -------
    array, shape (rows, columns, 2)
        x and y in units; row 0 is the bottom row.
    """
    x = CELL_SIZE * (np.arange(lab.columns) + 0.5)
    y = CELL_SIZE * (np.arange(lab.rows) + 0.5)
    return np.stack(np.meshgrid(x, y), axis=-1)


def cell_readings(
    lab: Lab,
    angles_deg: ArrayLike,
    heading: float = 0.0,
    model: Literal["sensor", "cone"] = "sensor",
    offsets: ArrayLike | None = None,
) -> Floats:
    """Compute the ideal readings of a robot at the centre of every cell.

    Parameters
    ----------
    lab : Lab
    angles_deg : array_like, shape (sensors,)
        Mounting angles in degrees.
    heading : float
        Heading of the robot in radians.
    model : {"sensor", "cone"}
        Distance by `sensor_distances` or by `nearest_in_cone`.
    offsets : array_like, shape (k, 3), or None
        Poses relative to the centre and heading: x and y in units, heading in radians.

    Returns
    -------
    array, shape (rows, columns, sensors), or (k, rows, columns, sensors) with offsets
        1/units; row 0 is the bottom row.
    """
    walls = WallMap.from_lab(lab)
    centres = cell_centres(lab)[:, :, np.newaxis, :]
    directions = heading + np.deg2rad(np.asarray(angles_deg, np.float64))
    x, y = centres[..., 0], centres[..., 1]
    if offsets is not None:
        poses = np.asarray(offsets, np.float64).reshape(-1, 1, 1, 1, 3)
        x, y, directions = x + poses[..., 0], y + poses[..., 1], directions + poses[..., 2]
    distances = sensor_distances if model == "sensor" else nearest_in_cone
    return ideal_reading(distances(walls, x, y, directions))


def cell_openings(lab: Lab) -> tuple[Booleans, Booleans]:
    """Return between which neighbouring cells a robot can drive from centre to centre.

    Parameters
    ----------
    lab : Lab

    Returns
    -------
    east : array of bool, shape (rows, columns - 1)
        Whether no wall stops a straight drive from a cell to the one on its right; row 0 is the bottom row.
    north : array of bool, shape (rows - 1, columns)
        The same for the cell above.
    """
    walls = WallMap.from_lab(lab)
    centres = cell_centres(lab)
    x, y = centres[..., 0], centres[..., 1]
    east = walls.obstructs(x[:, :-1], y[:, :-1], x[:, 1:], y[:, 1:], ROBOT_RADIUS)
    north = walls.obstructs(x[:-1], y[:-1], x[1:], y[1:], ROBOT_RADIUS)
    return ~east, ~north
