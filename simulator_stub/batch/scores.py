"""Scores of many worlds: mode 0 (targets, and the way home) and mode 1 (circuits), as in `scoring`.

Each function is told after the sensors, as `simulator_stub.scoring.Scoring.update` is, and then which robots
change their state, as `simulator_stub.robot_transitions` does. Ways home are computed one robot at a time:
cycles take longer while robots are returning.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.geometry.shortest_paths import PathsFrom, disc_paths
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import CELL_SIZE, Lab
from simulator_stub.batch.arrays import inside
from simulator_stub.batch.plan import BatchPlan
from simulator_stub.batch.state import Arrays, BatchState
from simulator_stub.scoring.circuits import NODE_REWARD, Circuit
from simulator_stub.scoring.control import Control
from simulator_stub.scoring.targets import (
    AWAY_PENALTY,
    FAR,
    NOT_FINISHED_PENALTY,
    TARGET_REWARD,
    share_of_way,
)
from simulator_stub.world.world import World

END, RETURNING, VISITING = 0, 1, 2
"""Columns of the LEDs."""


@dataclass(kw_only=True)
class BatchScores(Arrays):
    """Scores and what they hang on; arrays have the shape (worlds,) where nothing else is said.

    Attributes
    ----------
    score, arrival_time, returning_time : array of int
        As robots' statuses have them.
    returning, finished : array of bool
        States of robots; the others are running.
    leds : array of bool, shape (worlds, 3)
        EndLed, ReturningLed, VisitingLed.
    """

    score: Integers
    arrival_time: Integers
    returning_time: Integers
    returning: Booleans
    finished: Booleans
    leds: Booleans

    @staticmethod
    def basics(worlds: int) -> dict[str, Any]:
        """Create arrays for all worlds."""
        arrays: dict[str, Any] = {
            name: np.zeros(worlds, np.int64) for name in ("score", "arrival_time", "returning_time")
        }
        arrays |= {name: np.zeros(worlds, np.bool_) for name in ("returning", "finished")}
        return arrays | {"leds": np.zeros((worlds, 3), np.bool_)}

    def begin(self, plan: BatchPlan, state: BatchState, worlds: Integers) -> None:
        """Reset worlds, with robots on their start positions."""
        for array in (self.score, self.arrival_time, self.returning_time):
            array[worlds] = 0
        self.returning[worlds] = self.finished[worlds] = False
        self.leds[worlds] = False

    def count(self, plan: BatchPlan, state: BatchState, running: Booleans, told: bool) -> None:
        """Count one cycle of robots that run or return.

        Parameters
        ----------
        plan : BatchPlan
        state : BatchState
            After the move.
        running : array of bool
            Worlds in which time passes.
        told : bool
            Whether the LEDs were commanded in this cycle.
        """
        raise NotImplementedError

    def change_states(self, plan: BatchPlan, state: BatchState) -> None:
        """Apply LEDs that end runs."""
        self.finished |= self.leds[:, END]


@dataclass(kw_only=True)
class TargetScores(BatchScores):
    """Mode 0.

    Attributes
    ----------
    points : array of int
        Penalties, less what targets gave.
    visited : array of bool, shape (worlds, targets)
        Targets that were visited; those that the world's lab does not have count as visited.
    arrival_distance : array
        Way home from where the return began; units.
    departure : array of int
        Time at which the return began.
    """

    points: Integers
    visited: Booleans
    arrival_distance: Floats
    departure: Integers

    @classmethod
    def empty(cls, plan: BatchPlan) -> TargetScores:
        """Create arrays for all worlds."""
        worlds = plan.worlds
        most = max(len(lab.targets) for lab in plan.labs)
        return cls(
            **cls.basics(worlds),
            points=np.zeros(worlds, np.int64),
            visited=np.zeros((worlds, most), np.bool_),
            arrival_distance=np.zeros(worlds),
            departure=np.zeros(worlds, np.int64),
        )

    def begin(self, plan: BatchPlan, state: BatchState, worlds: Integers) -> None:
        """Reset worlds."""
        super().begin(plan, state, worlds)
        self.arrival_distance[worlds] = 0.0
        self.departure[worlds] = 0
        targets = np.array([len(lab.targets) for lab in plan.labs])[state.lab[worlds]]
        self.points[worlds] = TARGET_REWARD * (1 + targets)
        self.visited[worlds] = np.arange(self.visited.shape[1]) >= targets[:, np.newaxis]

    @property
    def unvisited(self) -> Integers:
        """Return how many targets are not visited yet."""
        return np.asarray((~self.visited).sum(axis=1))

    def count(self, plan: BatchPlan, state: BatchState, running: Booleans, told: bool) -> None:
        """Count one cycle."""
        moving = running & ~self.finished
        returning = moving & self.returning
        self.points[moving] += np.where(state.collision_begins, state.wall_penalty, 0)[moving]
        self.score[moving] = self.points[moving]
        unlucky = returning & (state.time == state.sim_time) & ~self.leds[:, END]
        self.points[unlucky] += NOT_FINISHED_PENALTY
        self.returning_time[returning] = (state.time - self.departure)[returning]
        active = np.flatnonzero(moving & (self.leds.any(axis=1) | self.returning))
        if active.size:
            below = self._below(plan, state, active)
            all_visited = np.asarray(self.visited[active].all(axis=1))
            for world, target, complete in zip(
                active.tolist(), below.tolist(), all_visited.tolist(), strict=True
            ):
                self._count_one(plan, state, world, target, target >= 0 and complete, told)
        early = moving & ~returning & ~self._any_visited(plan, state)
        self.arrival_time[early] = state.time[early]

    def _count_one(
        self, plan: BatchPlan, state: BatchState, world: int, target: int, may_return: bool, told: bool
    ) -> None:
        """Count the cycle of a robot with a LED on, or that returns."""
        end, returning_led, visiting = self.leds[world].tolist()
        if self.returning[world]:
            if told and returning_led and may_return:
                self.arrival_distance[world] = _way_home(plan, state, world)
                self.departure[world] = state.time[world]
            elif visiting:
                self._visit(world, target)
            shown = self._share(plan, state, world)
        elif end and may_return:
            self.arrival_distance[world] = _way_home(plan, state, world)
            self.arrival_time[world] = state.time[world]
            shown = self._share(plan, state, world)
        elif returning_led and may_return:
            self.points[world] -= TARGET_REWARD
            self.arrival_distance[world] = _way_home(plan, state, world)
            self.departure[world] = state.time[world]
            shown = self._share(plan, state, world)
        else:
            shown = 0
            if visiting:
                self._visit(world, target)
                shown = TARGET_REWARD
        self.score[world] = min(int(self.points[world]) + shown, FAR)

    def _visit(self, world: int, target: int) -> None:
        if target < 0:
            self.points[world] += AWAY_PENALTY
        elif not self.visited[world, target]:
            self.visited[world, target] = True
            self.points[world] -= TARGET_REWARD

    def _any_visited(self, plan: BatchPlan, state: BatchState) -> Booleans:
        there = np.array([len(lab.targets) for lab in plan.labs])[state.lab]
        return np.asarray(self.unvisited < there)

    def _below(self, plan: BatchPlan, state: BatchState, worlds: Integers) -> Integers:
        """Return the first targets that robots are in, -1 for none."""
        found = np.empty(worlds.size, np.int64)
        for number, lab in enumerate(plan.labs):
            here = state.lab[worlds] == number
            there = worlds[here]
            found[here] = inside(lab, state.x[there], state.y[there], first=True)
        return found

    def _share(self, plan: BatchPlan, state: BatchState, world: int) -> int:
        return share_of_way(_way_home(plan, state, world), float(self.arrival_distance[world]))

    def change_states(self, plan: BatchPlan, state: BatchState) -> None:
        """Apply LEDs that begin returns and end runs."""
        signals = np.flatnonzero(
            self.leds[:, RETURNING] & ~self.leds[:, END] & ~self.returning & ~self.finished
        )
        if signals.size:
            rightly = (self._below(plan, state, signals) >= 0) & self.visited[signals].all(axis=1)
            self.returning[signals[rightly]] = True
            self.finished[signals[~rightly]] = True
        super().change_states(plan, state)


@dataclass(kw_only=True)
class CircuitScores(BatchScores):
    """Mode 1.

    Attributes
    ----------
    circuit : array of int, shape (worlds, nodes, 2)
        Cells of each world's circuit.
    nodes : array of int
        Number of nodes; 0 where there is no circuit.
    coming : array of int
        The node that gives the next points.
    reward, penalty : array of int
    """

    circuit: Integers
    nodes: Integers
    coming: Integers
    reward: Integers
    penalty: Integers

    @classmethod
    def empty(cls, plan: BatchPlan) -> CircuitScores:
        """Create arrays for all worlds."""
        worlds = plan.worlds
        names = ("nodes", "coming", "reward", "penalty")
        numbers: dict[str, Any] = {name: np.zeros(worlds, np.int64) for name in names}
        return cls(**cls.basics(worlds), circuit=np.zeros((worlds, 1, 2), np.int64), **numbers)

    def begin(self, plan: BatchPlan, state: BatchState, worlds: Integers) -> None:
        """Reset worlds."""
        super().begin(plan, state, worlds)
        self.coming[worlds] = 1
        self.reward[worlds] = self.penalty[worlds] = 0
        for world in worlds.tolist():
            place = float(state.x[world]), float(state.y[world])
            nodes = circuit_from(plan.labs[int(state.lab[world])].world, *_cell(*place))
            missing = len(nodes) - self.circuit.shape[1]
            if missing > 0:
                self.circuit = np.pad(self.circuit, ((0, 0), (0, missing), (0, 0)))
            self.circuit[world, : len(nodes)] = np.array(nodes, np.int64).reshape(-1, 2)
            self.nodes[world] = len(nodes)

    def count(self, plan: BatchPlan, state: BatchState, running: Booleans, told: bool) -> None:
        """Count one cycle."""
        moving = running & ~self.finished
        self.penalty += np.where(moving & state.collision_begins, state.wall_penalty, 0)
        wanted = self.circuit[np.arange(self.nodes.size), self.coming % self.circuit.shape[1]]
        # Cells are cut towards zero, as `simulator_stub.scoring.cells.cell_of` does.
        there = (np.trunc(state.x / CELL_SIZE) == wanted[:, 0]) & (
            np.trunc(state.y / CELL_SIZE) == wanted[:, 1]
        )
        reached = moving & there & (self.nodes > 0)
        self.reward[reached] += NODE_REWARD
        self.coming[reached] += 1
        self.coming[reached & (self.coming >= self.nodes)] = 0
        earned = np.where(self.leds[:, END], 0, self.reward) - self.penalty
        self.score[moving] = earned[moving]


def _cell(x: float, y: float) -> tuple[int, int]:
    return int(x / CELL_SIZE), int(y / CELL_SIZE)


@lru_cache(maxsize=1024)
def circuit_from(world: World, column: int, row: int) -> Circuit:
    """Find the circuit of mode 1 that begins in a cell, to the right; empty if there is none."""
    return Control(world).find_circuit(column * CELL_SIZE, row * CELL_SIZE)


def _way_home(plan: BatchPlan, state: BatchState, world: int) -> float:
    x, y, _ = state.start[world].tolist()
    lab = plan.labs[int(state.lab[world])].world.lab
    return _paths(lab, x, y).length_to(float(state.x[world]), float(state.y[world]))


@lru_cache(maxsize=4096)
def _paths(lab: Lab, x: float, y: float) -> PathsFrom:
    return disc_paths(lab, ROBOT_RADIUS).paths_from(x, y)
