"""Overlays of agents, in bounded memory: beliefs by source and time, and shapes until their time is over."""

from __future__ import annotations

import base64
import bisect
import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.overlay import KINDS, GridBelief, OverlayMessage, Shape
from ciberrato.reprs import short_repr
from ciberrato.world.coordinates import Point
from ciberrato.world.lab import Lab

MOST_SOURCES = 32
MOST_SHAPES = 400
MOST_BELIEFS = 2048
MOST_BELIEF_BYTES = 16_000_000
"""Of all sources together; beyond it every second one of the older half of the greatest is forgotten."""

MOST_MODES = 6
PlaceOf = Callable[[int, int], Point | None]
_LEVELS = 65535
_KIND_NAMES = {record: kind for kind, record in KINDS.items()}


@dataclass(frozen=True, slots=True, eq=False)
class StoredBelief:
    """A belief as kept: 16 bits a cell on a square root scale, as fine as a page can show.

    Attributes
    ----------
    time : int
    levels : array of uint16, shape (rows, columns)
        65535 * sqrt(p / peak).
    peak : float
        Probability of the greatest cell.
    entropy : float
        Bits.
    place : (float, float) or None
        True place of the robot at that time, in units, if it is known.
    truth : float or None
        Probability of the cell of that place.
    extent : tuple of four float, or None
    """

    __repr__ = short_repr

    time: int
    levels: NDArray[np.uint16]
    peak: float
    entropy: float
    extent: tuple[float, float, float, float] | None
    place: Point | None = None
    truth: float | None = None

    def cells(self) -> NDArray[np.float64]:
        """Return the probabilities, shape (rows, columns)."""
        levels = self.levels.astype(float) / _LEVELS
        return self.peak * levels * levels

    def document(self) -> dict[str, Any]:
        """Write it for the page."""
        from ciberrato.bayes.summaries import modes

        cells = self.cells()
        hills = modes(cells)[:MOST_MODES]
        return {
            "time": self.time,
            "rows": self.levels.shape[0],
            "columns": self.levels.shape[1],
            "extent": self.extent,
            "place": self.place,
            "peak": self.peak,
            "cells": base64.b64encode(self.levels.astype("<u2").tobytes()).decode(),
            "entropy": round(self.entropy, 4),
            "modes": [[*hill.peak, round(float(cells[hill.peak]), 5), round(hill.mass, 5)] for hill in hills],
        }


