"""What callers of a batch hand over, checked."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.physics.kinematics import MAX_POWER

Thing = TypeVar("Thing")


def for_each(things: Any, kind: type[Thing], count: int, what: str) -> list[Thing]:
    """Repeat one thing, or check that there are as many as worlds."""
    if isinstance(things, kind):
        return [things] * count
    listed = list(things)
    if len(listed) != count:
        raise ValueError(f"{what}: {len(listed)} for {count} worlds; give one, or one for each")
    return listed


def numbers_of_worlds(chosen: ArrayLike, worlds: int) -> Integers:
    """Convert a mask, or numbers, of worlds to numbers."""
    array = np.asarray(chosen)
    if array.dtype == np.bool_:
        if array.shape != (worlds,):
            raise ValueError(f"a mask of worlds must have the shape ({worlds},): {array.shape}")
        return np.flatnonzero(array)
    numbers = array.reshape(-1).astype(np.int64)
    if ((numbers < 0) | (numbers >= worlds)).any() or np.unique(numbers).size < numbers.size:
        raise ValueError(f"worlds must be different numbers from 0 to {worlds - 1}")
    return numbers


def poses_of(starts: ArrayLike, count: int) -> Floats:
    """Check start poses."""
    poses = np.array(starts, np.float64)
    if poses.shape != (count, 3):
        raise ValueError(f"starts must have the shape ({count}, 3), one for each seed: {poses.shape}")
    if not np.isfinite(poses).all():
        raise ValueError("starts must be finite")
    return poses


def motor_powers(commands: ArrayLike, worlds: int) -> Floats:
    """Clamp motor commands."""
    powers: Floats = np.clip(np.asarray(commands, np.float64), -MAX_POWER, MAX_POWER)
    if powers.shape != (worlds, 2):
        raise ValueError(f"commands must have the shape ({worlds}, 2): {powers.shape}")
    if np.isnan(powers).any():
        raise ValueError("a motor command must be a number, not NaN")
    return powers


def led_states(leds: ArrayLike, worlds: int, scored: bool) -> Booleans:
    """Check LEDs."""
    lit = np.asarray(leds, np.bool_)
    if not scored:
        raise ValueError("LEDs have no meaning without scores: BatchSimulation(..., scoring=0)")
    if lit.shape != (worlds, 3):
        raise ValueError(f"leds must have the shape ({worlds}, 3): {lit.shape}")
    return lit
