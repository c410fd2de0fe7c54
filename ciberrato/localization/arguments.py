"""Checks of the pose filter's arguments: each one that is something else is named."""

from __future__ import annotations

import math
from typing import Any

from ciberrato.localization.evidence.start_prior import FORMS, StartPrior
from ciberrato.localization.records import FilterSettings
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

_SENSORS = 4


def check_arguments(
    lab: Any,
    parameters: Any,
    angles: Any,
    start: Any,
    settings: Any,
    wait: Any,
    budget: Any,
    tables: Any,
    clock: Any,
) -> tuple[float, ...]:
    """Refuse arguments of `ciberrato.localization.pose_filter.PoseFilter` that cannot be used.

    Returns
    -------
    tuple of float
        The angles.

    Raises
    ------
    ValueError
        Naming the argument, and what it is.
    """
    if not isinstance(lab, Lab):
        raise ValueError(f"lab: {lab!r:.60} is not a Lab; read_lab(find_lab(NAME)) reads one")
    if not isinstance(parameters, Parameters):
        raise ValueError(f"parameters: {parameters!r:.60} is not a Parameters, as a simulator announces them")
    try:
        found = tuple(float(angle) for angle in angles)
    except (TypeError, ValueError):
        found = ()
    if len(found) != _SENSORS or not all(math.isfinite(angle) for angle in found):
        raise ValueError(f"angles: {angles!r:.60} are not the mounting angles of four IR sensors, in degrees")
    if not isinstance(start, str | StartPrior):
        raise ValueError(f"start: {start!r:.60} is not {FORMS}")
    if settings is not None and not isinstance(settings, FilterSettings):
        raise ValueError(f"settings: {settings!r:.60} is not a FilterSettings")
    if not isinstance(wait, bool):
        raise ValueError(f"wait: {wait!r:.60} is neither True nor False")
    if budget is not None:
        check_seconds("budget", budget)
        if not budget > 0.0:
            raise ValueError(f"budget: {budget!r} seconds leave no time for any message")
    if tables is not None and not (hasattr(tables, "coarse") and hasattr(tables, "fine")):
        raise ValueError(f"tables: {tables!r:.60} is not a TableWorker, nor like one")
    if not callable(clock):
        raise ValueError(f"clock: {clock!r:.60} is no function that returns seconds")
    return found


def check_seconds(name: str, seconds: Any) -> None:
    """Refuse what is no time; ValueError with the name."""
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or math.isnan(seconds):
        raise ValueError(f"{name}: {seconds!r:.60} is not a number of seconds")
