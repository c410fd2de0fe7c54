"""Checks of the arguments of motion models: beliefs, and commands as they come.

Numpy numbers, whole floats, lists and arrays mean what ints and tuples do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import floats


def whole_number(value: Any, what: str) -> int:
    """Return a number as an int; ValueError unless it is whole."""
    if type(value) is int:
        return value
    try:
        number = int(value)
        if not isinstance(value, str) and number == value:
            return number
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"{what} must be a whole number, not {value!r}")


def whole_numbers(values: Any, what: str) -> tuple[int, ...]:
    """Return one number, or several, as a tuple of ints; ValueError unless all are whole."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if isinstance(values, Iterable) and not isinstance(values, str):
        return tuple(whole_number(value, what) for value in values)
    return (whole_number(values, what),)


def as_command(control: Any) -> Any:
    """Return a command as a key: lists and arrays as tuples, numpy numbers as Python's."""
    if isinstance(control, np.ndarray | np.generic):
        control = control.tolist()
    if isinstance(control, list | tuple):
        return tuple(as_command(part) for part in control)
    return control


def look_up(table: Mapping[Any, Any], control: Any, what: str) -> Any:
    """Return the entry of a command, as a key of `as_command`; ValueError if there is none."""
    command = as_command(control)
    try:
        if command in table:
            return table[command]
    except TypeError:  # not hashable
        pass
    known = ", ".join(map(repr, list(table)[:20]))
    raise ValueError(f"no {what} for command {control!r}; the commands are {known}")


def check_belief(
    belief: ArrayLike, shape: Sequence[int] | None = None, *, single: bool = False
) -> FloatArray:
    """Return a belief as an array; ValueError if it has another shape, or an entry that is no probability.

    With `single` an array of single precision stays one.
    """
    values = floats(belief) if single else np.asarray(belief, dtype=float)
    if shape is not None and values.shape != tuple(shape):
        raise ValueError(f"belief has shape {values.shape}, the space {tuple(shape)}")
    # nan fails both comparisons; the ufuncs themselves, because small beliefs are checked in no time.
    lowest = np.minimum.reduce(values, axis=None, initial=0.0)
    if not (lowest >= 0.0 and np.maximum.reduce(values, axis=None, initial=0.0) < math.inf):
        raise ValueError("a belief must be finite and not negative")
    return values


def deviation(constant: float, *parts: tuple[float, float]) -> float:
    """Return the root of a constant's square and of variances that grow with a motion: (factor, square) each.

    Raises
    ------
    ValueError
        If it is too large for a double.
    """
    variance = float(constant) * float(constant) + sum(
        float(factor) * square for factor, square in parts if factor
    )
    if not math.isfinite(variance):
        raise ValueError("the motion's variance is too large for a double: is the motion in the grid's unit?")
    return math.sqrt(variance)
