r"""Sensors that report one of a few things: any table of probabilities, and a door detector.

Probabilistic Robotics, section 1.2 (the corridor with three doors) and eq. 2.56 (a table of conditional
probabilities).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import finite_array, positive, where
from ciberrato.bayes.spaces import Axis
from ciberrato.reprs import short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscreteSensor:
    """A table of P(symbol | state).

    Attributes
    ----------
    probabilities : mapping of symbol to array_like
        All arrays of the belief's shape; 0 or more; over the symbols they sum to 1 in every state.
    """

    __repr__ = short_repr

    probabilities: Mapping[Any, FloatArray]

    def __post_init__(self) -> None:
        if not self.probabilities:
            raise ValueError("a discrete sensor needs at least one symbol")
        tables = {symbol: np.asarray(p, dtype=float) for symbol, p in self.probabilities.items()}
        shapes = {table.shape for table in tables.values()}
        if len(shapes) > 1:
            told = ", ".join(f"{symbol!r} {table.shape}" for symbol, table in tables.items())
            raise ValueError(f"the symbols' tables must all have the belief's shape: {told}")
        for symbol, table in tables.items():
            if not (table >= 0.0).all():
                wrong = ~(table >= 0.0)
                raise ValueError(
                    f"P({symbol!r}) in state {where(wrong)} is {table[wrong].flat[0]}, not 0 or more"
                )
        total = np.asarray(sum(tables.values()))
        if not np.allclose(total, 1.0, atol=1e-9):
            wrong = ~np.isclose(total, 1.0, atol=1e-9)
            raise ValueError(
                f"the symbols' probabilities in state {where(wrong)} sum to {total[wrong].flat[0]:g}, not 1"
            )

    def log_likelihood(self, reading: Hashable) -> FloatArray:
        """Return log P(reading | state), the belief's shape; ValueError for an unknown symbol."""
        if reading not in self.probabilities:
            raise ValueError(
                f"unknown symbol {reading!r}; choose one of {', '.join(map(repr, self.probabilities))}"
            )
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.asarray(self.probabilities[reading], dtype=float)))


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorDetector:
    """Says whether there is a door beside the robot, without saying which.

    P(door | x) falls off with the distance to the nearest door's middle as a Gaussian does, from `seen` to
    `false_alarm`.

    Attributes
    ----------
    doors : tuple of float
        Middles of the doors, in the axis' unit.
    sigma : float
        Width of the falling off; a quarter of a door's width puts the door within two sigmas.
    seen, false_alarm : float
        P(door) at a door's middle, and far from all.
    """

    __repr__ = short_repr

    doors: tuple[float, ...]
    sigma: float
    seen: float = 1.0
    false_alarm: float = 0.0

    def __post_init__(self) -> None:
        if not len(self.doors):
            raise ValueError("need at least one door")
        finite_array(self.doors, what="the doors' middles")
        positive(self.sigma, what="sigma")
        if not 0.0 <= self.false_alarm < self.seen <= 1.0:
            raise ValueError(f"need 0 <= false alarm < seen <= 1, not {self.false_alarm}, {self.seen}")

    def log_likelihood(self, reading: bool, axis: Axis, places: ArrayLike | None = None) -> FloatArray:
        """Return log P(reading | place).

        Parameters
        ----------
        reading : bool
            Whether a door was reported.
        axis : Axis
            Periodic or not; its centres are the places if none are given.
        places : array_like, optional
            Coordinates.

        Returns
        -------
        FloatArray, shape of the places
        """
        if reading not in (True, False):
            raise ValueError(f"a door is seen (True) or not (False), not {reading!r}")
        places = axis.centres if places is None else finite_array(places, what="places")
        distance = np.min([np.abs(axis.difference(places, door)) for door in self.doors], axis=0)
        score = -0.5 * np.square(distance / self.sigma)
        if not reading:
            chance = self.false_alarm + (self.seen - self.false_alarm) * np.exp(np.maximum(score, -700.0))
            with np.errstate(divide="ignore"):
                return np.asarray(np.log1p(-chance))
        far = np.log(self.false_alarm) if self.false_alarm > 0.0 else -np.inf
        return np.asarray(np.logaddexp(far, np.log(self.seen - self.false_alarm) + score))
