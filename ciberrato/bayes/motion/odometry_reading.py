"""What odometry reports, how far it may be off, and what a prediction by it leaves out.

Probabilistic Robotics, section 5.4 and table 5.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import wrap
from ciberrato.bayes.arraytypes import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryReading:
    """A relative motion, as odometry reports it.

    Attributes
    ----------
    rot1, rot2 : float
        Turn before and after the drive, radians.
    trans : float
        Way driven, in units of length.
    """

    rot1: float = 0.0
    trans: float = 0.0
    rot2: float = 0.0

    @classmethod
    def between(cls, before: ArrayLike, after: ArrayLike) -> OdometryReading:
        """Give the motion between two odometry poses (x, y, heading): table 5.5, lines 2 to 4."""
        x0, y0, heading0 = (float(v) for v in np.asarray(before))
        x1, y1, heading1 = (float(v) for v in np.asarray(after))
        trans = math.hypot(x1 - x0, y1 - y0)
        # Without any way driven the direction means nothing: then all of the turn comes after.
        rot1 = float(wrap(math.atan2(y1 - y0, x1 - x0) - heading0)) if trans > 0.0 else 0.0
        return cls(rot1=rot1, trans=trans, rot2=float(wrap(heading1 - heading0 - rot1)))


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryNoise:
    """Standard deviations of odometry: a constant part, and the book's alphas (table 5.5, lines 8 to 10).

    Attributes
    ----------
    rotation : float
        Constant part for either turn, radians.
    translation : float
        Constant part for the drive, in units of length.
    alpha1, alpha2, alpha3, alpha4 : float
        Variance of a turn per square radian turned and square unit driven; variance of the drive per square
        unit driven and square radian turned.
    """

    rotation: float = 0.0
    translation: float = 0.0
    alpha1: float = 0.0
    alpha2: float = 0.0
    alpha3: float = 0.0
    alpha4: float = 0.0

    def __post_init__(self) -> None:
        for name in ("rotation", "translation", "alpha1", "alpha2", "alpha3", "alpha4"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must be 0 or more, not {getattr(self, name)}")

    def sigmas(self, reading: OdometryReading) -> tuple[float, float, float]:
        """Give the standard deviations of rot1, trans and rot2; ValueError if one is 0."""
        drive = reading.trans**2
        turns = reading.rot1**2, reading.rot2**2
        rot1, rot2 = (
            math.sqrt(self.rotation**2 + self.alpha1 * turn + self.alpha2 * drive) for turn in turns
        )
        trans = math.sqrt(self.translation**2 + self.alpha3 * drive + self.alpha4 * sum(turns))
        if min(rot1, trans, rot2) == 0.0:
            raise ValueError("odometry needs some noise in each of its three parts to have a density")
        return rot1, trans, rot2


class Prediction(NamedTuple):
    """A predicted belief and what was left out on the way.

    Attributes
    ----------
    belief : FloatArray
        Not normalized: what left the grid is missing.
    skipped : float
        Mass of the start states that were skipped because they hold too little.
    truncated : float
        Bound on the share of the kernel's mass that the window cut off.
    """

    belief: FloatArray
    skipped: float
    truncated: float
