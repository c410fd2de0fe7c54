"""Checks of a batch's arguments."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.physics.kinematics import MAX_POWER
from simulator_stub.batch.plan import SENSORS
from simulator_stub.world.noise import NoiseRoot

FARTHEST = 1e6
"""Units, and degrees: beyond, squares of tables have no whole numbers."""
Thing = TypeVar("Thing")


def for_each(things: Any, kind: type[Thing], count: int, what: str) -> list[Thing]:
    """Repeat one thing, or check that there are as many as worlds."""
    if isinstance(things, kind):
        return [things] * count
    listed = things_of(things, kind, what)
    if len(listed) != count:
        raise ValueError(f"{what}: {len(listed)} for {count} worlds; give one, or one for each")
    return listed


def things_of(things: Any, kind: type[Thing], what: str) -> list[Thing]:
    """Check that all are of a kind."""
    listed = list(things) if isinstance(things, Iterable) and not isinstance(things, str) else [things]
    for one in listed:
        if not isinstance(one, kind):
            raise TypeError(f"{what}: {one!r:.60} is no {kind.__name__}")
    return listed


def seeds_of(seeds: Any, count: int | None = None) -> list[NoiseRoot]:
    """Draw what all noise follows from, of one seed for each world."""
    if not isinstance(seeds, Sequence | np.ndarray) or isinstance(seeds, str | bytes):
        raise TypeError(f"seeds: {seeds!r:.60} are not seeds, one for each world")
    if count is not None and len(seeds) != count:
        raise ValueError(f"there must be {count} seeds, one for each world: {len(seeds)}")
    return [NoiseRoot.from_seed(seed) for seed in seeds]


def angles_of(angles: Any) -> Floats:
    """Turn mounting angles of the IR sensors into radians."""
    degrees = _numbers(angles, "sensor_angles")
    if degrees.shape != (SENSORS,) or not np.isfinite(degrees).all():
        raise ValueError(f"sensor_angles: {angles!r:.60} are not {SENSORS} angles in degrees")
    # Divided first, as a single simulation does.
    return np.array([angle / 180.0 * math.pi for angle in degrees.tolist()])


def threads_of(threads: int | None) -> int:
    """Check a number of threads; None is as many as there are cores."""
    if threads is None:
        return os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer):
        raise TypeError(f"threads: {threads!r:.60} is not a whole number")
    if threads < 1:
        raise ValueError(f"threads: {threads} is below 1")
    return int(threads)


def _numbers(values: Any, what: str) -> Floats:
    try:
        return np.array(values, np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{what}: {values!r:.60} are not numbers in rows of the same length") from None


def numbers_of_worlds(chosen: ArrayLike, worlds: int) -> Integers:
    """Convert a mask, or numbers, of worlds to numbers."""
    array = np.asarray(chosen)
    if array.dtype == np.bool_:
        if array.shape != (worlds,):
            raise ValueError(f"a mask of worlds must have the shape ({worlds},): {array.shape}")
        return np.flatnonzero(array)
    if array.dtype.kind not in "iu" and array.size:
        raise TypeError(f"worlds: {chosen!r:.60} is neither a mask nor whole numbers")
    numbers = array.reshape(-1).astype(np.int64)
    if ((numbers < 0) | (numbers >= worlds)).any() or np.unique(numbers).size < numbers.size:
        raise ValueError(f"worlds must be different numbers from 0 to {worlds - 1}")
    return numbers


def poses_of(starts: ArrayLike, count: int) -> Floats:
    """Check start poses."""
    poses = _numbers(starts, "starts")
    if poses.shape != (count, 3):
        raise ValueError(f"starts must have the shape ({count}, 3), one for each seed: {poses.shape}")
    if not (np.abs(poses) <= FARTHEST).all():
        raise ValueError(f"starts must be finite, and within {FARTHEST:g}")
    return poses


def motor_powers(commands: ArrayLike, worlds: int) -> Floats:
    """Clamp motor commands."""
    powers: Floats = np.clip(_numbers(commands, "commands"), -MAX_POWER, MAX_POWER)
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
