r"""Range beams judged by how near their ends are to an obstacle.

.. math:: \log p(z | x) = \sum_k \log\left( w_{hit}\, N(d(x, z_k); 0, \sigma^2) + w_{rand} / z_{max} \right)

with d the distance from the beam's end to the nearest obstacle. Readings of z_max say nothing. A beam that
ends in a cell of which it is not known whether it is full has the density 1 / z_max, whatever the distance.
Needs no ray casting and is smooth in the pose, but sees through walls. Probabilistic Robotics, section 6.4,
table 6.3; cells that are not explored: section 6.4.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import finite_array, positive, range_array, refuse_map, same_length
from ciberrato.bayes.maps.occupancy import OccupancyGrid
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelihoodField:
    """Parameters.

    Attributes
    ----------
    hit, random : float
        Weights, 0 or more, summing to 1.
    sigma : float
        Standard deviation of the distance, in units of length.
    max_range : float
        Readings of at least this, +inf among them, are left out.
    """

    __repr__ = short_repr

    hit: float
    random: float
    sigma: float
    max_range: float

    def __post_init__(self) -> None:
        if not (min(self.hit, self.random) >= 0.0 and abs(self.hit + self.random - 1.0) <= 1e-9):
            raise ValueError(f"weights must be 0 or more and sum to 1, not {self.hit}, {self.random}")
        positive(self.sigma, what="sigma")
        positive(self.max_range, what="max_range")

    def log_likelihood(
        self, reading: ArrayLike, angles: ArrayLike, poses: ArrayLike, field: FloatArray, grid: OccupancyGrid
    ) -> FloatArray:
        """Compute log p(scan | pose).

        Parameters
        ----------
        reading, angles : array_like, shape (beams,)
            Ranges, and directions relative to the heading in radians; nan where missing.
        poses : array_like, shape (..., 3)
            x, y, heading.
        field : FloatArray
            `grid.distance_field()`.
        grid : OccupancyGrid
            The map it was made of. Beams that end off the map count as at its nearest cell.

        Returns
        -------
        FloatArray, shape (...)

        Raises
        ------
        ValueError
            If a range is negative, a pose, an angle or the field is none, or the shapes do not fit.
        """
        reading = np.atleast_1d(range_array(reading))
        angles = np.atleast_1d(np.asarray(angles, dtype=float))
        same_length(ranges=reading, angles=angles)
        poses = finite_array(poses, what="poses")
        if not poses.ndim or poses.shape[-1] != 3:
            raise ValueError(f"poses need x, y and heading in the last axis, not shape {poses.shape}")
        field = np.asarray(field, dtype=float)
        if field.shape != grid.occupied.shape:
            raise ValueError(f"the field has shape {field.shape}, the map {grid.occupied.shape}")
        if np.isnan(field).any():
            refuse_map(np.isnan(field), what="distance field")
        used = reading < self.max_range  # not nan either
        finite_array(angles[used], what="angles of beams with a reading")
        total = np.zeros(poses.shape[:-1])
        scale = self.hit / (self.sigma * math.sqrt(2.0 * math.pi))
        rows, columns = field.shape
        some_unknown = bool(grid.unknown.any())
        for z, angle in zip(reading[used], angles[used], strict=True):
            direction = poses[..., 2] + angle
            i = np.floor((poses[..., 0] + z * np.cos(direction) - grid.origin[0]) / grid.cell).astype(np.intp)
            j = np.floor((poses[..., 1] + z * np.sin(direction) - grid.origin[1]) / grid.cell).astype(np.intp)
            i, j = np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)
            distance = field[i, j]
            score = -0.5 * np.square(distance / self.sigma)
            if self.random > 0.0:
                # Below -700 the exponential would be a denormal number, far under the random part.
                density = np.log(scale * np.exp(np.maximum(score, -700.0)) + self.random / self.max_range)
            else:
                density = math.log(scale) + score
            if some_unknown:
                density = np.where(grid.unknown[i, j], -math.log(self.max_range), density)
            total += density
        return total
