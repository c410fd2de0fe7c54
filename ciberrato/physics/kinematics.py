"""Motion of a robot: motor clamp, motor filter, pose update.

All functions take numbers or arrays alike, and do the arithmetic of the real simulator in its order, so
that noise-free motion comes out equal to the last bit. With numbers, numpy is not even imported: a process
that only drives starts faster without it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

from ciberrato.geometry.angles import wrap_each_once, wrap_once

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_POWER = 0.15
"""Greatest motor command, in units per cycle."""

ROBOT_RADIUS = 0.5
"""Units; the distance between the wheels is twice that."""

Number = TypeVar("Number", float, "NDArray[np.float64]")
Command = tuple[float, float]
"""Of the left and the right motor, in units per cycle."""
STANDSTILL: Command = (0.0, 0.0)


def clamp_power(command: Number) -> Number:
    """Clamp a motor command as the simulator does.

    Parameters
    ----------
    command : float or array
        Units per cycle; finite.

    Returns
    -------
    float or array
        Within ±`MAX_POWER`.
    """
    if isinstance(command, (float, int)):
        return min(max(command, -MAX_POWER), MAX_POWER)
    return command.clip(-MAX_POWER, MAX_POWER)


def filter_power(command: Number, previous: Number, factor: Number | float = 1.0) -> Number:
    """Compute the power of a motor in a cycle: the mean of its last power and the command.

    Parameters
    ----------
    command : float or array
        Motor command in units per cycle, clamped.
    previous : float or array
        Power given in the cycle before, noise included; 0 at the start.
    factor : float or array
        Motor noise: a draw of mean 1 and standard deviation MotorsNoise / 100.

    Returns
    -------
    float or array
        Units per cycle.
    """
    return (command + previous) / 2.0 * factor


def filter_wheels(command: Command, wheels: Command) -> Command:
    """Compute the powers of both motors in a cycle without noise: `filter_power` for left and right.

    Parameters
    ----------
    command : (float, float)
        As sent: left and right, in units per cycle; clamped here, as the simulator does.
    wheels : (float, float)
        Powers given in the cycle before; 0 at the start.

    Returns
    -------
    (float, float)
        Units per cycle.
    """
    left, right = wheels
    return filter_power(clamp_power(command[0]), left), filter_power(clamp_power(command[1]), right)


def wrap_angle(angle: Number) -> Number:
    """Wrap an angle by at most one turn.

    Parameters
    ----------
    angle : float or array
        Radians.

    Returns
    -------
    float or array
        Within ±π if the angle was within ±3 π; both ends can occur. An angle farther out comes one turn
        nearer, as in the real simulator, where a start heading of 720 degrees takes two cycles to come in.
    """
    if isinstance(angle, (float, int)):
        return wrap_once(angle)
    return wrap_each_once(angle)


def advance(
    x: Number, y: Number, heading: Number, left: Number, right: Number
) -> tuple[Number, Number, Number]:
    """Compute the pose after one cycle, if nothing is in the path.

    The robot moves along its heading first, then turns.

    Parameters
    ----------
    x, y : float or array
        Units.
    heading : float or array
        Radians, counter-clockwise from +x.
    left, right : float or array
        Powers that the motors give, in units per cycle.

    Returns
    -------
    x, y, heading : float or array
        Shapes as broadcast. With arrays the sines and cosines are numpy's, which may differ from `math`'s
        in the last bit.
    """
    speed = (right + left) / 2.0
    turn = (right - left) / (2.0 * ROBOT_RADIUS)
    if isinstance(heading, (float, int)):
        cosine, sine = math.cos(heading), math.sin(heading)
    else:
        import numpy as np

        cosine, sine = np.cos(heading), np.sin(heading)
    return x + speed * cosine, y + speed * sine, wrap_angle(heading + turn)
