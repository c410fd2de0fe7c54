# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Scans over large (x, y, heading) grids, in machine code made by numba.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import numba
import numpy as np

from ciberrato.bayes.vectors import (
    LANES,
    add,
    load,
    splat,
    store,
)

_jit = numba.njit(cache=True, error_model="numpy", nogil=True)
_part = numba.njit(error_model="numpy", nogil=True)
_U = np.uint64

# Each vector of sums is one of these: directions that are a multiple of LANES apart, so that what a code is
# worth to LANES headings is added as it lies in memory.
_CLASSES = LANES


@_jit
def scan_places(codes, row_of, worth, stride, beams, spacing, high, out, begin, end):
    """Sum up what the beams are worth, for all headings at some places.

    The code of one direction is worth something to as many headings as there are beams, a spacing apart: a
    run of sums, if headings are kept by their remainder, and go on beyond a turn.

    Parameters
    ----------
    codes : uint8, shape (rows, directions)
    row_of : int, shape (places,)
        Row of codes, -1 where the robot cannot be.
    worth : float32, shape (257 * stride,)
        By code: the beams from left to right, then zeros; the last row is of zeros.
    stride, beams, spacing, high : int
        Length of these rows, a multiple of `LANES`; number of beams; headings between two beams; those from
        straight ahead to the leftmost beam.
    out : float32, shape (places * headings,)
    """
    headings = codes.shape[1]
    work = _scan_work(headings, stride, beams, spacing)
    for place in range(begin, end):
        row = row_of[place]
        if row < 0:
            out[place * headings : (place + 1) * headings] = -np.inf
        else:
            _scan_place(
                codes[row], worth, stride, beams, spacing, high, work, out, _U(place * headings)
            )


@_part
def _scan_work(headings, stride, beams, spacing):
    """Return work arrays: rows of `worth`, sums by class, and sums of all in the order of headings."""
    runs = stride // LANES
    most = -(-headings // spacing)
    blocks = -(-most // LANES)
    at = np.full(LANES * (blocks + 2 * runs), 256 * stride, np.uint64)
    classes = np.zeros(_CLASSES * LANES * (blocks + runs + 1), np.float32)
    sums = np.zeros(LANES * (blocks + runs), np.float32)
    line = np.zeros(LANES * (blocks + runs) * spacing, np.float32)
    return at, classes, sums, line


@_part
def _scan_place(code, worth, stride, beams, spacing, high, work, out, place):
    at, classes, sums, line = work
    headings = code.shape[0]
    runs = stride // LANES
    lead = LANES * (runs - 1)
    length = _U(classes.shape[0] // _CLASSES)
    for part in range(spacing):
        some = (headings - part + spacing - 1) // spacing
        direction = part
        for k in range(some):
            at[lead + k] = _U(code[direction]) * _U(stride)
            direction += spacing
        at[lead + some :] = 256 * stride
        blocks = -(-some // LANES)
        for block in range(blocks + runs - 1):
            for one in range(0, _CLASSES, 4):
                key = _U(LANES * block + lead + one)
                a = load(worth, at[key])
                b = load(worth, at[key + _U(1)])
                c = load(worth, at[key + _U(2)])
                d = load(worth, at[key + _U(3)])
                step = _U(0)
                for _ in range(1, runs):
                    step += _U(LANES)
                    key -= _U(LANES)
                    a = add(a, load(worth, at[key] + step))
                    b = add(b, load(worth, at[key + _U(1)] + step))
                    c = add(c, load(worth, at[key + _U(2)] + step))
                    d = add(d, load(worth, at[key + _U(3)] + step))
                onto = _U(one) * length + _U(LANES * (block + 1))
                store(classes, onto, a)
                store(classes, onto + length, b)
                store(classes, onto + _U(2) * length, c)
                store(classes, onto + _U(3) * length, d)
        for one in range(_CLASSES):
            store(classes, _U(one) * length + _U(LANES * (blocks + runs)), splat(np.float32(0.0)))
        width = some + beams - 1
        for begin in range(0, width, LANES):
            sum_ = load(classes, _U(begin + LANES))
            for one in range(1, _CLASSES):
                sum_ = add(sum_, load(classes, _U(one) * length + _U(begin + LANES - one)))
            store(sums, _U(begin), sum_)
        for k in range(width):
            line[_U(k * spacing + part)] = sums[_U(k)]
    whole = headings + (beams - 1) * spacing
    first = high % headings
    for h in range(headings - first):
        out[place + _U(h)] = line[_U(first + h)]
    for h in range(first):
        out[place + _U(headings - first + h)] = line[_U(h)]
    for turn in range(headings, whole, headings):
        # What goes on beyond a turn.
        for k in range(turn, min(whole, turn + headings)):
            h = k - turn - first
            out[place + _U(h if h >= 0 else h + headings)] += line[_U(k)]


@_jit
def scan_states(codes, row_of, worth, stride, beams, spacing, high, states, out):
    """Sum up what the beams are worth in listed states, in the order of `scan_places`."""
    headings = codes.shape[1]
    for state in range(states.shape[0]):
        place, heading = states[state] // headings, states[state] % headings
        row = row_of[place]
        if row < 0:
            out[state] = -np.inf
            continue
        code = codes[row]
        whole = np.float32(0.0)
        for at in range((heading + high) % headings, headings + (beams - 1) * spacing, headings):
            part, last = at % spacing, at // spacing
            some = (headings - part + spacing - 1) // spacing
            turn = np.float32(0.0)
            for one in range(_CLASSES):
                sum_ = np.float32(0.0)
                for beam in range((last - one) % LANES, beams, LANES):
                    if 0 <= last - beam < some:
                        sum_ += worth[code[(last - beam) * spacing + part] * stride + beam]
                turn += sum_
            whole += turn
        out[state] = whole
