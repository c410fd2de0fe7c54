"""Angles as the real simulator computes them: its outcomes hang on them where a comparison is close."""

from __future__ import annotations

import math

_TURN = 2 * math.pi


def wrap_once(angle: float) -> float:
    """Take at most one turn off an angle.

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


def bearing(x: float, y: float, to_x: float, to_y: float) -> float:
    """Angle from one point to another.

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
