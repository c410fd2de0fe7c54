# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Scans over large (x, y, heading) grids, in machine code made by numba.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import numba
import numpy as np

from ciberrato.bayes.vectors import MANY, add, load_many, prefetch, store, store_in_turn, zeros
from ciberrato.machine_code import kept

_part = numba.njit(error_model="numpy", nogil=True)
_U = np.uint64

RUN = 3 * MANY
"""Beams whose worth is added at once: rows of what codes are worth are a multiple of this long."""
_AHEAD = 8
"""Listed states that memory is asked for ahead of their turn."""
_SHARE = 16
"""Part of a place's headings from which on doing all of them is sooner than one by one."""


@kept
def scan_places(codes, row_of, worth, beams, spacing, high, out, begin, end):
    """Sum up what the beams are worth, for all headings at some places.

    The code of one direction is worth something to as many headings as there are beams, a spacing apart: a
    run of sums, if headings are kept by their remainder, and go on beyond a turn.

    Parameters
    ----------
    codes : uint8, shape (rows, directions)
        Those with remainder 0 by the spacing first, then 1, and so on.
    row_of : int, shape (places,)
        Row of codes, -1 where the robot cannot be.
    worth : float32, shape (256 * n * RUN,)
        By code: the beams from left to right, then zeros.
    beams, spacing, high : int
        Number of beams; headings between two beams; those from straight ahead to the leftmost beam.
    out : float32, shape (places * headings,)
    """
    headings = codes.shape[1]
    work = scan_work(headings, worth.shape[0] // 256, beams, spacing)
    for place in range(begin, end):
        row = row_of[place]
        if row < 0:
            out[place * headings : (place + 1) * headings] = -np.inf
        else:
            scan_place(codes[row], worth, beams, spacing, high, work, out, _U(place * headings))


@_part
def scan_work(headings, stride, beams, spacing):
    """Return work arrays: sums by class, those of all by remainder, and these in the order of headings."""
    most = -(-headings // spacing)
    blocks = max(-(-(most + beams - 1) // MANY), -(-most // MANY) + stride // MANY)
    turns = 1 - (-(beams - 1) * spacing // headings)
    return (
        zeros(MANY * MANY * (blocks + 1), np.float32),
        zeros(spacing * MANY * blocks, np.float32),
        zeros(max(turns * headings, spacing * MANY * blocks) + MANY, np.float32),
    )


@_part
def scan_place(code, worth, beams, spacing, high, work, out, place):
    """Store the sums of all headings at one place to an array, from an index on."""
    classes, sums, line = work
    headings, stride = code.shape[0], worth.shape[0] // 256
    length = _U(classes.shape[0] // MANY)
    zero = load_many(np.zeros(MANY, np.float32), _U(0))
    first, onto = _U(0), _U(0)
    room = _U(sums.shape[0] // spacing)
    for part in range(spacing):
        some = (headings - part + spacing - 1) // spacing
        width = some + beams - 1
        # Directions MANY apart are one class: what their codes are worth lies as it is added.
        for one in range(MANY):
            store(classes, _U(one) * length, zero)
            for run in range(0, stride, RUN):
                at = _U(one) * length + _U(MANY + run)
                near, far = zero, zero
                key = first + _U(one)
                while key < first + _U(some):
                    row = _U(code[key]) * _U(stride) + _U(run)
                    sum_ = add(near, load_many(worth, row))
                    near = add(far, load_many(worth, row + _U(MANY)))
                    far = load_many(worth, row + _U(2 * MANY))
                    if run:
                        sum_ = add(load_many(classes, at), sum_)
                    store(classes, at, sum_)
                    at += _U(MANY)
                    key += _U(MANY)
                if run:
                    near = add(load_many(classes, at), near)
                store(classes, at, near)
                store(classes, at + _U(MANY), far)
                at += _U(2 * MANY)
                while at < _U(one + 1) * length:
                    store(classes, at, zero)
                    at += _U(MANY)
        for begin in range(0, width, MANY):
            sum_ = load_many(classes, _U(begin + MANY))
            for one in range(1, MANY):
                sum_ = add(sum_, load_many(classes, _U(one) * length + _U(begin + MANY - one)))
            store(sums, onto + _U(begin), sum_)
        first += _U(some)
        onto += room
    width = -(-headings // spacing) + beams - 1
    if spacing == 1:
        line[:width] = sums[:width]
    elif spacing == 2:
        for k in range(0, width, MANY):
            at = _U(k)
            store_in_turn(line, at + at, load_many(sums, at), load_many(sums, room + at))
    else:
        for k in range(width):
            for part in range(spacing):
                line[_U(k * spacing + part)] = sums[_U(part) * room + _U(k)]
    low = high % headings
    _around(line, low, headings - low, headings, beams, spacing, out, place)
    _around(line, 0, low, headings, beams, spacing, out, place + _U(headings - low))


@_part
def _around(line, begin, size, headings, beams, spacing, out, onto):
    """Store some sums to an array, and add to each what goes on beyond a turn."""
    whole = headings + (beams - 1) * spacing
    for k in range(0, size, MANY):
        # The last vector begins where it ends with the sums, if they are so many.
        k = min(k, size - MANY)
        if k < 0:
            for h in range(size):
                sum_ = line[_U(begin + h)]
                for at in range(begin + h + headings, whole, headings):
                    sum_ += line[_U(at)]
                out[onto + _U(h)] = sum_
            return
        sum_ = load_many(line, _U(begin + k))
        for at in range(begin + k + headings, whole, headings):
            sum_ = add(sum_, load_many(line, _U(at)))
        store(out, onto + _U(k), sum_)


@kept
def scan_states(codes, row_of, worth, beams, spacing, high, states, out):
    """Sum up what the beams are worth in listed states, in the order of `scan_places`."""
    headings, stride = codes.shape[1], worth.shape[0] // 256
    begins = np.zeros(spacing + 1, np.int64)
    for part in range(spacing):
        begins[part + 1] = begins[part] + (headings - part + spacing - 1) // spacing
    # What a state's beams are worth, and sums of those that are `MANY` apart, twice over.
    each, lanes = zeros(stride, np.float32), zeros(2 * MANY, np.float32)
    zero = load_many(lanes, _U(0))
    # Where a place has many states listed, all of its headings are done at once.
    work, around, until = scan_work(headings, stride, beams, spacing), np.empty(headings, np.float32), 0
    for state in range(states.shape[0]):
        ahead = row_of[states[min(state + _AHEAD, states.shape[0] - 1)] // headings] * headings
        for line in range(0, headings, 64):
            prefetch(codes, _U(max(ahead, 0) + line))
        place = states[state] // headings
        heading, row = states[state] - place * headings, row_of[place]
        if row < 0:
            out[state] = -np.inf
            continue
        if (
            state >= until
            and states[min(state + headings // _SHARE, states.shape[0] - 1)] // headings == place
        ):
            scan_place(codes[row], worth, beams, spacing, high, work, around, _U(0))
            until = state
            while until < states.shape[0] and states[until] // headings == place:
                until += 1
        if state < until:
            out[state] = around[heading]
            continue
        code = codes[row]
        whole = np.float32(0.0)
        for at in range((heading + high) % headings, headings + (beams - 1) * spacing, headings):
            part, last = at % spacing, at // spacing
            begin, some = begins[part], begins[part + 1] - begins[part]
            for beam in range(0, stride, MANY):
                store(each, _U(beam), zero)
            for beam in range(max(0, last - some + 1), min(beams, last + 1)):
                each[_U(beam)] = worth[_U(code[_U(begin + last - beam)]) * _U(stride) + _U(beam)]
            sums = zero
            for run in range(0, stride, RUN):
                sum_ = add(load_many(each, _U(run + 2 * MANY)), load_many(each, _U(run + MANY)))
                sums = add(sums, add(sum_, load_many(each, _U(run))))
            store(lanes, _U(0), sums)
            store(lanes, _U(MANY), sums)
            turn, lane = np.float32(0.0), _U(last % MANY + MANY)
            for one in range(MANY):
                turn += lanes[lane - _U(one)]
            whole += turn
        out[state] = whole
