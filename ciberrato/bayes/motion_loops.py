# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Predictions over large (x, y, heading) grids, in machine code made by numba.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import numba
import numpy as np

from ciberrato.bayes.vectors import (
    LANES,
    finish,
    load,
    multiply_add,
    outside,
    positive,
    prefetch,
    splat,
    store,
    stream,
    transpose,
    zeros,
)
from ciberrato.machine_code import kept

_part = numba.njit(error_model="numpy", nogil=True)
_U = np.uint64

STRIP = 4 * LANES
"""Columns that `drive_and_turn` does at once: rows of what `turn_rows` makes are a multiple of this long."""


@_part
def _turn(lines, base, weights, blocks, out, made):
    """Convolve: line h of the result is the sum of weights[k] times line h + taps - 1 - k."""
    taps = weights.shape[0]
    zero = load(zeros(LANES, out.dtype), _U(0))
    for block in range(blocks):
        a, b, c, d, e, f, g, h = zero, zero, zero, zero, zero, zero, zero, zero
        at = base + _U(LANES * (LANES * block + taps - 1))
        for k in range(taps):
            w = splat(weights[_U(k)])
            a = multiply_add(w, load(lines, at), a)
            b = multiply_add(w, load(lines, at + _U(LANES)), b)
            c = multiply_add(w, load(lines, at + _U(2 * LANES)), c)
            d = multiply_add(w, load(lines, at + _U(3 * LANES)), d)
            e = multiply_add(w, load(lines, at + _U(4 * LANES)), e)
            f = multiply_add(w, load(lines, at + _U(5 * LANES)), f)
            g = multiply_add(w, load(lines, at + _U(6 * LANES)), g)
            h = multiply_add(w, load(lines, at + _U(7 * LANES)), h)
            at -= _U(LANES)
        onto = made + _U(LANES * LANES * block)
        store(out, onto, a)
        store(out, onto + _U(LANES), b)
        store(out, onto + _U(2 * LANES), c)
        store(out, onto + _U(3 * LANES), d)
        store(out, onto + _U(4 * LANES), e)
        store(out, onto + _U(5 * LANES), f)
        store(out, onto + _U(6 * LANES), g)
        store(out, onto + _U(7 * LANES), h)


