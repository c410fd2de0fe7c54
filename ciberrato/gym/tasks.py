"""Tasks: what an agent observes, what it is rewarded for, and when an episode ends.

A task works on arrays, world by world, so that one environment and many are the same. Observations are
single precision, in the units of the simulator's messages; `Task.columns` says what each number is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.errors import UsageError
from ciberrato.gym.scenario import Episode, Scenario
from ciberrato.gym.signals import END, RETURNING, VISITING, Signals
from ciberrato.infrared.model import SATURATION
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.scoring.circuits import NODE_REWARD
from simulator_stub.scoring.control import Control
from simulator_stub.scoring.targets import TARGET_REWARD
from simulator_stub.world.world import World

HOME = 0.5
"""Units from the start at which the environment lights the EndLed of a robot that returns."""
_SIGMAS = 10.0
"""Standard deviations of noise that the bounds of IR readings leave room for; readings beyond are cut."""
_DEGREES = np.arange(-180, 181)
_COSINES = np.array([math.cos(math.radians(degrees)) for degrees in _DEGREES], np.float32)
_SINES = np.array([math.sin(math.radians(degrees)) for degrees in _DEGREES], np.float32)


class Column(NamedTuple):
    """One number of an observation.

    Attributes
    ----------
    name, unit : str
    low, high : float
    """

    name: str
    unit: str
    low: float
    high: float

    def __repr__(self) -> str:
        return short_repr(self)


class Outcome(NamedTuple):
    """Outcome of a cycle; arrays of shape (n,).

    Attributes
    ----------
    reward : array
    terminated, success : array of bool
    """

    reward: Floats
    terminated: Booleans
    success: Booleans

    def __repr__(self) -> str:
        return short_repr(self)


class Task:
    """One task for n worlds.

    Parameters
    ----------
    scenario : Scenario
    worlds : int
    """

    mode: ClassVar[int]
    """Scoring mode of the simulations."""
    labs: ClassVar[tuple[str, ...]] = ("maze",)
    starts: ClassVar[str] = "grid"

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        self.worlds = worlds
        self.targets = max(len(lab.targets) for lab in scenario.labs)
        deviation = scenario.parameters.obstacle_noise * scenario.noise[1]
        # Readings are rounded to tenths, so a bound of tenths is one that they can reach.
        self.infrared_bounds = (
            -math.ceil(10.0 * _SIGMAS * deviation) / 10.0,
            SATURATION + math.ceil(10.0 * _SIGMAS * deviation) / 10.0,
        )
        self._score: Integers = np.zeros(worlds, np.int64)
        self._width = len(self.columns())

    def columns(self) -> list[Column]:
        """Return the names of an observation's numbers."""
        infrared = [Column(f"IR sensor {number}", "1/unit", *self.infrared_bounds) for number in range(4)]
        return [
            *infrared,
            Column("cosine of the compass", "", -1.0, 1.0),
            Column("sine of the compass", "", -1.0, 1.0),
            Column("collision", "0 or 1", 0.0, 1.0),
        ]

    def begin(self, which: Integers, signals: Signals, episodes: Sequence[Episode]) -> None:
        """Begin episodes in some worlds."""
        self._score[which] = 0

    def leds(self, signals: Signals) -> Booleans | None:
        """Return which LEDs are on in the coming cycle, shape (n, 3); None if none ever is."""
        return None

    def advance(self, signals: Signals, commands: Floats, active: Booleans) -> Outcome:
        """Compute rewards and ends after a cycle.

        Parameters
        ----------
        signals : Signals
            After it.
        commands : array, shape (n, 2)
            Commands of the left and right motors in it, in units per cycle.
        active : array of bool, shape (n,)
            Worlds whose outcome counts.

        Returns
        -------
        Outcome
        """
        raise NotImplementedError

    def observe(self, signals: Signals) -> NDArray[np.float32]:
        """Return the observations, shape (n, columns)."""
        seen = np.empty((self.worlds, self._width), np.float32)
        np.clip(signals.infrared, *self.infrared_bounds, out=seen[:, :4], casting="same_kind")
        heading = signals.compass.astype(np.int64) + 180
        seen[:, 4] = _COSINES[heading]
        seen[:, 5] = _SINES[heading]
        seen[:, 6] = signals.collision
        return seen

    def close(self) -> None:
        """Close what the task holds."""


