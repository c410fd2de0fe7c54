"""Representations of records in a session: on one line, and short, however large their contents."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

LONGEST = 190
"""Characters of a representation."""


def short_repr(record: Any) -> str:
    """Return a representation of a record (a dataclass or a named tuple) for people.

    Fields that have their default are left out. Arrays are shown by their shape, long collections by their
    length.

    Parameters
    ----------
    record : object

    Returns
    -------
    str
        One line of less than 200 characters.
    """
    if dataclasses.is_dataclass(record):
        fields = [(field.name, field.default) for field in dataclasses.fields(record) if field.repr]
    else:
        defaults = getattr(record, "_field_defaults", {})
        fields = [(name, defaults.get(name, dataclasses.MISSING)) for name in record._fields]
    shown = []
    for name, default in fields:
        value = getattr(record, name, None)
        # `is` for what has no plain comparison, as arrays.
        if value is not default and not (
            isinstance(value, str | int | float | tuple) and _same(value, default)
        ):
            shown.append(f"{name}={short(value)}")
    return cut(f"{type(record).__name__}({', '.join(shown)})")


def short(value: Any) -> str:
    """Return a representation of the value of a field: forty characters or so."""
    shape, dtype = getattr(value, "shape", None), getattr(value, "dtype", None)
    if isinstance(shape, tuple) and shape and dtype is not None:
        return f"<{dtype} {shape}>"
    if isinstance(value, str | bytes):
        return repr(value) if len(value) <= 40 else f"{value[:37]!r}..."
    if isinstance(value, tuple | list | set | frozenset | dict):
        if len(value) > 4:
            return f"<{len(value)} in a {type(value).__name__}>"
        if type(value) is tuple or type(value) is list:
            inside = ", ".join(short(one) for one in value) + "," * (type(value) is tuple and len(value) == 1)
            return cut(f"({inside})" if type(value) is tuple else f"[{inside}]", 60)
    return cut(repr(value), 60)


def cut(text: str, longest: int = LONGEST) -> str:
    """Return a text on one line, cut off where it is too long."""
    line = " ".join(text.split())
    return line if len(line) <= longest else f"{line[: longest - 4]}...{line[-1]}"


def _same(value: Any, default: Any) -> bool:
    return type(value) is type(default) and bool(value == default)


def html_repr(record: Any) -> str:
    """Return a record as a notebook shows it: a picture of bounded size, and a caption.

    Parameters
    ----------
    record : object
        One of those that `ciberrato.plot.shown` draws.

    Returns
    -------
    str
        HTML; names in it are escaped.
    """
    # By name: plots stand on the rooms whose records they draw, and those must not stand on plots.
    shown = importlib.import_module("ciberrato.plot.shown")
    return str(shown.html_of(record))
