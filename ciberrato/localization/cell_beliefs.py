"""The belief file of a run in all directions: one block for every cell entered, filtered or smoothed.

Filtered, a block is what was known when the robot entered the cell, from the readings so far. Smoothed,
it is what the whole run says about that moment: the filter is run a second time from the end of the run
to its beginning, undoing the motions, and the two beliefs are multiplied (the forward-backward algorithm:
Thrun, Burgard, Fox, *Probabilistic Robotics*, section 2.4; Särkkä, *Bayesian Filtering and Smoothing*,
section 8.1, two-filter form). The states of the one are looked up at the nearest states of the other.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.estimate import PoseEstimate, estimate
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.records import FilterSettings, FilterStep, Input
from ciberrato.localization.tables.pose_tables import PoseTables
from ciberrato.world.lab import CELL_SIZE, Lab
from ciberrato.world.parameters import Parameters

_LEAST = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """The forward belief after a message, as a list of weighted poses."""

    step: FilterStep
    estimate: PoseEstimate
    x: Floats
    y: Floats
    heading: Floats
    weight: Floats


def cell_beliefs(
    lab: Lab,
    tables: PoseTables,
    parameters: Parameters,
    history: Sequence[Input],
    *,
    start: str = "anywhere",
    smooth: bool = False,
    settings: FilterSettings | None = None,
) -> Floats:
    """Compute the blocks of a belief file: the prior, the start cell, then one for every cell entered.

    Parameters
    ----------
    lab : Lab
    tables : PoseTables
    parameters : Parameters
        As announced.
    history : sequence of (Measures, command)
        All messages, each with the command in effect before it.
    start : {"anywhere", "centres"}
        Prior of the start.
    smooth : bool
        Whether every block is to use the whole run. A run in which the filter had to start anew is
        smoothed from its last new start on; before that it is filtered.
    settings : FilterSettings, optional

    Returns
    -------
    array, shape (blocks, rows, columns)
        Marginals over heading and place in the cell; row 0 is the bottom row. Each sums to 1.
    """
    forward = GridFilter(lab, tables, parameters, settings, start=start)
    prior = _cells(lab, tables.lattice.x, tables.lattice.y, forward.belief.square_weights())
    moments: list[_Moment] = []
    restarts: list[int] = []
    for measures, command in history:
        before = len(forward.restarts)
        forward.observe(measures, command)
        if forward.last_step is None:
            continue
        if len(forward.restarts) > before:
            restarts.append(len(moments))
        moments.append(_moment(forward))
    if not moments:
        return prior[np.newaxis]
    blocks = [_cells(lab, moment.x, moment.y, moment.weight) for moment in moments]
    found = [moment.estimate for moment in moments]
    if smooth:
        first = restarts[-1] if restarts else 0
        backward = GridFilter(
            lab,
            tables,
            parameters,
            dataclasses.replace(forward.stage.settings, alarm=math.inf),
            start="anywhere",
        )
        for number in range(len(moments) - 1, first - 1, -1):
            moment = moments[number]
            weight = moment.weight * _look_up(backward.belief, moment.x, moment.y, moment.heading)
            if weight.sum() > 0.0:
                weight /= weight.sum()
                blocks[number] = _cells(lab, moment.x, moment.y, weight)
                found[number] = _at(moment, weight, lab)
            backward.update(moment.step)
            for motion in reversed(moment.step.motions):
                backward.predict(motion, backwards=True)
    return np.array([prior, *(blocks[number] for number in _entries(found))])


def _entries(found: list[PoseEstimate]) -> list[int]:
    """Return the numbers of the first message and of those at which the robot has entered another cell."""
    numbers = [0]
    cell = found[0].cell if found[0].certain else None
    for number, pose in enumerate(found):
        if pose.certain and pose.cell != cell:
            if cell is not None:
                numbers.append(number)
            cell = pose.cell
    return numbers


def _moment(pose_filter: GridFilter) -> _Moment:
    assert pose_filter.last_step is not None
    belief = pose_filter.belief
    bins, squares, weights = belief.listed()
    keep = weights > _LEAST
    bins, squares, weights = bins[keep], squares[keep], weights[keep]
    x, y = belief.places(bins, squares)
    return _Moment(
        step=pose_filter.last_step,
        estimate=estimate(belief),
        x=x,
        y=y,
        heading=belief.headings()[bins],
        weight=weights / weights.sum(),
    )


def _look_up(belief: PoseBelief, x: Floats, y: Floats, heading: Floats) -> Floats:
    """Return the weights of the states nearest to some poses."""
    lattice = belief.lattice
    if belief.dense is None:
        table = np.zeros((belief.bins, lattice.size + 1))
        np.add.at(table, (belief.bin, belief.square), belief.weight)
    else:
        table = belief.dense.astype(np.float64)
        table[:, -1] = 0.0
    row = np.round((heading - belief.heading_offset) / belief.bin_width).astype(np.int64) % belief.bins
    column = np.round((x - belief.offset[row, 0] - lattice.origin[0]) / lattice.resolution).astype(np.int64)
    line = np.round((y - belief.offset[row, 1] - lattice.origin[1]) / lattice.resolution).astype(np.int64)
    column, line = np.clip(column, 0, lattice.nx - 1), np.clip(line, 0, lattice.ny - 1)
    return np.asarray(table[row, lattice.index[line * lattice.nx + column]])


def _at(moment: _Moment, weight: Floats, lab: Lab) -> PoseEstimate:
    """Return the pose at a moment by its smoothed weights."""
    peak = int(weight.argmax())
    near = np.hypot(moment.x - moment.x[peak], moment.y - moment.y[peak]) <= 0.5
    near &= np.abs(np.remainder(moment.heading - moment.heading[peak] + math.pi, 2 * math.pi) - math.pi) < 0.2
    total = float(weight[near].sum())
    x, y = float((weight * moment.x)[near].sum()) / total, float((weight * moment.y)[near].sum()) / total
    cell = (min(int(y // 2.0), lab.rows - 1), min(int(x // 2.0), lab.columns - 1))
    return PoseEstimate(x=x, y=y, heading=float(moment.heading[peak]), probability=total, cell=cell)


def _cells(lab: Lab, x: Floats, y: Floats, weights: Floats) -> Floats:
    """Sum up weights by the cell that each place is in."""
    column = np.clip((x // CELL_SIZE).astype(np.int64), 0, lab.columns - 1)
    row = np.clip((y // CELL_SIZE).astype(np.int64), 0, lab.rows - 1)
    cells = np.bincount(row * lab.columns + column, weights, lab.rows * lab.columns)
    return np.asarray(cells.reshape(lab.rows, lab.columns) / cells.sum())
