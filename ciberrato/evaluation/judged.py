"""The filter that is judged in a run: the project's own, or one that others wrote."""

from __future__ import annotations

import hashlib
import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np

from agent.drives.registry import DRIVES, drive_kind, parse_drive
from ciberrato.errors import CiberratoError, UsageError
from ciberrato.evaluation.task import BUILT_IN
from ciberrato.localization.belief.estimate import CERTAIN, probability_near
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.physics.kinematics import Command
from ciberrato.plugins import Part, failure, load_part
from ciberrato.protocol import Measures
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

GROUP = "ciberrato.filters"


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSetup:
    """Arguments of a filter's factory.

    Attributes
    ----------
    lab : Lab
    parameters : Parameters
        As announced: noise, latencies, which sensors there are.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    start : {"anywhere", "centres"}
        Prior of the start: none, or that it is a cell's centre with one of four headings.
    generator : numpy Generator
        For the filter alone: a task gives the same run every time.
    """

    __repr__ = short_repr

    lab: Lab
    parameters: Parameters
    angles: tuple[float, float, float, float]
    start: str
    generator: np.random.Generator


class Judged(Protocol):
    """Interface of a filter for `ciberrato.evaluation.record.Record`."""

    @property
    def restarts(self) -> Any:
        """Times at which it began anew."""

    @property
    def given_up(self) -> float:
        """Weight of the states that it gave up as too unlikely."""

    def observe(self, measures: Measures, command: Command | None) -> None:
        """Process a message."""

    def estimate(self) -> Any:
        """Return where the robot is: x, y, heading, probability, certain."""

    def probability_near(self, x: float, y: float, heading: float) -> float | None:
        """Return the probability of the poses around one; None if the filter does not say."""


class BuiltInFilter:
    """The project's filter, as the record asks it."""

    def __init__(self, pose_filter: GridFilter) -> None:
        self._filter = pose_filter
        self.observe = pose_filter.observe
        self.estimate = pose_filter.estimate

    @property
    def restarts(self) -> Any:
        """Times at which it began anew."""
        return self._filter.restarts

    @property
    def given_up(self) -> float:
        """Weight of the states that it gave up as too unlikely."""
        return self._filter.belief.given_up

    def probability_near(self, x: float, y: float, heading: float) -> float | None:
        """Return the probability of the poses around one."""
        return probability_near(self._filter.belief, x, y, heading)


class OwnFilter:
    """A filter that others wrote: what it says is looked at before it counts.

    Parameters
    ----------
    part : Part
        Its value makes the filter from a `FilterSetup`: an object with ``observe(measures, command)`` and
        ``estimate()``; if it likes with ``restarts`` (a list of times) and ``probability_near(x, y,
        heading)``.
    setup : FilterSetup
    """

    given_up = 0.0

    def __init__(self, part: Part, setup: FilterSetup) -> None:
        self._label = part.label
        self._filter: Any = self._asked(part.value, setup)
        for method in ("observe", "estimate"):
            if not callable(getattr(self._filter, method, None)):
                shown = f"{self._filter!r:.60}"
                raise UsageError(f"{part.label}: what it makes is {shown}, which has no method {method}")
        self._estimate: Any = None

    @property
    def restarts(self) -> Any:
        """Times at which it began anew, if it says."""
        return getattr(self._filter, "restarts", ())

    def observe(self, measures: Measures, command: Command | None) -> None:
        """Process a message."""
        self._estimate = None
        self._asked(self._filter.observe, measures, command)

    def estimate(self) -> Any:
        """Return the pose of the robot; the filter is called once per message."""
        if self._estimate is None:
            self._estimate = self._looked_at(self._asked(self._filter.estimate))
        return self._estimate

    def probability_near(self, x: float, y: float, heading: float) -> float | None:
        """Return the probability of the poses around one; None if the filter does not say."""
        if not callable(getattr(self._filter, "probability_near", None)):
            return None
        return float(self._asked(self._filter.probability_near, x, y, heading))

    def _looked_at(self, found: Any) -> Any:
        values = {name: getattr(found, name, None) for name in ("x", "y", "heading", "probability")}
        try:
            numbers = {name: float(value) for name, value in values.items()}  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise UsageError(
                f"{self._label}: its estimate is {found!r:.60}; not x, y, heading and probability"
            ) from None
        if not 0.0 <= numbers["probability"] <= 1.0 + 1e-9:
            raise UsageError(f"{self._label}: {numbers['probability']:g} is not a probability")
        known = all(math.isfinite(number) for number in numbers.values())
        certain = known and bool(getattr(found, "certain", numbers["probability"] > CERTAIN))
        return SimpleNamespace(**numbers, certain=certain)

    def _asked(self, function: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except CiberratoError:
            raise
        except Exception as error:
            raise failure(self._label, error) from None


def load_filter(name: str) -> Part:
    """Find a filter by the name of its entry point, or by ``module:object``; UsageError if there is none."""
    return load_part(
        GROUP,
        name,
        fits=callable,
        wanted="a function that makes a filter from a FilterSetup",
        built_in=[BUILT_IN],
    )


def code_of(filter_name: str, drive: str) -> str:
    """Compute a digest of the sources of a task's filter and drive, where they are the user's own.

    Parameters
    ----------
    filter_name, drive : str
        As in `Task`.

    Returns
    -------
    str
        Hexadecimal; empty if both are the project's own. An outcome is kept for the code that it came from.

    Raises
    ------
    UsageError
        If one of them cannot be loaded.
    """
    parts = []
    if filter_name != BUILT_IN:
        parts.append(load_filter(filter_name).value)
    if drive not in DRIVES:
        name, _ = parse_drive(drive)
        kind = drive_kind(name)
        parts.append(kind.make or kind.home)
    if not parts:
        return ""
    digest = hashlib.sha256()
    for part in parts:
        module = part if isinstance(part, str) else getattr(part, "__module__", "")
        found = inspect.getsourcefile(_module(module)) if module else None
        digest.update(Path(found).read_bytes() if found else repr(part).encode())
    return digest.hexdigest()[:12]


def _module(name: str) -> Any:
    import importlib

    return importlib.import_module(name)
