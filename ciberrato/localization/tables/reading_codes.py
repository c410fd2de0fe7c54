"""Likelihoods of a reading in a square of the lattice, for all expected readings at once.

The expected reading of a state is kept as an 8-bit code; the steps between codes follow the reading's own
spread, so that no code matters more than another. What a reading says about the states is then a table of
256 numbers, computed when the reading first occurs.

A square is not its node. The distance to the wall differs over the square and over the heading's bin by about
``deviation = sqrt(place² / 12 + (distance · turn)² / 12)``, and the reading 1/distance by that over distance
squared: near a wall many times the sensor's noise. So the likelihood of a reading is the mean over the
distances of the square, of the exact probability that reading plus noise rounds to it (Thrun, Burgard, Fox,
*Probabilistic Robotics*, section 8.2.4, on grids whose cells are coarse for the sensor).
"""

from __future__ import annotations

from functools import lru_cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.infrared.model import CONTACT, SATURATION, reading_log_likelihood
from ciberrato.localization.belief import compiled

Codes = NDArray[np.uint8]

CODES = 256
_FARTHEST = 40.0  # units; distances beyond are not distinguished
_NODES = np.array([NormalDist().inv_cdf((k + 0.5) / 41) for k in range(41)])
_ROUNDING = 0.1
_SHIFT = 44  # bits of a double behind its exponent and the first eight of its mantissa
_NEAREST = int(np.float64(CONTACT).view(np.int64)) >> _SHIFT
_FAR_OFF = 12.0  # deviations beyond which a probability is below what outliers leave of double precision


class ReadingCodes:
    """Codes for expected readings, and the likelihood of a reading by code.

    Parameters
    ----------
    noise : float
        Standard deviation of a reading (ObstacleNoise).
    place : float
        Units over which a square's distances spread.
    turn : float
        Radians over which a heading's bin spreads.
    outlier : float
        Probability that a reading has nothing to do with the expected one (an edge passes through the
        square).
    """

    def __init__(self, *, noise: float, place: float, turn: float, outlier: float) -> None:
        self._outlier = outlier
        self._ideal, self._sigma, self._known = _spread(noise, place, turn, outlier)

    def log_likelihood(self, reading: float) -> Floats:
        """Return the logarithm of the likelihood of a reading for every code, less the greatest.

        Parameters
        ----------
        reading : float
            As reported, a multiple of 0.1.

        Returns
        -------
        array, shape (256,)
        """
        key = round(reading / _ROUNDING)
        table = self._known.get(key)
        if table is None:
            table = self._known[key] = self._compute(key * _ROUNDING)
        return table

    def _compute(self, reading: float) -> Floats:
        ideal, sigma = self._ideal, self._sigma
        near = np.abs(reading - ideal) < _FAR_OFF * sigma + _ROUNDING
        masses = np.zeros(ideal.shape)
        masses[near] = np.exp(reading_log_likelihood(reading, ideal[near], sigma[near]))
        background = max(1.0 / (1.0 + max(reading, 0.0)) ** 2, 1e-4) * _ROUNDING
        mixed = (1.0 - self._outlier) * masses.mean(axis=1) + self._outlier * background
        return np.asarray(np.log(mixed / mixed.max()))


@lru_cache(maxsize=64)
def _spread(
    noise: float, place: float, turn: float, outlier: float
) -> tuple[Floats, Floats, dict[int, Floats]]:
    """Return ideal readings over the square of every code, their deviations, and room for likelihoods.

    Filters with the same settings share them: the likelihood of a new reading takes longer than a cycle of a
    filter that knows where the robot is.
    """
    distance = code_distances()
    deviation = np.sqrt((place**2 + (turn * distance) ** 2) / 12.0)
    samples = distance[:, np.newaxis] + deviation[:, np.newaxis] * _NODES
    ideal = np.where(samples > CONTACT, 1.0 / np.maximum(samples, CONTACT), SATURATION)
    # Between two samples the ideal reading is taken to spread evenly.
    gap = np.abs(np.gradient(ideal, axis=1))
    return ideal, np.maximum(np.sqrt(noise**2 + gap**2 / 12.0), 1e-3), {}


def code_distances() -> Floats:
    """Return the distances that the codes stand for, falling.

    Returns
    -------
    array, shape (256,)
        Units; evenly spaced by 1/distance far away, by the distance's logarithm nearer than 1.
    """
    return 1.0 / _inverse(np.linspace(_scale(1.0 / _FARTHEST), _scale(SATURATION), CODES))


def encode(distances: Floats) -> Codes:
    """Convert distances to codes.

    Parameters
    ----------
    distances : array
        Units; infinite where no wall is seen, which reads like contact.

    Returns
    -------
    array of uint8, same shape
    """
    codes, greatest = _code_steps()
    distances = np.ascontiguousarray(distances, np.float64)
    kernels = compiled.kernels()
    if kernels is not None and distances.ndim == 2:
        coded: Codes = kernels.encode(distances, codes, greatest, _SHIFT, _NEAREST)
        return coded
    # The leading bits of a double grow with it, and no two codes begin between two neighbours among them.
    index = distances.view(np.int64) >> _SHIFT
    index -= _NEAREST
    np.clip(index, 0, len(codes) - 1, out=index)
    coded = codes.take(index)
    coded -= distances > greatest.take(index)
    if not distances.max(initial=0.0) < np.inf:
        coded[~(distances < np.inf)] = CODES - 1
    return coded


@lru_cache(maxsize=1)
def _code_steps() -> tuple[Codes, Floats]:
    """Return, by a distance's leading bits, the code of the nearest, and up to which distance it holds."""
    code = np.arange(1, CODES)
    low = np.full(CODES - 1, CONTACT).view(np.int64)
    high = np.full(CODES - 1, 2.0 * _FARTHEST).view(np.int64)
    for _ in range(64):  # the greatest distance with this code or a higher one, to the last bit
        middle = low + (high - low) // 2
        reached = _code_of(middle.view(np.float64)) >= code
        low, high = np.where(reached, middle, low), np.where(reached, high, middle)
    last = low.view(np.float64)
    edges = np.arange(_NEAREST, (int(np.float64(2.0 * _FARTHEST).view(np.int64)) >> _SHIFT) + 2) << _SHIFT
    codes = _code_of(edges.view(np.float64))
    greatest = np.append(np.inf, last)[codes]
    return codes.astype(np.uint8), greatest


def _code_of(distances: Floats) -> NDArray[np.int64]:
    reading = np.where(distances > CONTACT, 1.0 / np.maximum(distances, CONTACT), SATURATION)
    low, high = _scale(1.0 / _FARTHEST), _scale(SATURATION)
    # Rounded to 1e-7, so that places that are equal but for the arithmetic get equal codes.
    position = np.round((_scale(reading) - low) / (high - low) * (CODES - 1), 7)
    return np.clip(np.floor(position + 0.5), 0, CODES - 1).astype(np.int64)


def _scale(reading: NDArray[np.float64] | float) -> Floats:
    return np.asarray(np.arcsinh(np.asarray(reading, np.float64)))


def _inverse(scale: Floats) -> Floats:
    return np.asarray(np.sinh(scale))
