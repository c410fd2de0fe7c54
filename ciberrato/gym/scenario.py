"""Scenarios from which episodes are drawn: labs, starts and noise; for one environment and for many."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ciberrato.errors import UsageError
from ciberrato.files.lab import read_lab
from ciberrato.files.start_grid import read_grid
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_grid, find_lab
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.reprs import short_repr
from ciberrato.world.lab import CELL_SIZE, Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.scoring.control import Control
from simulator_stub.world.world import World

Start = tuple[float, float, float]
"""x, y in units and direction in degrees."""
GRID, FREE, CIRCUIT = "grid", "free", "circuit"
STARTS = (GRID, FREE, CIRCUIT)
_TRIES = 10_000
_REQUESTABLE = (
    *("obstacle_requestable", "beacon_requestable", "ground_requestable"),
    *("compass_requestable", "collision_requestable"),
)
_NOISES = ("motors_noise", "obstacle_noise", "compass_noise", "beacon_noise", "gps_linear_noise")


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """One episode as it was drawn.

    Attributes
    ----------
    number : int
        Number of the lab in the scenario.
    lab : Lab
    start : (float, float, float)
        x, y in units and direction in degrees.
    parameters : Parameters
    """

    __repr__ = short_repr

    number: int
    lab: Lab
    start: Start
    parameters: Parameters


class Scenario:
    """Draws episodes.

    Parameters
    ----------
    labs : str, Lab, or sequence of them
        Names of labs that ship, files, or labs; an episode is in any of them.
    starts : str or sequence of (x, y, degrees)
        "grid": the positions of the start grid of the same name; "free": anywhere outside walls, in any
        direction; "circuit": centres of cells from which a circuit of scoring mode 1 begins, to the right.
    noise : float or (float, float)
        Factor of the deviations of the parameters, or the range from which it is drawn.
    parameters : Parameters
    time_limit : int
        Cycles of an episode.

    Raises
    ------
    UsageError
        Something of this cannot be used.
    """

    def __init__(
        self,
        labs: str | Lab | Sequence[str | Lab],
        starts: str | Sequence[Start],
        noise: float | tuple[float, float],
        parameters: Parameters,
        time_limit: int,
    ) -> None:
        listed = list(labs) if isinstance(labs, Sequence) and not isinstance(labs, str) else [labs]
        if not listed:
            raise UsageError("labs: there must be one at least")
        for one in listed:
            if not isinstance(one, str | os.PathLike | Lab):
                raise UsageError(f"labs: {one!r:.60} is neither a name, nor a file, nor a Lab")
        if isinstance(time_limit, bool) or not isinstance(time_limit, int) or time_limit < 1:
            raise UsageError(f"time_limit: {time_limit!r:.60} is no positive number of cycles")
        if not isinstance(parameters, Parameters):
            raise UsageError(f"parameters: {parameters!r:.60} are no Parameters")
        try:
            low, high = np.broadcast_to(np.asarray(noise, np.float64), 2).tolist()
        except (TypeError, ValueError):
            low = high = math.nan
        if not 0.0 <= low <= high < float("inf"):
            raise UsageError(f"noise: {noise!r:.60} is neither a factor of at least 0 nor a range of them")
        self.labs = tuple(one if isinstance(one, Lab) else read_lab(find_lab(one)) for one in listed)
        self.names = tuple(one.name if isinstance(one, Lab) else os.fspath(one) for one in listed)
        self.noise = (float(low), float(high))
        # As in a batch, what robots would have to ask for is always there.
        given: dict[str, Any] = dict.fromkeys(_REQUESTABLE, False)
        self.parameters = replace(parameters, sim_time=time_limit, compass_sensor=True, **given)
        self._places: list[list[Start] | None] = []
        self._walls = [WallMap.from_lab(lab) for lab in self.labs]
        self._solid = [_solid(walls) for walls in self._walls]
        for one, lab in zip(listed, self.labs, strict=True):
            self._places.append(_places(one, lab, starts))

    def draw(self, generator: np.random.Generator, options: Mapping[str, Any] | None = None) -> Episode:
        """Draw an episode.

        Parameters
        ----------
        generator : numpy.random.Generator
        options : mapping, optional
            ``lab``: name of one of the scenario's labs; ``start``: x, y, degrees; instead of drawn ones.

        Returns
        -------
        Episode
        """
        asked = dict(options or {})
        number = 0
        if "lab" in asked:
            name = asked.pop("lab")
            if name not in self.names:
                raise UsageError(f"lab: {name!r} is not one of {', '.join(self.names)}")
            number = self.names.index(name)
        elif len(self.labs) > 1:
            number = int(generator.integers(len(self.labs)))
        wanted = asked.pop("start", None)
        if asked:
            raise UsageError(f"options: unknown {', '.join(map(str, asked))}; the options are lab and start")
        start = self._start(number, generator) if wanted is None else _start(wanted)
        parameters = self.parameters
        low, high = self.noise
        if (low, high) != (1.0, 1.0):
            factor = low if low == high else float(generator.uniform(low, high))
            parameters = scaled(parameters, factor)
        return Episode(number=number, lab=self.labs[number], start=start, parameters=parameters)

    def _start(self, number: int, generator: np.random.Generator) -> Start:
        places = self._places[number]
        if places is not None:
            return places[int(generator.integers(len(places)))] if len(places) > 1 else places[0]
        lab, walls, solid = self.labs[number], self._walls[number], self._solid[number]
        reach = (lab.width - ROBOT_RADIUS, lab.height - ROBOT_RADIUS)
        for _ in range(_TRIES):
            x, y = (float(generator.uniform(ROBOT_RADIUS, most)) for most in reach)
            if not walls.touches(x, y, ROBOT_RADIUS) and not solid.point_in_polygons(x, y):
                return (x, y, float(generator.uniform(-180.0, 180.0)))
        raise UsageError(f"lab {self.names[number]}: no free place for a robot was found")


def _solid(walls: WallMap) -> WallMap:
    """Remove polygons that are too slim for a robot to be inside them without touching their faces."""
    across = 2.0 * ROBOT_RADIUS
    roomy = [one for one in walls.polygons if len(one) and np.ptp(one, axis=0).min() >= across]
    return replace(walls, polygons=tuple(roomy))


def scaled(parameters: Parameters, factor: float) -> Parameters:
    """Multiply all standard deviations by a factor."""
    return replace(
        parameters, **dict[str, Any]((name, factor * getattr(parameters, name)) for name in _NOISES)
    )


def _places(name: str | Lab, lab: Lab, starts: str | Sequence[Start]) -> list[Start] | None:
    """List the starts in a lab; None for anywhere."""
    if not isinstance(starts, str):
        if not isinstance(starts, Sequence | np.ndarray):
            raise UsageError(f"starts: {starts!r:.60} is none of {', '.join(STARTS)}, nor are they poses")
        found = [_start(start) for start in starts]
    elif starts == FREE:
        return None
    elif starts == GRID:
        if isinstance(name, Lab):
            raise UsageError(f"lab {lab.name!r} has no start grid: name starts, or 'free'")
        found = [(place.x, place.y, place.direction_deg) for place in read_grid(find_grid(name)).positions]
    elif starts == CIRCUIT:
        control = Control(World.build(lab, StartGrid(), Parameters()))
        centres = [
            (CELL_SIZE * (column + 0.5), CELL_SIZE * (row + 0.5))
            for row in range(lab.rows)
            for column in range(lab.columns)
        ]
        found = [(x, y, 0.0) for x, y in centres if control.find_circuit(x, y)]
    else:
        raise UsageError(f"starts: {starts!r:.60} is none of {', '.join(STARTS)}, nor are they poses")
    if not found:
        raise UsageError(f"lab {lab.name!r}: there is no start of the kind {starts!r}")
    return found


def _start(values: Any) -> Start:
    try:
        numbers = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise UsageError(f"start: {values!r:.60} is not x, y in units and a direction in degrees")
    x, y, direction = numbers.tolist()
    return (x, y, direction)