class Source:
    """One agent's overlay.

    Attributes
    ----------
    name : str
    robot : int or None
    angles : tuple of four float, or None
    beliefs : list of StoredBelief
        By time.
    shapes : dict of str to (Shape, float or None)
        By id, with the moment at which each disappears.
    version : int
        Counts the beliefs received, and what became known of them later.
    ahead : list of int
        Times of beliefs whose frames have not come yet.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.robot: int | None = None
        self.angles: tuple[float, float, float, float] | None = None
        self.beliefs: list[StoredBelief] = []
        self.shapes: dict[str, tuple[Shape, float | None]] = {}
        self.version = 0
        self.ahead: list[int] = []

    def belief_at(self, time: int) -> StoredBelief | None:
        """Return the belief in effect at a time: the last one that is not later."""
        index = bisect.bisect_right(self.beliefs, time, key=lambda belief: belief.time)
        return self.beliefs[index - 1] if index else None

    def series(self) -> list[list[float | None]]:
        """Return entropy, probability of the greatest cell and of the true one, by time."""
        return [
            [
                belief.time,
                round(belief.entropy, 4),
                round(belief.peak, 4),
                None if belief.truth is None else round(belief.truth, 4),
            ]
            for belief in self.beliefs
        ]


class OverlayStore:
    """Everything that agents show.

    Attributes
    ----------
    sources : dict of str to Source
        The one that spoke least recently first.
    shapes_version : int
        Counts the changes of shapes and sensor angles.
    """

    def __init__(self) -> None:
        self.sources: dict[str, Source] = {}
        self.shapes_version = 0

    def clear(self) -> None:
        """Clear all overlays, as when the simulator is reset."""
        self.sources.clear()
        self.shapes_version += 1

    def receive(
        self,
        message: OverlayMessage,
        *,
        now: float,
        time: int = 0,
        lab: Lab | None = None,
        place_of: PlaceOf = lambda robot, time: None,
    ) -> Source:
        """Process a message.

        Parameters
        ----------
        message : OverlayMessage
        now : float
            Seconds of any clock that does not go back.
        time : int
            Simulated cycles at this moment, for messages that do not say theirs.
        lab : Lab or None
        place_of : callable
            Tells where a robot really was at a time, in units, or None: the true cell is compared with.

        Returns
        -------
        Source
            Whose it was.
        """
        source = self.sources.pop(message.source, None) or Source(message.source)
        self.sources[message.source] = source
        while len(self.sources) > MOST_SOURCES:
            del self.sources[next(iter(self.sources))]
            self.shapes_version += 1
        if message.clear:
            source.beliefs.clear()
            source.ahead.clear()
            source.shapes.clear()
        if message.robot is not None:
            source.robot = message.robot
        if message.clear or message.remove or message.shapes or message.angles != source.angles:
            self.shapes_version += 1
        source.angles = message.angles or source.angles
        for shape_id in message.remove:
            source.shapes.pop(shape_id, None)
        for shape in message.shapes:
            source.shapes.pop(shape.id, None)
            source.shapes[shape.id] = (shape, None if shape.ttl is None else now + shape.ttl)
        self._limit_shapes(source)
        if message.belief is not None:
            then = time if message.time is None else message.time
            belief = _stored(message.belief, then)
            if then > time:
                source.ahead = [*source.ahead, then][-MOST_BELIEFS:]
            else:
                belief = _compared(belief, source.robot, lab, place_of)
            self._keep(source, belief)
        return source

    def settle(self, time: int, lab: Lab | None, place_of: PlaceOf) -> None:
        """Compare beliefs that were ahead of the frames with the truth of their own time, once it is there.

        Parameters
        ----------
        time : int
            Time of the newest frame.
        lab : Lab or None
        place_of : callable
            As for `receive`.
        """
        for source in self.sources.values():
            due = [then for then in source.ahead if then <= time]
            if not due:
                continue
            source.ahead = [then for then in source.ahead if then > time]
            source.beliefs = [
                _compared(belief, source.robot, lab, place_of) if belief.time in due else belief
                for belief in source.beliefs
            ]
            source.version += 1

    def expire(self, now: float) -> None:
        """Remove the shapes whose time is over."""
        for source in self.sources.values():
            over = [name for name, (_, end) in source.shapes.items() if end is not None and end <= now]
            for name in over:
                del source.shapes[name]
            self.shapes_version += bool(over)

    def shape_documents(self) -> list[dict[str, Any]]:
        """Write all shapes for the page, those of the source that spoke last at the end."""
        return [
            {
                "source": source.name,
                "robot": source.robot,
                "kind": _KIND_NAMES[type(shape)],
                **{
                    field.name: getattr(shape, field.name)
                    for field in dataclasses.fields(shape)
                    if field.name != "ttl"
                },
            }
            for source in self.sources.values()
            for shape, _ in source.shapes.values()
        ]

    def _limit_shapes(self, source: Source) -> None:
        while len(source.shapes) > MOST_SHAPES:
            del source.shapes[next(iter(source.shapes))]

    def _keep(self, source: Source, belief: StoredBelief) -> None:
        beliefs = source.beliefs
        # Late datagrams replace what is there for their time; they never break the order.
        index = bisect.bisect_left(beliefs, belief.time, key=lambda kept: kept.time)
        beliefs[index : index + (index < len(beliefs) and beliefs[index].time == belief.time)] = [belief]
        source.version += 1
        if len(beliefs) > MOST_BELIEFS:
            _thin(source)
        if sum(kept.levels.nbytes for kept in beliefs) > MOST_BELIEF_BYTES // 4 or len(self.sources) > 1:
            self._limit_bytes()

    def _limit_bytes(self) -> None:
        sizes = {name: sum(kept.levels.nbytes for kept in s.beliefs) for name, s in self.sources.items()}
        while sum(sizes.values()) > MOST_BELIEF_BYTES:
            name = max(sizes, key=lambda key: sizes[key])
            _thin(self.sources[name])
            sizes[name] = sum(kept.levels.nbytes for kept in self.sources[name].beliefs)


def _thin(source: Source) -> None:
    half = max(2, len(source.beliefs) // 2)
    source.beliefs = source.beliefs[:half:2] + source.beliefs[half:]


def _stored(belief: GridBelief, time: int) -> StoredBelief:
    cells = belief.cells / belief.cells.sum()
    positive = cells[cells > 0.0]
    peak = float(cells.max())
    return StoredBelief(
        time=time,
        levels=np.round(_LEVELS * np.sqrt(cells / peak)).astype(np.uint16),
        peak=peak,
        entropy=max(0.0, float(-(positive * np.log2(positive)).sum())),
        extent=belief.extent,
    )


def _compared(belief: StoredBelief, robot: int | None, lab: Lab | None, place_of: PlaceOf) -> StoredBelief:
    place = None if robot is None else place_of(robot, belief.time)
    truth = _probability_at(belief.cells(), belief.extent, place, lab)
    return dataclasses.replace(belief, place=place, truth=truth)


def _probability_at(
    cells: NDArray[np.float64],
    extent: tuple[float, float, float, float] | None,
    place: Point | None,
    lab: Lab | None,
) -> float | None:
    if place is None or (lab is None and extent is None):
        return None
    left, bottom, right, top = extent or (0.0, 0.0, lab.width, lab.height)  # type: ignore[union-attr]
    rows, columns = cells.shape
    across = (place[0] - left) / (right - left) * columns
    up = (place[1] - bottom) / (top - bottom) * rows
    if not (0.0 <= across < columns and 0.0 <= up < rows):  # also for nan
        return None
    return float(cells[int(up), int(across)])