class Navigate(Task):
    """Scoring mode 0: visit all targets, and drive home.

    The environment works the LEDs, as a robot does that trusts its ground sensor: VisitingLed in a target
    that was not visited, ReturningLed in a target when all are visited, EndLed at home. The rewards of an
    episode add up to (what the score is at the beginning - what it is at the end) / 100: a perfect run is
    worth one more than there are targets.
    """

    mode = 0

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        super().__init__(scenario, worlds)
        self._home = np.zeros((worlds, 2))

    def columns(self) -> list[Column]:
        """Return the names of an observation's numbers."""
        return [
            *super().columns(),
            Column("ground: number of the target below", "-1 for none", -1.0, max(self.targets - 1.0, 0.0)),
            Column("targets to be visited yet", "share of all", 0.0, 1.0),
        ]

    def begin(self, which: Integers, signals: Signals, episodes: Sequence[Episode]) -> None:
        """Begin episodes in some worlds."""
        super().begin(which, signals, episodes)
        targets = np.array([len(episode.lab.targets) for episode in episodes])
        self._score[which] = TARGET_REWARD * (1 + targets)
        self._home[which] = np.array([episode.start[:2] for episode in episodes])

    def leds(self, signals: Signals) -> Booleans | None:
        """Return the LEDs of the coming cycle."""
        lit = np.zeros((self.worlds, 3), np.bool_)
        visited = signals.visited
        assert visited is not None
        inside = np.flatnonzero(signals.ground >= 0)
        if inside.size:
            lit[inside, VISITING] = ~visited[inside, signals.ground[inside]]
            lit[inside, RETURNING] = visited[inside].all(axis=1) & ~signals.returning[inside]
        homewards = np.flatnonzero(signals.returning)
        if homewards.size:
            away = signals.poses[homewards, :2] - self._home[homewards]
            lit[homewards, END] = (away * away).sum(axis=1) < HOME * HOME
        return lit

    def advance(self, signals: Signals, commands: Floats, active: Booleans) -> Outcome:
        """Compute rewards and ends after a cycle."""
        reward = (self._score - signals.score) / TARGET_REWARD
        self._score = signals.score.copy()
        return Outcome(reward, signals.finished, signals.finished)

    def observe(self, signals: Signals) -> NDArray[np.float32]:
        """Return the observations."""
        seen = super().observe(signals)
        visited = signals.visited
        assert visited is not None
        seen[:, 7] = signals.ground
        seen[:, 8] = 1.0 - np.add.reduce(visited, axis=1) / self.targets if self.targets else 0.0
        return seen


class Circuit(Task):
    """Scoring mode 1: round and round a circuit; a reward of 1 for each of its cells in its turn.

    A collision costs CollisionWallPenalty / 10. An episode ends with its time; it is a success if a whole
    round was driven.
    """

    mode = 1
    labs = ("corridors",)
    starts = "circuit"

    def __init__(self, scenario: Scenario, worlds: int) -> None:
        super().__init__(scenario, worlds)
        if scenario.parameters.collision_wall_penalty >= NODE_REWARD:
            raise UsageError(
                f"Circuit: CollisionWallPenalty must be below the {NODE_REWARD} points of a cell"
            )
        self._reached = np.zeros(worlds)
        self._round = np.zeros(worlds)

    def begin(self, which: Integers, signals: Signals, episodes: Sequence[Episode]) -> None:
        """Begin episodes in some worlds."""
        super().begin(which, signals, episodes)
        self._reached[which] = 0.0
        self._round[which] = [
            _cells_of_circuit(episode.lab, *episode.start[:2]) or math.inf for episode in episodes
        ]

    def advance(self, signals: Signals, commands: Floats, active: Booleans) -> Outcome:
        """Compute rewards and ends after a cycle."""
        reward = (signals.score - self._score) / NODE_REWARD
        self._score = signals.score.copy()
        # A cell is worth more than a collision costs, so the gain shows that one was reached.
        self._reached += reward > 0.0
        return Outcome(reward, np.zeros(self.worlds, np.bool_), self._reached >= self._round)


@lru_cache(maxsize=1024)
def _cells_of_circuit(lab: Lab, x: float, y: float) -> int:
    return len(Control(World.build(lab, StartGrid(), Parameters())).find_circuit(x, y))
