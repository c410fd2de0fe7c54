"""Overlay bytes to records; everything that a viewer refuses is refused here."""

from __future__ import annotations

import base64
import binascii
import dataclasses
import json
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from ciberrato.errors import ProtocolError
from ciberrato.overlay.messages import (
    KINDS,
    MOST_BYTES,
    MOST_CELLS,
    MOST_POINTS,
    MOST_SHAPES,
    MOST_TEXT,
    VERSION,
    GridBelief,
    OverlayMessage,
    Shape,
)

_FARTHEST = 1e6
_COLOR = re.compile(r"#[0-9a-fA-F]{6}\Z")


def decode_overlay(data: bytes) -> OverlayMessage:
    """Read a datagram.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    OverlayMessage

    Raises
    ------
    ProtocolError
        If it is not such a message; naming the entry that is wrong. Unknown entries are no error, so that
        later versions can add some.
    """
    if len(data) > MOST_BYTES:
        raise ProtocolError(f"overlay: {len(data)} bytes; a datagram holds {MOST_BYTES}")
    try:
        document = json.loads(data, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"overlay: not JSON: {error}") from None
    if not isinstance(document, dict) or document.get("overlay") != VERSION:
        raise ProtocolError(f'overlay: not an object with "overlay": {VERSION}')
    if "source" not in document:
        raise ProtocolError("overlay: source is missing")
    shapes = document.get("shapes", [])
    if not isinstance(shapes, list) or len(shapes) > MOST_SHAPES:
        raise ProtocolError(f"overlay: shapes: a list of at most {MOST_SHAPES} was expected")
    remove = document.get("remove", [])
    if not isinstance(remove, list):
        raise ProtocolError("overlay: remove: a list was expected")
    belief = document.get("belief")
    angles = document.get("angles")
    return OverlayMessage(
        source=_name(document["source"], "source"),
        robot=_whole(document.get("robot"), "robot"),
        time=_whole(document.get("time"), "time"),
        angles=None if angles is None else _four(angles, "angles"),
        belief=None if belief is None else _read_belief(belief),
        shapes=tuple(_read_shape(shape) for shape in shapes),
        remove=tuple(_name(item, "remove") for item in remove),
        clear=document.get("clear") is True,
    )


def _read_belief(document: Any) -> GridBelief:
    if not isinstance(document, dict):
        raise ProtocolError("overlay: belief: an object was expected")
    rows = _whole(document.get("rows"), "belief rows")
    columns = _whole(document.get("columns"), "belief columns")
    if not rows or not columns or rows < 1 or columns < 1 or rows * columns > MOST_CELLS:
        raise ProtocolError(f"overlay: belief: rows x columns must be from 1 to {MOST_CELLS}")
    if "cells_base64" in document:
        try:
            data = base64.b64decode(document["cells_base64"], validate=True)
        except (TypeError, ValueError, binascii.Error):
            raise ProtocolError("overlay: belief cells_base64: not base64") from None
        if len(data) != 4 * rows * columns:
            raise ProtocolError(f"overlay: belief cells_base64: {rows * columns} float32 were expected")
        cells = np.frombuffer(data, "<f4").astype(np.float64)
    else:
        numbers = document.get("cells")
        if not isinstance(numbers, list) or len(numbers) != rows * columns:
            raise ProtocolError(f"overlay: belief cells: a list of {rows * columns} numbers was expected")
        cells = np.array([_real(number, "belief cells") for number in numbers], np.float64)
    if not np.isfinite(cells).all() or (cells < 0.0).any() or not cells.sum() > 0.0:
        raise ProtocolError("overlay: belief: finite numbers, none negative, not all 0, were expected")
    extent = document.get("extent")
    box = None if extent is None else _four(extent, "belief extent")
    if box is not None and not (box[0] < box[2] and box[1] < box[3]):
        raise ProtocolError("overlay: belief extent: left < right and bottom < top were expected")
    return GridBelief(cells=cells.reshape(rows, columns), extent=box)


def _read_shape(document: Any) -> Shape:
    if not isinstance(document, dict):
        raise ProtocolError("overlay: shapes: objects were expected")
    record = KINDS.get(str(document.get("kind")))
    if record is None:
        raise ProtocolError(f"overlay: shape kind: one of {', '.join(KINDS)} was expected")
    values: dict[str, Any] = {}
    for field in dataclasses.fields(record):
        if field.name in document:
            values[field.name] = _READERS[field.name](document[field.name], f"shape {field.name}")
        elif field.default is dataclasses.MISSING:
            raise ProtocolError(f"overlay: shape {field.name} is missing")
    return record(**values)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number of JSON")


def _real(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= _FARTHEST:
        raise ProtocolError(f"overlay: {what}: a number within ±{_FARTHEST:g} was expected")
    return float(value)


def _length(value: Any, what: str) -> float:
    number = _real(value, what)
    if number < 0.0:
        raise ProtocolError(f"overlay: {what}: must not be negative")
    return number


def _whole(value: Any, what: str) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**31:
        raise ProtocolError(f"overlay: {what}: a whole number from 0 was expected")
    return value


def _text(value: Any, what: str) -> str:
    if not isinstance(value, str) or len(value) > MOST_TEXT or not value.isprintable():
        raise ProtocolError(f"overlay: {what}: printable text of at most {MOST_TEXT} characters was expected")
    return value


def _name(value: Any, what: str) -> str:
    if not _text(value, what):
        raise ProtocolError(f"overlay: {what}: must not be empty")
    return str(value)


def _list_of_reals(value: Any, what: str, count: int) -> list[float]:
    if not isinstance(value, list) or len(value) != count:
        raise ProtocolError(f"overlay: {what}: a list of {count} numbers was expected")
    return [_real(item, what) for item in value]


def _four(value: Any, what: str) -> tuple[float, float, float, float]:
    first, second, third, fourth = _list_of_reals(value, what, 4)
    return first, second, third, fourth


def _radii(value: Any, what: str) -> tuple[float, float]:
    along, across = (_length(item, what) for item in _list_of_reals(value, what, 2))
    return along, across


def _points(value: Any, what: str) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list) or not 2 <= len(value) <= MOST_POINTS:
        raise ProtocolError(f"overlay: {what}: a list of 2 to {MOST_POINTS} points was expected")
    points = []
    for item in value:
        x, y = _list_of_reals(item, what, 2)
        points.append((x, y))
    return tuple(points)


def _color(value: Any, what: str) -> str | None:
    if value is None:
        return None
    if not isinstance(value, str) or not _COLOR.match(value):
        raise ProtocolError(f"overlay: {what}: #rrggbb was expected")
    return value


def _ttl(value: Any, what: str) -> float | None:
    if value is None:
        return None
    seconds = _real(value, what)
    if not math.isfinite(seconds) or seconds <= 0.0:
        raise ProtocolError(f"overlay: {what}: seconds above 0, or null, were expected")
    return seconds


_READERS: dict[str, Callable[[Any, str], Any]] = {
    "id": _name,
    "color": _color,
    "label": _text,
    "ttl": _ttl,
    "x": _real,
    "y": _real,
    "direction": _real,
    "radius": _length,
    "length": _length,
    "radii": _radii,
    "points": _points,
    "text": _text,
}
