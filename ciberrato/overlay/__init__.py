"""The overlay protocol: what an agent may show in a viewer, as one JSON datagram a message (sans-IO).

An agent sends its belief over places, and shapes with an id and a time to live, to a viewer on the same
machine. Nothing comes back, and nothing depends on a viewer being there. The format, for agents in any
language, is described in docs/overlay.md; `ciberrato.net.overlay` sends it.
"""

from ciberrato.overlay.decoding import decode_overlay
from ciberrato.overlay.encoding import encode_overlay
from ciberrato.overlay.messages import (
    KINDS,
    MOST_BYTES,
    MOST_CELLS,
    MOST_POINTS,
    MOST_SHAPES,
    MOST_TEXT,
    OVERLAY_PORT,
    VERSION,
    Arrow,
    Circle,
    Ellipse,
    GridBelief,
    Line,
    OverlayMessage,
    Polygon,
    PoseMark,
    Shape,
    Text,
)

__all__ = [
    "KINDS",
    "MOST_BYTES",
    "MOST_CELLS",
    "MOST_POINTS",
    "MOST_SHAPES",
    "MOST_TEXT",
    "OVERLAY_PORT",
    "VERSION",
    "Arrow",
    "Circle",
    "Ellipse",
    "GridBelief",
    "Line",
    "OverlayMessage",
    "Polygon",
    "PoseMark",
    "Shape",
    "Text",
    "decode_overlay",
    "encode_overlay",
]
