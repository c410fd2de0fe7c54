"""Checks of the fields of the world's records when a record is made: the mistake is named."""

from __future__ import annotations

import math
import numbers
from typing import Any


def check_number(name: str, value: Any) -> None:
    """Refuse what is no real number; TypeError with the name."""
    if type(value) is float or type(value) is int:  # the usual ones, at once
        return
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name}: {value!r:.60} is not a number")


def check_noise(name: str, value: Any) -> None:
    """Refuse what is no standard deviation."""
    check_number(name, value)
    if not 0.0 <= value < math.inf:
        raise ValueError(f"{name}: {value!r} is not a standard deviation: a finite number, 0 or more")


def check_probability(name: str, value: Any) -> None:
    """Refuse what is no probability."""
    check_number(name, value)
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{name}: {value!r} is not a probability from 0 to 1")


def check_whole(name: str, value: Any) -> None:
    """Refuse what is no whole number."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{name}: {value!r:.60} is not a whole number")


def check_switch(name: str, value: Any) -> None:
    """Refuse what is neither True nor False; numpy's are."""
    if not isinstance(value, bool) and type(value).__name__ not in ("bool", "bool_"):
        raise TypeError(f"{name}: {value!r:.60} is neither True nor False")


def check_text(name: str, value: Any) -> None:
    """Refuse what is no text."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: {value!r:.60} is not a text")


def make_tuple(record: Any, name: str, kind: type) -> None:
    """Convert a field of a frozen record, given as any sequence, to a tuple of records of a kind."""
    value = getattr(record, name)
    if isinstance(value, str | bytes):
        raise TypeError(f"{name}: {value!r:.60} is not a list of {kind.__name__}s")
    try:
        found = tuple(value)
    except TypeError:
        raise TypeError(f"{name}: {value!r:.60} is not a list of {kind.__name__}s") from None
    for one in found:
        if not isinstance(one, kind):
            raise TypeError(f"{name}: {one!r:.60} is not a {kind.__name__}")
    if type(value) is not tuple:
        object.__setattr__(record, name, found)


def make_points(record: Any, name: str) -> None:
    """Convert a field of a frozen record to a tuple of points (x, y)."""
    value = getattr(record, name)
    if type(value) is tuple and all(type(point) is tuple and len(point) == 2 for point in value):
        found = value
    else:
        try:
            found = tuple((x, y) for x, y in value)
        except (TypeError, ValueError):
            raise TypeError(f"{name}: {value!r:.60} is not a list of points (x, y)") from None
        object.__setattr__(record, name, found)
    for x, y in found:
        check_number(name, x)
        check_number(name, y)
