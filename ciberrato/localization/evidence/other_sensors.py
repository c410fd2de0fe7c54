"""Likelihoods of sensors other than IR."""

from __future__ import annotations

import math

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters


def sensors_used(lab: Lab, parameters: Parameters) -> tuple[str, ...]:
    """List the sensors that the pose filter uses.

    Parameters
    ----------
    lab : Lab
    parameters : Parameters
        As announced.

    Returns
    -------
    tuple of str
    """
    kinds = {
        "infrared": True,
        "compass": parameters.compass_sensor,
        "GPS": parameters.gps,
        "beacons": parameters.beacon_sensor and bool(lab.beacons),
        "ground": bool(lab.targets),
        "collision": True,
    }
    return tuple(kind for kind, used in kinds.items() if used)


def compass_log_likelihood(belief: PoseBelief, degrees: float, noise: float) -> Floats:
    """Return the logarithm of the likelihood of a compass reading for every bin, less the greatest.

    Parameters
    ----------
    belief : PoseBelief
    degrees : float
        As reported, rounded to whole degrees.
    noise : float
        Standard deviation in degrees (CompassNoise).

    Returns
    -------
    array, shape (bins,)
        A normal distribution, widened by the rounding and by the bin.
    """
    difference = np.remainder(np.rad2deg(belief.headings()) - degrees + 180.0, 360.0) - 180.0
    width = math.degrees(belief.bin_width)
    variance = noise**2 + (1.0 + 2.0 * width**2) / 12.0
    density = np.exp(-0.5 * difference**2 / variance) + 1e-4
    return np.asarray(np.log(density / density.max()))


def weigh_collision(belief: PoseBelief, way: float, exponent: float) -> None:
    """Weigh the states by their distance to a wall in the direction of a collision.

    Parameters
    ----------
    belief : PoseBelief
    way : float
        Units that the robot wanted to drive.
    exponent : float
        Power to which the likelihood is raised.
    """
    lattice = belief.lattice
    bins, squares, _ = belief.listed()
    headings = belief.headings()
    step = np.stack([np.cos(headings), np.sin(headings)], axis=1) * math.copysign(1.0, way)
    ahead = np.round(belief.offset / lattice.resolution + step).astype(np.int64)[bins]
    target = lattice.index[lattice.site[squares] + ahead[:, 1] * lattice.nx + ahead[:, 0]]
    beyond = (lattice.padded_clearance[target] - ROBOT_RADIUS - 0.05) / (0.5 * lattice.resolution)
    touching = 0.02 + 0.98 / (1.0 + np.exp(np.minimum(beyond, 50.0)))
    factor = (touching**exponent).astype(np.float32)
    if belief.dense is None:
        belief.weight *= factor
    else:
        belief.dense[bins, squares] *= factor
    belief.normalize()


class GroundSensor:
    """Model of the ground sensor: whether the robot is inside a target.

    Parameters
    ----------
    lab : Lab
    belief : PoseBelief
    """

    def __init__(self, lab: Lab, belief: PoseBelief) -> None:
        lattice = belief.lattice
        rows = []
        for target in lab.targets:
            distance = np.hypot(lattice.x - target.x, lattice.y - target.y)
            beyond = (distance - (target.radius - ROBOT_RADIUS)) / (0.4 * lattice.resolution)
            rows.append(1.0 / (1.0 + np.exp(np.clip(beyond, -50.0, 50.0))))
        self._inside = np.array(rows).reshape(-1, lattice.size)
        self._outside = 1.0 - self._inside.max(axis=0, initial=0.0)
        self._near = np.flatnonzero(self._outside < 0.999)
        # A part of a lab without targets is weighed, and rounded, like the others.
        self._tells = bool(rows) and (lattice.whole is not None or len(self._near) > 0)

    def weigh(self, belief: PoseBelief, target: int, exponent: float) -> None:
        """Weigh the states by a report.

        Parameters
        ----------
        belief : PoseBelief
        target : int
            Number of the target, -1 for none.
        exponent : float
        """
        if target >= len(self._inside) or not self._tells:
            return
        factor = self._inside[target] if target >= 0 else self._outside
        values = (np.maximum(factor, 0.02) ** exponent).astype(np.float32)
        if belief.dense is None:
            belief.weight *= values[belief.square]
        elif target >= 0:
            belief.dense[:, :-1] *= values
        else:
            belief.dense[:, self._near] *= values[self._near]
        belief.normalize()
