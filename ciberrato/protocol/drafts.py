"""Measures and Actions whose fields are still being set.

The constructor of a frozen record takes longer than a robot needs for a whole cycle of thinking. Who makes a
record in every cycle sets the fields of a draft of the same layout, and turns it into the record at the end.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ciberrato.protocol.messages import Actions, Measures

NOTHING_SEEN = (None, None, None, None)
_BY_HAND = {
    *("time", "start", "stop", "end_led", "returning_led", "visiting_led"),  # always set by who makes it
    *("collision", "compass", "ground", "gps", "line", "score", "infrared", "beacons", "messages", "others"),
}
_ADDED = tuple((field.name, field.default) for field in fields(Measures) if field.name not in _BY_HAND)


class MeasuresDraft:
    """The fields of `Measures`, not frozen yet: time, LEDs and buttons have to be set, the rest may be."""

    __slots__ = Measures.__slots__

    def __init__(self) -> None:
        draft: Any = self
        draft.collision = draft.compass = draft.ground = draft.gps = draft.line = draft.score = None
        draft.infrared = NOTHING_SEEN
        draft.beacons = draft.messages = draft.others = ()
        for name, default in _ADDED:
            setattr(draft, name, default)

    def finish(self) -> Measures:
        """Return the finished record: the draft itself, which cannot be changed any more."""
        draft: Any = self
        draft.__class__ = Measures
        measures: Measures = draft
        return measures


class ActionsDraft:
    """The fields of `Actions`, not frozen yet: all have to be set, and then the class."""

    __slots__ = Actions.__slots__