@kept
def turn_rows(belief, shape, weights, first, out, margin, begin, end):
    """Turn the headings of some rows of places, and lay each heading's places side by side.

    Parameters
    ----------
    belief : shape (x * y * headings,)
    shape : (int, int, int)
        Numbers of x, y and headings.
    weights, first : shape (n,), int
        Distribution of the turn in cells, as of `ciberrato.bayes.convolution.convolve`; n up to headings.
    out : shape (x * headings * wide,)
        Begins with a cache line. Rows of places have a margin before and behind; in between is a multiple of
        `STRIP`.
    margin : int
        Multiple of `LANES`.

    Returns
    -------
    int
        Not 0 if an entry is nan, infinite or negative.
    """
    rows, columns, size = shape
    wide, taps = out.shape[0] // (rows * size), weights.shape[0]
    blocks, whole = -(-size // LANES), size // LANES
    tile = zeros(LANES * LANES * blocks, belief.dtype)
    plain = zeros(LANES * LANES * blocks, belief.dtype)
    turned = zeros(STRIP * LANES * blocks, belief.dtype)
    each = _U(LANES * LANES * blocks)
    lines = zeros(LANES * (LANES * blocks + taps), belief.dtype)
    zero = load(zeros(LANES, out.dtype), _U(0))
    most = load(np.full(LANES, np.finfo(belief.dtype).max, belief.dtype), _U(0))
    start = (1 - first - taps) % size
    length = _U(LANES * blocks)
    wrong = _U(0)
    for x in range(begin, end):
        for strip in range(0, columns, STRIP):
            groups = -(-min(STRIP, columns - strip) // LANES)
            for group in range(groups):
                y = strip + group * LANES
                held = _U(0)
                there = min(LANES, columns - y)
                for k in range(there):
                    source, target = _U(((x * columns) + y + k) * size), _U(k) * length
                    for block in range(whole):
                        some = load(belief, source + _U(LANES * block))
                        store(tile, target + _U(LANES * block), some)
                        wrong |= outside(some, zero, most)
                        held |= positive(some)
                    for h in range(LANES * whole, size):
                        one = belief[source + _U(h)]
                        tile[target + _U(h)] = one
                        wrong |= _U(not (one >= 0.0 and one < np.inf))
                        held |= _U(one > 0.0)
                for k in range(there, LANES):
                    for block in range(blocks):
                        store(tile, _U(k) * length + _U(LANES * block), zero)
                made = _U(group) * each
                if not held:
                    for h in range(size):
                        store(turned, made + _U(LANES * h), zero)
                    continue
                for block in range(blocks):
                    transpose(tile, _U(LANES * block), length, plain, _U(LANES * LANES * block), _U(LANES))
                at = start
                for h in range(size + taps - 1):
                    store(lines, _U(LANES * h), load(plain, _U(LANES * at)))
                    at += 1
                    if at == size:
                        at = 0
                _turn(lines, _U(0), weights, blocks, turned, made)
            # Some whole cache lines of each heading at a time, and past the caches: else each would be read
            # from memory before it is written. In single precision half of one would go alone.
            past = out.itemsize * LANES == 64
            for h in range(size):
                onto = _U((x * size + h) * wide + margin + strip)
                for group in range(groups):
                    if past:
                        stream(out, onto + _U(LANES * group), load(turned, _U(group) * each + _U(LANES * h)))
                    else:
                        store(out, onto + _U(LANES * group), load(turned, _U(group) * each + _U(LANES * h)))
    finish()
    return wrong


@kept
def drive_and_turn(turned, shape, margin, moves, shares, begins, free, weights, first, out, begin, end):
    """Drive each heading by its kernel and turn again, to some rows of places.

    Parameters
    ----------
    turned : shape (x * headings * wide,)
        As `turn_rows` makes it, zero in the margins, which are as wide as the displacements in y.
    shape : (int, int, int)
        Numbers of x, y and headings.
    margin : int
    moves, shares : int, shape (n, 2), and shape (n,)
        Displacements of all kernels, and their probabilities, in the belief's precision.
    begins : int, shape (headings + 1,)
        First entry of each heading's kernel.
    free : bool, shape (x, y)
        Mass that ends elsewhere is lost.
    weights, first : shape (n,), int
        Distribution of the turn.
    out : shape (x * y * headings,)
    """
    work = drive_work(shape[2], weights.shape[0], out)
    for x in range(begin, end):
        drive_row(x, turned, shape, margin, moves, shares, begins, free, weights, first, work, out)


@_part
def drive_work(size, taps, out):
    """Return work arrays of `drive_row`."""
    blocks = -(-size // LANES)
    tile = LANES * LANES * blocks
    lines = zeros(STRIP // LANES * LANES * (LANES * blocks + taps), out.dtype)
    return lines, zeros(tile, out.dtype), zeros(tile, out.dtype)


@_part
def drive_row(x, turned, shape, margin, moves, shares, begins, free, weights, first, work, out):
    """Do what `drive_and_turn` does for one row of places."""
    lines, after, tile = work
    rows, columns, size = shape
    wide, taps = turned.shape[0] // (rows * size), weights.shape[0]
    blocks = -(-size // LANES)
    each, length = LANES * (LANES * blocks + taps), _U(LANES * blocks)
    zero = load(zeros(LANES, out.dtype), _U(0))
    start = (1 - first - taps) % size
    for y in range(0, columns, STRIP):
        if not free[x, y : y + STRIP].any():
            out[(x * columns + y) * size : (x * columns + min(columns, y + STRIP)) * size] = 0.0
            continue
        for h in range(size):
            a, b, c, d = zero, zero, zero, zero
            for entry in range(begins[h], begins[h + 1]):
                source = x - moves[entry, 0]
                if 0 <= source < rows:
                    at = _U((source * size + h) * wide + margin + y - moves[entry, 1])
                    prefetch(turned, at + _U(STRIP))
                    prefetch(turned, at + _U(STRIP + LANES))
                    prefetch(turned, at + _U(STRIP + 2 * LANES))
                    prefetch(turned, at + _U(STRIP + 3 * LANES))
                    share = splat(shares[entry])
                    a = multiply_add(share, load(turned, at), a)
                    b = multiply_add(share, load(turned, at + _U(LANES)), b)
                    c = multiply_add(share, load(turned, at + _U(2 * LANES)), c)
                    d = multiply_add(share, load(turned, at + _U(3 * LANES)), d)
            at = _U(LANES * ((h - start) % size))
            while at < _U(LANES * (size + taps - 1)):
                store(lines, at, a)
                store(lines, at + _U(each), b)
                store(lines, at + _U(2 * each), c)
                store(lines, at + _U(3 * each), d)
                at += _U(LANES * size)
        for group in range(STRIP // LANES):
            low, high = y + LANES * group, min(columns, y + LANES * (group + 1))
            if low >= high:
                break
            if free[x, low:high].any():
                _turn(lines, _U(group * each), weights, blocks, after, _U(0))
                for block in range(blocks):
                    source = _U(LANES * LANES * block)
                    transpose(after, source, _U(LANES), tile, _U(LANES * block), length)
            for k in range(high - low):
                onto, made = (x * columns + low + k) * size, LANES * blocks * k
                if free[x, low + k]:
                    out[onto : onto + size] = tile[made : made + size]
                else:
                    out[onto : onto + size] = 0.0
