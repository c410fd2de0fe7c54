"""Signals of a cycle for a task: readings, and facts that only a judge may know; arrays by world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.reprs import short_repr

if TYPE_CHECKING:
    from ciberrato.protocol import Measures
    from simulator_stub.batch import BatchSimulation
    from simulator_stub.simulation import Simulation

END, RETURNING, VISITING = 0, 1, 2
"""Columns of the LEDs."""


@dataclass(slots=True)
class Signals:
    """One cycle of n worlds.

    Attributes
    ----------
    time : array of int, shape (n,)
    infrared : array, shape (n, 4)
        1/units.
    compass : array, shape (n,)
        Degrees.
    ground : array of int, shape (n,)
        Number of the target that the robot is in, -1 for none.
    collision : array of bool, shape (n,)
    score : array of int, shape (n,)
        0 before the first running cycle.
    finished, returning : array of bool, shape (n,)
        States of the robots.
    visited : array of bool, shape (n, targets), or None
        Mask of the targets that count as visited, also those that a lab does not have; None where it does not
        matter.
    poses : array, shape (n, 3)
        True x, y in units and heading in radians.
    """

    __repr__ = short_repr

    time: Integers
    infrared: Floats
    compass: Floats
    ground: Integers
    collision: Booleans
    score: Integers
    finished: Booleans
    returning: Booleans
    visited: Booleans | None
    poses: Floats


def of_simulation(simulation: Simulation, measures: Measures, targets: int) -> Signals:
    """Return the signals of a single simulation with one robot.

    Parameters
    ----------
    simulation : Simulation
    measures : Measures
        Measures of its last cycle.
    targets : int
        Most targets of a lab.
    """
    robot = simulation.robots[0]
    there = len(simulation.world.lab.targets)
    visited = [number >= there or number in robot.visited for number in range(targets)]
    state = robot.state.value
    return Signals(
        time=np.array([measures.time]),
        infrared=np.array([measures.infrared], np.float64),
        compass=np.array([math.nan if measures.compass is None else measures.compass]),
        ground=np.array([measures.ground], np.int64),
        collision=np.array([measures.collision], np.bool_),
        score=np.array([robot.score]),
        finished=np.array([state == "Finished"]),
        returning=np.array([state == "Returning"]),
        visited=np.array([visited], np.bool_).reshape(1, targets),
        poses=simulation.poses(),
    )


def of_batch(batch: BatchSimulation) -> Signals:
    """Return the signals of a batch that counts scores."""
    readings, scores = batch.readings, batch.scores
    assert scores is not None
    assert readings.score is not None
    return Signals(
        time=readings.time,
        infrared=readings.infrared,
        compass=readings.compass,
        ground=readings.ground,
        collision=readings.collision,
        score=readings.score,
        finished=scores.finished,
        returning=scores.returning,
        visited=getattr(scores, "visited", None),
        poses=batch.poses(),
    )
