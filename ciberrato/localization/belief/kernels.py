# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""The pose filter's loops over all states, in machine code made by numba.

The same operations, of the same precision, in the same order as in
`ciberrato.localization.belief.pose_belief`, `ciberrato.localization.belief.reweight`,
`ciberrato.infrared.sweep` and `ciberrato.infrared.cone_scalar`: with numba the numbers are the same to the
last bit, only sooner. Nothing
here may allow the compiler to reorder (``fastmath``): states that look alike would come out different.

Imported by `ciberrato.localization.belief.compiled` only.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ciberrato.geometry.visible_faces import LONGEST
from ciberrato.infrared.cone_compiled import nearest_listed

_jit = numba.njit(cache=True, error_model="numpy", nogil=True)


@_jit
def multiply_dense(dense, codes, table):
    """Multiply all states by the likelihood of their codes."""
    for row in range(dense.shape[0]):
        weights, code = dense[row], codes[row]
        for square in range(code.shape[0]):
            weights[square] *= table[code[square]]


@_jit
def multiply_sparse(weight, bins, squares, codes, table):
    """Multiply listed states by the likelihood of their codes."""
    for state in range(weight.shape[0]):
        weight[state] *= table[codes[bins[state], squares[state]]]


@_jit
def drive_dense(old, new, moves, codes, stay, stay_if_blocked):
    """Move the states of every bin by whole squares; see `PoseBelief.drive`."""
    size = old.shape[1] - 1
    opposite = 2 * stay
    for row in range(old.shape[0]):
        before, after, code = old[row], new[row], codes[row]
        if code == stay:
            after[:] = before
            continue
        source, target = moves[opposite - code], moves[code]
        for square in range(size):
            after[square] = before[source[square]]
        if stay_if_blocked:
            for square in range(size):
                if target[square] == size:
                    after[square] += before[square]


@_jit
def drive_sparse(bins, squares, moves, codes, stay_if_blocked):
    """Move listed states; return their squares, with ``moves.shape[1]`` for those that are given up."""
    size = moves.shape[1]
    moved = np.empty_like(squares)
    blocked = 0
    for state in range(squares.shape[0]):
        target = moves[codes[bins[state]], squares[state]]
        if target == size:
            blocked += 1
            if stay_if_blocked:
                target = squares[state]
        moved[state] = target
    return moved, blocked


@_jit
def diffuse_place(old, new, forward, backward, share, keep):
    """Spread along an axis."""
    for row in range(old.shape[0]):
        before, after = old[row], new[row]
        for square in range(forward.shape[0]):
            spread = (before[forward[square]] + before[backward[square]]) * share
            after[square] = spread + keep * before[square]


@_jit
def diffuse_heading(old, new, moves, up, down, stay, share, keep):
    """Spread over the neighbouring headings, first from the bin below, then from that above."""
    bins, size = old.shape[0], old.shape[1] - 1
    opposite = 2 * stay
    for row in range(bins):
        here, after = old[row], new[row]
        below, above = (row - 1) % bins, (row + 1) % bins
        low, high = old[below], old[above]
        from_below, from_above = moves[opposite - up[below]], moves[opposite - down[above]]
        for square in range(size):
            weight = here[square] * keep
            weight += low[from_below[square]] * share
            after[square] = weight + high[from_above[square]] * share


@_jit
def add_up(sums, keys, count, bins, squares, weights, size):
    """Add the weights of listed states to an array of all; list the keys met first, return their number."""
    for state in range(weights.shape[0]):
        if squares[state] == size or weights[state] == 0.0:
            continue
        key = bins[state] * size + squares[state]
        if sums[key] == 0.0:
            keys[count] = key
            count += 1
        sums[key] += weights[state]
    return count


@_jit
def take_out(sums, keys, size):
    """List the states of some keys, and leave zeros behind."""
    count = keys.shape[0]
    bins, squares = np.empty(count, np.int64), np.empty(count, np.int64)
    weights = np.empty(count, np.float32)
    for number in range(count):
        key = keys[number]
        bins[number], squares[number] = key // size, key % size
        weights[number] = sums[key]
        sums[key] = 0.0
    return bins, squares, weights


@_jit
def cone_distances(faces, seen, rows, sectors, x, y, cosine, sine):
    """Return distances as `cone_arrays` does; nan where the lists of faces do not decide."""
    result = np.empty(x.shape[0])
    for sensor in range(x.shape[0]):
        row, sector = rows[sensor], sectors[sensor]
        nearest = math.nan
        if row >= 0:
            place = x[sensor], y[sensor], cosine[sensor], sine[sensor]
            nearest = nearest_listed(faces, seen, row, sector, *place)
            if nearest > seen[row, sector, LONGEST, 0]:
                nearest = math.nan  # the list ends before the nearest wall
        result[sensor] = nearest
    return result


@_jit
def paint_faces(rays, across, offsets, runs, rates, leads, lows, highs, touch):
    """Apply faces to distances along rays; see `ciberrato.infrared.sweep`."""
    count = across.shape[0]
    for number in range(runs.shape[0]):
        face, offset = runs[number, 0], offsets[number]
        least = -touch if runs[number, 3] else -math.inf
        for step in range(runs[number, 2]):
            row = (runs[number, 1] + step) % count
            factor, aside = rates[face, row, 0], across[row]
            for ray in range(3):
                ahead, low, high = leads[face, ray, row, 0], lows[face, ray, row, 0], highs[face, ray, row, 0]
                nearest = rays[ray, row]
                for place in range(offset.shape[0]):
                    reach, old, here = factor * offset[place] - ahead, nearest[place], aside[place]
                    seen = (here >= low) & (here <= high) & (reach >= least) & (reach < old)
                    nearest[place] = reach if seen else old


@_jit
def paint_corners(squared, along, across_left, across_right, squares, runs, aheads, lefts, rights):
    """Apply corners to squared distances; see `ciberrato.infrared.sweep`."""
    count = along.shape[0]
    for number in range(runs.shape[0]):
        corner, square = runs[number, 0], squares[number]
        for step in range(runs[number, 2]):
            row = (runs[number, 1] + step) % count
            ahead, low, high = aheads[corner, row, 0], lefts[corner, row, 0], rights[corner, row, 0]
            nearest, forward = squared[row], along[row]
            at_left, at_right = across_left[row], across_right[row]
            for place in range(square.shape[0]):
                distance, old = forward[place] + square[place] - ahead, nearest[place]
                seen = (at_left[place] >= low) & (at_right[place] <= high) & (distance < old)
                nearest[place] = distance if seen else old
