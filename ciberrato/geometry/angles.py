"""Angles: two rules that bring them in, each for a number and for an array.

`wrap_once` and `wrap_each_once` take at most one turn off, as the real simulator does: its outcomes hang on
that where a comparison is close. `short_turn` and `short_turns` take all whole turns off: the difference
between two headings, the short way round. (`ciberrato.bayes` has its own, as it knows nothing of the rest.)
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ciberrato.arrays import Floats

_TURN = 2 * math.pi


def wrap_once(angle: float) -> float:
    """Wrap an angle by at most one turn.

    Parameters
    ----------
    angle : float
        Radians.

    Returns
    -------
    float
        Within ±π if the angle was within ±3 π; both ends can occur.
    """
    if angle > math.pi:
        return angle - _TURN
    if angle < -math.pi:
        return angle + _TURN
    return angle


def wrap_each_once(angles: Floats) -> Floats:
    """Wrap each angle by at most one turn, as `wrap_once`, to the last bit.

    Parameters
    ----------
    angles : array
        Radians.

    Returns
    -------
    array
        Of the same shape.
    """
    import numpy as np

    return np.where(angles > math.pi, angles - _TURN, np.where(angles < -math.pi, angles + _TURN, angles))


def short_turn(angle: float) -> float:
    """Wrap an angle by whole turns.

    Parameters
    ----------
    angle : float
        Radians.

    Returns
    -------
    float
        Within ±π; both ends can occur. Exact: an angle within ±π stays as it is.
    """
    return math.remainder(angle, _TURN)


def short_turns(angles: Floats) -> Floats:
    """Wrap each angle by whole turns.

    Parameters
    ----------
    angles : array
        Radians.

    Returns
    -------
    array
        Of the same shape, within ±π; both ends can occur. Angles within ±π stay as they are.
    """
    import numpy as np

    return np.asarray(angles - _TURN * np.rint(angles / _TURN))


def bearing(x: float, y: float, to_x: float, to_y: float) -> float:
    """Compute the angle of the direction from one point to another.

    Parameters
    ----------
    x, y, to_x, to_y : float
        Units.

    Returns
    -------
    float
        Radians within ±π; exactly π/2 straight above, -π/2 straight below and at the point itself.
    """
    if to_x == x:
        return math.pi / 2 if to_y > y else -math.pi / 2
    return math.atan2(to_y - y, to_x - x)
