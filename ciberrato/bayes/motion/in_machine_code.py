"""Turn, drive, turn over all states in machine code: the prediction of `TurnDriveTurn` by two passes.

The first turns each place's headings and lays the places of a row side by side, heading by heading; the
second drives and turns again, row by row. A turn's matrix is mostly zeros, which are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import floats
from ciberrato.bayes.motion.inputs import check_belief
from ciberrato.bayes.motion.lattice import LatticeKernels
from ciberrato.bayes.motion.passes import turn_band
from ciberrato.bayes.motion.selected import States


def predict_compiled(
    belief: ArrayLike,
    shape: tuple[int, ...],
    free: BoolArray | None,
    turns: Sequence[tuple[float, float]],
    kernels: LatticeKernels,
    work: dict[Any, FloatArray],
) -> FloatArray:
    """Return the belief after a turn, a drive and a turn, off numpy's by 1e-14 of the greatest entry.

    Parameters
    ----------
    belief : array_like, shape (x, y, heading)
        Checked as by `check_belief`.
    shape : tuple of int
    free : BoolArray, shape (x, y), optional
        Mass that ends elsewhere is lost.
    turns : two pairs (turn, sigma)
        In heading cells.
    kernels : LatticeKernels
        One for each heading.
    work : dict
        Holds an array from call to call: fresh ones of this size cost page faults.
    """
    values: FloatArray = np.ascontiguousarray(floats(belief))
    if values.shape != tuple(shape):
        check_belief(values, shape)
    loops: Any = compiled.kernels(values.size)
    drives = _turned_first(values, shape, free, turns, kernels, work, 1.0)
    result: FloatArray = np.empty(shape, dtype=values.dtype)
    flat = result.ravel()
    compiled.share(
        lambda begin, end: loops.drive_and_turn(*drives, flat, begin, end),
        shape[0],
        values.size,
    )
    return result


def step_compiled(
    belief: FloatArray,
    factor: float,
    out: FloatArray,
    free: BoolArray | None,
    turns: Sequence[tuple[float, float]],
    kernels: LatticeKernels,
    scan: tuple[Any, ...],
    limits: tuple[float, ...],
    work: dict[Any, FloatArray],
) -> tuple[float, int]:
    """Predict a belief times a factor, and multiply it by a scan's likelihood, in two passes over memory.

    Parameters
    ----------
    belief, out : FloatArray, shape (x, y, heading)
        Contiguous, of one precision; not the same.
    factor : float
        The belief is multiplied by it.
    free, turns, kernels, work
        As of `predict_compiled`.
    scan : tuple
        Arguments of `ciberrato.bayes.scan_loops.scan_places`, up to the last heading.
    limits : tuple of float
        Arguments of `ciberrato.bayes.product_loops.products`, from the highest score on.

    Returns
    -------
    (float, int)
        Sum of the products, and how many are too small though their states are possible.
    """
    loops: Any = compiled.kernels(belief.size)
    drives = _turned_first(belief, belief.shape, free, turns, kernels, work, factor)
    flat = out.reshape(-1)
    parts = compiled.share(
        lambda begin, end: loops.drive_and_correct(drives, scan[:-1], scan[-1], limits, flat, begin, end),
        len(belief),
        belief.size,
    )
    wrong = any(part[2] for part in parts)
    return math.nan if wrong else math.fsum(part[0] for part in parts), int(sum(part[1] for part in parts))


def _turned_first(
    values: FloatArray,
    shape: tuple[int, ...],
    free: BoolArray | None,
    turns: Sequence[tuple[float, float]],
    kernels: LatticeKernels,
    work: dict[Any, FloatArray],
    factor: float,
) -> tuple[Any, ...]:
    """Turn a belief times a factor; return what the drive takes, up to the turn after it."""
    loops: Any = compiled.kernels(values.size)
    rows, columns, headings = shape
    kind = values.dtype
    (first, before), (last, after) = (turn_band(headings, *turn) for turn in turns)
    weights = (before * factor).astype(kind)
    order = np.argsort(kernels.kernel, kind="stable")
    begins = np.searchsorted(kernels.kernel[order], np.arange(headings + 1))
    cells, shares = kernels.cells[order], kernels.weights[order].astype(kind)
    margin = -(-int(np.abs(cells[:, 1]).max(initial=0)) // loops.LANES) * loops.LANES
    wide = 2 * margin + -(-columns // loops.STRIP) * loops.STRIP
    turned = _turned(work, rows * headings * wide, kind)
    flat = values.ravel()
    wrong = compiled.share(
        lambda begin, end: int(loops.turn_rows(flat, shape, weights, first, turned, margin, begin, end)),
        rows,
        values.size,
    )
    if any(wrong):
        check_belief(values, shape)
    inside = np.ones((rows, columns), dtype=bool) if free is None else free
    return turned, shape, margin, cells, shares, begins, inside, after.astype(kind), last


def predict_states_compiled(
    states: IntArray,
    masses: FloatArray,
    shape: tuple[int, ...],
    free: BoolArray,
    turns: Sequence[tuple[float, float]],
    kernels: Callable[[IntArray], LatticeKernels],
    skip: float,
) -> States:
    """Return listed states after a turn, a drive and a turn, off numpy's by 1e-14 of the greatest.

    Parameters
    ----------
    states, masses, free, skip
        As of `selected.turn_drive_turn`.
    shape : tuple of int
    turns : two pairs (turn, sigma)
        In heading cells.
    kernels : callable
        Numbers of headings -> kernels of these.
    """
    loops: Any = compiled.kernels(math.prod(shape))
    headings = shape[2]
    (first, before), (last, after) = (turn_band(headings, *turn) for turn in turns)
    states = np.ascontiguousarray(states, dtype=np.int64)
    masses = np.ascontiguousarray(masses, dtype=np.float64)
    allowed = 0.5 * skip * float(masses.sum())
    place, heading, mass, left_out = loops.turn_states(states, masses, headings, before, first, allowed)
    used = np.zeros(headings, dtype=bool)
    used[heading] = True
    moves = kernels(np.flatnonzero(used))
    moved, arrived, rest = loops.drive_states(
        place, heading, mass, shape, free, used, *moves, after, last, allowed
    )
    return States(moved, arrived, left_out + rest)


def _turned(work: dict[Any, FloatArray], size: int, kind: Any) -> FloatArray:
    """Return an array of so many numbers, which begins with a cache line; the last one, if it is the same.

    At first it is zero, and so its margins stay.
    """
    key = size, kind
    if key not in work:
        work.clear()
        room = np.zeros(size + 64 // kind.itemsize, dtype=kind)
        begin = -room.ctypes.data % 64 // kind.itemsize
        work[key] = room[begin : begin + size]
    return work[key]
