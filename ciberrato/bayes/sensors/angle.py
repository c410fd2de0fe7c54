r"""A sensor for angles (a compass, a bearing): a normal distribution wound round the circle.

.. math:: \log p(z | x) = \sum_i \log \sum_k N(z_i - \mu_i(x) + 2 \pi k;\; 0, \sigma^2)

A Gaussian of the difference itself is wrong across the half turn: a compass of 179 degrees and a heading of
-179 are 2 degrees apart. The bearing part of Probabilistic Robotics, table 6.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import log_wrapped_normal
from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.checks import map_array, positive, where
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleSensor:
    """Independent angles with wrapped normal noise.

    Attributes
    ----------
    sigma : float or array_like
        Standard deviation, positive; broadcasts against the expected angles.
    deg : bool
        Sigma, readings and expected angles are in degrees; radians otherwise. Log densities are per radian in
        both cases.
    """

    __repr__ = short_repr

    sigma: float | FloatArray
    deg: bool = False

    def __post_init__(self) -> None:
        positive(self.sigma, what="sigma")

    def log_likelihood(
        self, reading: ArrayLike, mean: ArrayLike, *, undefined: ArrayLike | None = None
    ) -> FloatArray:
        """Compute log p(reading | state), summed over the angles.

        Parameters
        ----------
        reading : array_like, shape () or (angles,)
            Any number of turns; nan where there is none, which says nothing.
        mean : array_like, shape (...) or (..., angles)
            Expected angle per state: shape of the belief for a single reading, an axis more for several.
        undefined : array_like of bool, shape of `mean`, optional
            States without an expected angle (the bearing of a landmark under the robot): all readings are
            alike likely there. The mean does not count.

        Returns
        -------
        FloatArray, shape (...)

        Raises
        ------
        ValueError
            If a reading is infinite, a mean is nan or infinite, or the shapes do not fit.
        """
        reading = np.asarray(reading, dtype=float)
        if np.isinf(reading).any():
            raise ValueError(
                f"angle {where(np.atleast_1d(np.isinf(reading)))} is infinite; nan where there is no reading"
            )
        mean = np.asarray(mean, dtype=float)
        nowhere: BoolArray = np.zeros(mean.shape, bool) if undefined is None else np.asarray(undefined, bool)
        if nowhere.shape != mean.shape:
            raise ValueError(f"`undefined` has shape {nowhere.shape}, the expected angles {mean.shape}")
        mean = map_array(np.where(nowhere, 0.0, mean), what="expected angle")
        if np.isinf(mean).any():
            raise ValueError(f"the expected angle at {where(np.isinf(mean))} is infinite")
        if reading.ndim > 1 or (reading.ndim == 1 and mean.shape[-1:] != reading.shape):
            raise ValueError(
                f"the reading has shape {reading.shape} and the expected angles {mean.shape}: several angles "
                "need an expected one each, in the last axis"
            )
        scale = math.pi / 180.0 if self.deg else 1.0
        sigma = np.asarray(self.sigma, dtype=float) * scale
        terms = log_wrapped_normal(np.where(np.isnan(reading), 0.0, reading - mean) * scale, sigma)
        if terms.shape != mean.shape:
            raise ValueError(
                f"sigma has shape {sigma.shape}, which does not fit expected angles {mean.shape}"
            )
        terms = np.where(nowhere, -math.log(2.0 * math.pi), terms)
        terms = np.where(np.isnan(reading), 0.0, terms)
        return np.asarray(terms.sum(axis=-1) if reading.ndim else terms)
