"""The IR sensors: what distance one takes, what it reads, and how likely a reading is."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.gaussian import log_interval_mass
from ciberrato.geometry import WallMap
from ciberrato.kinematics import ROBOT_RADIUS
from ciberrato.lab import CELL_SIZE, Lab

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

SENSOR_OFFSET = 0.5
"""Units from the robot's centre to each sensor."""
HALF_APERTURE = math.pi / 6
"""Radians from the sensor's axis to the edge of its cone."""
SATURATION = 100.0
"""What a sensor reads at `CONTACT` and below."""
CONTACT = 0.01
"""Units; at this distance and below a reading saturates."""

_BLOCK = 64
_TOUCH = 1e-9


def sensor_distances(walls: WallMap, x: ArrayLike, y: ArrayLike, direction: ArrayLike) -> Floats:
    """Distance that an IR sensor takes: the least of three rays and of the corners in its cone.

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
        Units from the sensor, shape as broadcast; infinite where no wall is seen.
    """
    return _evaluate(walls, x, y, direction, cone=False)


def nearest_in_cone(walls: WallMap, x: ArrayLike, y: ArrayLike, direction: ArrayLike) -> Floats:
    """Distance of the nearest wall point in the sensor's cone of 60 degrees.

    Parameters and result are those of `sensor_distances`.
    """
    return _evaluate(walls, x, y, direction, cone=True)


def _evaluate(walls: WallMap, x: ArrayLike, y: ArrayLike, direction: ArrayLike, *, cone: bool) -> Floats:
    px, py, theta = np.broadcast_arrays(
        np.asarray(x, np.float64), np.asarray(y, np.float64), np.asarray(direction, np.float64)
    )
    shape = px.shape
    theta = theta.reshape(-1)
    cosine, sine = np.cos(theta), np.sin(theta)
    sx = px.reshape(-1) + SENSOR_OFFSET * cosine
    sy = py.reshape(-1) + SENSOR_OFFSET * sine
    result = np.empty(theta.size)
    for low in range(0, theta.size, _BLOCK):
        part = slice(low, low + _BLOCK)
        result[part] = _block(
            walls,
            sx[part, np.newaxis],
            sy[part, np.newaxis],
            cosine[part, np.newaxis],
            sine[part, np.newaxis],
            cone,
        )
    return result.reshape(shape)


def _block(walls: WallMap, sx: Floats, sy: Floats, cosine: Floats, sine: Floats, cone: bool) -> Floats:
    ax, ay = walls.start[:, 0] - sx, walls.start[:, 1] - sy
    bx, by = walls.end[:, 0] - sx, walls.end[:, 1] - sy
    ux, uy = walls.direction.T
    side = ax * uy - ay * ux
    best = np.full(sx.shape[0], np.inf)
    c30, s30 = math.cos(HALF_APERTURE), math.sin(HALF_APERTURE)
    for c, s in (
        (cosine, sine),
        (cosine * c30 - sine * s30, sine * c30 + cosine * s30),
        (cosine * c30 + sine * s30, sine * c30 - cosine * s30),
    ):
        slope = c * uy - s * ux
        crossing = (c * ay - s * ax) * (c * by - s * bx) <= 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            t = side / slope
        hit = crossing & (np.abs(slope) > _TOUCH) & (t >= -_TOUCH)
        np.minimum(best, np.where(hit, t, np.inf).min(axis=1, initial=np.inf), out=best)
    if cone:
        along = -(ax * ux + ay * uy)
        facing = np.where(side >= 0.0, cosine * uy - sine * ux, sine * ux - cosine * uy)
        foot = (along >= 0.0) & (along <= walls.length) & (facing >= c30 - _TOUCH)
        np.minimum(best, np.where(foot, np.abs(side), np.inf).min(axis=1, initial=np.inf), out=best)
    dx, dy = walls.corners[:, 0] - sx, walls.corners[:, 1] - sy
    forward = dx * cosine + dy * sine
    sideways = np.abs(dy * cosine - dx * sine)
    seen = sideways <= forward * math.tan(HALF_APERTURE) + _TOUCH
    corner = np.where(seen, np.sqrt(dx * dx + dy * dy), np.inf).min(axis=1, initial=np.inf)
    return np.asarray(np.maximum(np.minimum(best, corner), 0.0))


def ideal_reading(distance: ArrayLike) -> Floats:
    """Turn a distance into the reading of a sensor without noise and rounding: 1/distance, saturated.

    Parameters
    ----------
    distance : array_like
        Units; infinite where nothing is seen.

    Returns
    -------
    array
        1/units, at most `SATURATION`; that where the distance is at most `CONTACT`, and where nothing
        is seen.
    """
    distance = np.asarray(distance, np.float64)
    usable = (distance > CONTACT) & (distance < np.inf)
    return np.asarray(np.where(usable, 1.0 / np.where(usable, distance, 1.0), SATURATION))


def round_reading(value: ArrayLike) -> Floats:
    """Round as the simulator does: to the nearest multiple of 0.1, half way upwards."""
    return np.asarray(np.floor(10.0 * np.asarray(value, np.float64) + 0.5) / 10.0)


def reading_log_likelihood(reading: ArrayLike, ideal: ArrayLike, sigma: ArrayLike) -> Floats:
    """Logarithm of the probability that a sensor reports a reading.

    The sensor adds Gaussian noise to its ideal reading and rounds the sum to 0.1, so the report r has the
    probability that the sum falls in [r - 0.05, r + 0.05).

    Parameters
    ----------
    reading : array_like
        What the sensor reported.
    ideal : array_like
        `ideal_reading` of the distance.
    sigma : array_like
        Standard deviation of the noise, ObstacleNoise; not negative.

    Returns
    -------
    array
        Shape as broadcast. With sigma 0 it is 0 where the rounded ideal is the reading, -inf elsewhere.
    """
    reading, ideal, sigma = np.broadcast_arrays(
        np.asarray(reading, np.float64), np.asarray(ideal, np.float64), np.asarray(sigma, np.float64)
    )
    noisy = sigma > 0.0
    scale = np.where(noisy, sigma, 1.0)
    deviation = reading - ideal
    log_mass = log_interval_mass((deviation - 0.05) / scale, (deviation + 0.05) / scale)
    exact = np.abs(round_reading(ideal) - reading) < 0.05
    return np.asarray(np.where(noisy, log_mass, np.where(exact, 0.0, -np.inf)))


def cell_centres(lab: Lab) -> Floats:
    """Centres of all cells of a lab.

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
    """Ideal readings of a robot at the centre of every cell.

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
    """Between which neighbouring cells a robot can drive from centre to centre.

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
    east = walls.clearance(x[:, :-1], y[:, :-1], x[:, 1:], y[:, 1:])
    north = walls.clearance(x[:-1], y[:-1], x[1:], y[1:])
    return east >= ROBOT_RADIUS - _TOUCH, north >= ROBOT_RADIUS - _TOUCH
