"""Start poses of robots: on the lab's grid, in the centre of a cell, or anywhere."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from agent.drives.clearance import clearance
from ciberrato.errors import LabError
from ciberrato.evaluation.task import Task
from ciberrato.files.start_grid import read_grid
from ciberrato.geometry.angles import short_turn
from ciberrato.labs import find_grid
from ciberrato.localization.belief.lattice import Lattice
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.coordinates import Pose

_LEAST_CLEARANCE = 0.52
_FAR = 3.0
_ROUNDING = 1e-6


def start_pose(task: Task, lattice: Lattice, generator: np.random.Generator) -> Pose:
    """Draw the pose in which the robot of a task starts.

    Parameters
    ----------
    task : Task
    lattice : Lattice
        The lab's.
    generator : numpy Generator

    Returns
    -------
    x, y, heading : float
        Units and radians.

    Raises
    ------
    LabError
        If there is no room for the robot where it is to start.
    """
    if task.start == "grid":
        return _grid_pose(task, lattice)
    if task.start == "centres":
        centred = (np.abs(lattice.x % 2.0 - 1.0) < _ROUNDING) & (np.abs(lattice.y % 2.0 - 1.0) < _ROUNDING)
        possible = np.flatnonzero(centred & (lattice.clearance >= ROBOT_RADIUS - _ROUNDING))
        if not len(possible):
            raise LabError("no cell has room for a robot in its centre", source=task.lab)
        chosen = int(generator.choice(possible))
        turn = math.pi / 2.0 * int(generator.integers(4))
        return float(lattice.x[chosen]), float(lattice.y[chosen]), short_turn(turn)
    return free_pose(lattice, generator, np.ones(lattice.size, np.bool_))


def free_pose(lattice: Lattice, generator: np.random.Generator, allowed: NDArray[np.bool_]) -> Pose:
    """Draw any pose that is free of walls, in squares that are allowed."""
    roomy = np.flatnonzero(allowed & (lattice.clearance >= _LEAST_CLEARANCE + lattice.resolution / 2.0**0.5))
    if not len(roomy):
        raise LabError("no room for a robot; check the walls", source="lab")
    chosen = int(generator.choice(roomy))
    shift = generator.uniform(-0.5, 0.5, 2) * lattice.resolution
    turn = generator.uniform(-math.pi, math.pi)
    return float(lattice.x[chosen] + shift[0]), float(lattice.y[chosen] + shift[1]), float(turn)


def elsewhere(lattice: Lattice, pose: NDArray[np.float64], generator: np.random.Generator) -> Pose:
    """Draw a free pose away from another."""
    return free_pose(lattice, generator, np.hypot(lattice.x - pose[0], lattice.y - pose[1]) > _FAR)


def reachable(lattice: Lattice, start: Pose) -> NDArray[np.bool_]:
    """Return the squares that can be reached from a pose; shape (squares,)."""
    rooms = _rooms(lattice)
    away = np.where(rooms >= 0, np.hypot(lattice.x - start[0], lattice.y - start[1]), np.inf)
    return np.asarray(rooms == rooms[away.argmin()])


@functools.lru_cache(maxsize=8)
def _rooms(lattice: Lattice) -> NDArray[np.int64]:
    """Return the room that each square belongs to, by number; -1 where the robot does not fit."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    free = np.append(lattice.clearance >= ROBOT_RADIUS - _ROUNDING, False)
    squares = np.arange(lattice.size)
    pairs = []
    for dx, dy in ((1, 0), (0, 1)):
        beside = lattice.neighbours(dx, dy)[: lattice.size]
        joined = free[squares] & free[beside]
        pairs.append((squares[joined], beside[joined]))
    # The graph routines of scipy 1.11 take no other integers.
    one, other = (np.concatenate(side).astype(np.int32) for side in zip(*pairs, strict=True))
    graph = coo_array((np.ones(len(one), np.bool_), (one, other)), shape=(lattice.size, lattice.size))
    _, labels = connected_components(graph, directed=False)
    return np.where(free[: lattice.size], labels, -1)


def _grid_pose(task: Task, lattice: Lattice) -> Pose:
    grid = read_grid(find_grid(task.lab if task.grid is None else task.grid))
    positions = [
        position
        for position in grid.positions
        if clearance(lattice, np.array([position.x]), np.array([position.y]))[0] >= ROBOT_RADIUS - _ROUNDING
    ]
    if not positions:
        raise LabError("its start grid has no place that is free of walls", source=task.lab)
    position = positions[task.seed % len(positions)]
    return position.x, position.y, math.radians(position.direction_deg)
