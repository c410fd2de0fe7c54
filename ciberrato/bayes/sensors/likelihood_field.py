r"""Range beams judged by how near their ends are to an obstacle.

.. math:: \log p(z | x) = \sum_k \log\left( w_{hit}\, N(d(x, z_k); 0, \sigma^2) + w_{rand} / z_{max} \right)

with d the distance from the beam's end to the nearest obstacle. Readings of z_max say nothing. Needs no ray
casting and is smooth in the pose, but sees through walls. Probabilistic Robotics, section 6.4, table 6.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.maps.occupancy import OccupancyGrid


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
        Readings of at least this are left out.
    """

    hit: float
    random: float
    sigma: float
    max_range: float

    def __post_init__(self) -> None:
        if min(self.hit, self.random) < 0.0 or abs(self.hit + self.random - 1.0) > 1e-9:
            raise ValueError(f"weights must be 0 or more and sum to 1, not {self.hit}, {self.random}")
        if not (self.sigma > 0.0 and self.max_range > 0.0):
            raise ValueError("sigma and the longest range must be positive")

    def log_likelihood(
        self, reading: ArrayLike, angles: ArrayLike, poses: ArrayLike, field: FloatArray, grid: OccupancyGrid
    ) -> FloatArray:
        """Give log p(scan | pose).

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
        """
        reading, angles = np.asarray(reading, dtype=float), np.asarray(angles, dtype=float)
        poses = np.asarray(poses, dtype=float)
        used = reading < self.max_range  # not nan either
        total = np.zeros(poses.shape[:-1])
        scale = self.hit / (self.sigma * math.sqrt(2.0 * math.pi))
        for z, angle in zip(reading[used], angles[used], strict=True):
            direction = poses[..., 2] + angle
            i = np.floor((poses[..., 0] + z * np.cos(direction) - grid.origin[0]) / grid.cell).astype(np.intp)
            j = np.floor((poses[..., 1] + z * np.sin(direction) - grid.origin[1]) / grid.cell).astype(np.intp)
            rows, columns = field.shape
            distance = field[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]
            near = scale * np.exp(np.maximum(-0.5 * np.square(distance / self.sigma), -700.0))
            with np.errstate(divide="ignore"):
                total += np.log(near + self.random / self.max_range)
        return total
