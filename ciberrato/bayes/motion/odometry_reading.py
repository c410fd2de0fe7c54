"""Odometry readings, their errors, and the part that a prediction by them leaves out.

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
from ciberrato.reprs import short_repr


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

    __repr__ = short_repr

    rot1: float = 0.0
    trans: float = 0.0
    rot2: float = 0.0

    @classmethod
    def between(cls, before: ArrayLike, after: ArrayLike, *, threshold: float = 1e-3) -> OdometryReading:
        """Return the motion between two odometry poses (x, y, heading): table 5.5, lines 2 to 4.

        Parameters
        ----------
        before, after : array_like, shape (3,)
            Finite.
        threshold : float
            For distances shorter than this the direction may be jitter and is ignored: then the first turn is
            0, the way is what of it lies along the heading (negative for backward), and all of the turn comes
            after. In units of length; amcl and beluga take 0.01 m.
        """
        x0, y0, heading0 = (float(v) for v in np.asarray(before))
        x1, y1, heading1 = (float(v) for v in np.asarray(after))
        dx, dy = x1 - x0, y1 - y0
        trans, turn = math.hypot(dx, dy), heading1 - heading0
        if not math.isfinite(trans + turn):
            raise ValueError(f"odometry poses must be finite, not {before!r} and {after!r}")
        if trans < threshold:
            along = dx * math.cos(heading0) + dy * math.sin(heading0)
            return cls(rot1=0.0, trans=along, rot2=float(wrap(turn)))
        rot1 = float(wrap(math.atan2(dy, dx) - heading0))
        return cls(rot1=rot1, trans=trans, rot2=float(wrap(turn - rot1)))

    def turns_made(self) -> tuple[float, float]:
        """Return the turns before and after the drive that the robot makes, radians.

        Driving backward is read as half a turn, a drive, and half a turn back. Where the first turn is more
        than a quarter, the robot is taken to have driven backward: half a turn is left out of both.
        """
        if self.trans == 0.0 or abs(self.rot1) <= 0.5 * math.pi:
            return self.rot1, self.rot2
        half = math.copysign(math.pi, self.rot1)
        return float(wrap(self.rot1 - half)), float(wrap(self.rot2 + half))


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryNoise:
    """Standard deviations of odometry: a constant part, and the book's alphas (table 5.5, lines 8 to 10).

    The alphas count the turns that the robot makes (`OdometryReading.turns_made`): 0 for driving backward,
    which the table's lines 2 to 4 read as two half turns.

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

    __repr__ = short_repr

    rotation: float = 0.0
    translation: float = 0.0
    alpha1: float = 0.0
    alpha2: float = 0.0
    alpha3: float = 0.0
    alpha4: float = 0.0

    def __post_init__(self) -> None:
        for name in ("rotation", "translation", "alpha1", "alpha2", "alpha3", "alpha4"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and 0 or more, not {getattr(self, name)}")

    def sigmas(self, reading: OdometryReading) -> tuple[float, float, float]:
        """Return the standard deviations of rot1, trans and rot2; ValueError if not finite."""
        if not all(math.isfinite(v) for v in (reading.rot1, reading.trans, reading.rot2)):
            raise ValueError(f"an odometry reading must be finite, not {reading}")
        drive = reading.trans * reading.trans
        turns = [turn * turn for turn in reading.turns_made()]
        rot1, rot2 = (
            math.sqrt(self.rotation**2 + self.alpha1 * turn + self.alpha2 * drive) for turn in turns
        )
        trans = math.sqrt(self.translation**2 + self.alpha3 * drive + self.alpha4 * sum(turns))
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

    def __repr__(self) -> str:
        return short_repr(self)
