"""Overlay records to bytes."""

from __future__ import annotations

import base64
import dataclasses
import json
from typing import Any

import numpy as np

from ciberrato.errors import ProtocolError
from ciberrato.overlay.decoding import decode_overlay
from ciberrato.overlay.messages import KINDS, VERSION, GridBelief, OverlayMessage, Shape

_CELLS_AS_NUMBERS = 1000
"""Up to this size a belief is written as a list of numbers, which people can read."""


def encode_overlay(message: OverlayMessage) -> bytes:
    """Write a message as a datagram.

    Parameters
    ----------
    message : OverlayMessage

    Returns
    -------
    bytes
        JSON in UTF-8.

    Raises
    ------
    ProtocolError
        If a viewer would refuse it; the message says why.
    """
    document: dict[str, Any] = {"overlay": VERSION, "source": message.source}
    for name in ("robot", "time", "angles"):
        if getattr(message, name) is not None:
            document[name] = getattr(message, name)
    if message.clear:
        document["clear"] = True
    if message.remove:
        document["remove"] = message.remove
    if message.belief is not None:
        document["belief"] = _belief_document(message.belief)
    if message.shapes:
        document["shapes"] = [_shape_document(shape) for shape in message.shapes]
    try:
        data = json.dumps(document, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode()
    except ValueError as error:
        raise ProtocolError(f"overlay: {error}") from None
    decode_overlay(data)  # the limits are written down once, there
    return data


def _belief_document(belief: GridBelief) -> dict[str, Any]:
    cells = np.asarray(belief.cells, np.float64)
    if cells.ndim != 2:
        raise ProtocolError(f"overlay: belief of {cells.ndim} dimensions; rows and columns were expected")
    document: dict[str, Any] = {"rows": cells.shape[0], "columns": cells.shape[1]}
    if cells.size <= _CELLS_AS_NUMBERS:
        document["cells"] = [float(f"{value:.6g}") for value in cells.ravel()]
    else:
        document["cells_base64"] = base64.b64encode(cells.astype("<f4").tobytes()).decode()
    if belief.extent is not None:
        document["extent"] = belief.extent
    return document


def _shape_document(shape: Shape) -> dict[str, Any]:
    for kind, record in KINDS.items():
        if type(shape) is record:
            values = {field.name: getattr(shape, field.name) for field in dataclasses.fields(shape)}
            return {
                "kind": kind,
                **{key: value for key, value in values.items() if value not in (None, "")},
            } | ({"ttl": None} if shape.ttl is None else {})
    raise ProtocolError(f"overlay: {type(shape).__name__} is not one of the kinds of shapes")
