# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Predictions of listed states of (x, y, heading) grids, in machine code made by numba.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ciberrato.bayes.vectors import LANES, load, multiply_add, splat, store, zeros
from ciberrato.machine_code import kept

_part = numba.njit(error_model="numpy", nogil=True)
_U = np.uint64


@kept
def heavy(masses, allowed):
    """Return the numbers of the states to keep, and the mass of the others: see `selected.heavy`.

    Parameters
    ----------
    masses : shape (n,)
        0 or more.
    allowed : float
        Greatest mass to leave out.
    """
    sure = 0.0
    if allowed > 0.0:
        sure = math.ldexp(1.0, math.frexp(allowed / max(1, masses.shape[0]))[1] - 1)
    # Two sums of each power of two in turn: the one need not wait for the other.
    power, held = masses.view(np.uint64), np.zeros(2 * 2048)
    rest = 0.0
    for k in range(masses.shape[0]):
        mass = masses[_U(k)]
        if mass > 0.0 and mass >= sure:
            held[power[_U(k)] >> _U(52) << _U(1) | _U(k & 1)] += mass
        else:
            rest += mass
    least, left_out = 0, rest
    while least < 2047 and left_out + (held[2 * least] + held[2 * least + 1]) <= allowed:
        left_out += held[2 * least] + held[2 * least + 1]
        least += 1
    if left_out > rest:
        sure = max(sure, math.ldexp(1.0, least - 1023) if least else 0.0)
    chosen, at = np.empty(masses.shape[0], np.int64), 0
    for k in range(masses.shape[0]):
        chosen[_U(at)] = k
        at += masses[_U(k)] > 0.0 and masses[_U(k)] >= sure
    return chosen[:at], left_out


@_part
def _reached(used, taps, first):
    """Return which blocks of `LANES` headings a turn brings mass to, of those in use; bool, shape (size,)."""
    size = used.shape[0]
    there = np.zeros(-(-size // LANES), np.bool_)
    for h in range(size):
        if used[h]:
            for k in range(taps):
                there[(h + first + k) % size // LANES] = True
    return np.flatnonzero(there)


@_part
def _put(line, heading, mass, start, size):
    """Add mass to the places of a heading in a line that goes round more than once."""
    at = heading - start
    if at < 0:
        at += size
    while at < line.shape[0]:
        line[at] += mass
        at += size


@_part
def _turn(line, weights, blocks, size, out, onto):
    """Convolve the blocks of a line that are asked for, and store them side by side from an index on."""
    taps, count = weights.shape[0], blocks.shape[0]
    zero = splat(0.0)
    for block in range(0, count, 4):
        # Four at once; the last ones may be done twice.
        i = min(block, max(0, count - 4))
        j, k, l = min(i + 1, count - 1), min(i + 2, count - 1), min(i + 3, count - 1)  # noqa: E741
        a, b, c, d = zero, zero, zero, zero
        for tap in range(taps):
            w, at = splat(weights[_U(tap)]), taps - 1 - tap
            a = multiply_add(w, load(line, _U(LANES * blocks[i] + at)), a)
            b = multiply_add(w, load(line, _U(LANES * blocks[j] + at)), b)
            c = multiply_add(w, load(line, _U(LANES * blocks[k] + at)), c)
            d = multiply_add(w, load(line, _U(LANES * blocks[l] + at)), d)
        store(out, _U(onto + LANES * i), a)
        store(out, _U(onto + LANES * j), b)
        store(out, _U(onto + LANES * k), c)
        store(out, _U(onto + LANES * l), d)
    # Beyond the last heading the line goes on with the first ones.
    if count and LANES * (blocks[count - 1] + 1) > size:
        out[onto + LANES * (count - 1) + size % LANES : onto + LANES * count] = 0.0


@kept
def turn_states(states, masses, size, weights, first, allowed):
    """Turn listed states.

    Parameters
    ----------
    states, masses : shape (n,)
        Numbers of cells (place, heading), rising.
    size : int
        Number of headings.
    weights, first : shape (taps,), int
        Distribution of the turn in cells, as of `ciberrato.bayes.convolution.convolve`; up to `size` of them.
    allowed : float
        Mass that may be left out.

    Returns
    -------
    (place, heading, mass, left_out)
        Arrays of equal length, by place and heading.
    """
    taps = weights.shape[0]
    used, begins = np.zeros(size, np.bool_), np.empty(states.shape[0] + 1, np.int64)
    places, own = np.empty(states.shape[0], np.int64), np.empty(states.shape[0], np.int64)
    rows, until = 0, -1
    for k in range(states.shape[0]):
        if states[k] >= until:
            begins[rows], places[rows] = k, states[k] // size
            until = (places[rows] + 1) * size
            rows += 1
        own[k] = states[k] - until + size
        used[own[k]] = True
    begins[rows] = states.shape[0]
    blocks = _reached(used, taps, first)
    wide, start = LANES * blocks.shape[0], (1 - first - taps) % size
    line = zeros(LANES * -(-size // LANES) + taps, np.float64)
    turned = np.empty(rows * wide)
    for row in range(rows):
        for k in range(begins[row], begins[row + 1]):
            _put(line, own[k], masses[k], start, size)
        _turn(line, weights, blocks, size, turned, row * wide)
        line[:] = 0.0
    chosen, left_out = heavy(turned, allowed)
    place, heading = np.empty(chosen.shape[0], np.int64), np.empty(chosen.shape[0], np.int64)
    mass = np.empty(chosen.shape[0])
    row = 0
    for k in range(chosen.shape[0]):
        while chosen[k] >= (row + 1) * wide:
            row += 1
        column = chosen[k] - row * wide
        place[k] = places[row]
        heading[k] = LANES * blocks[column // LANES] + column % LANES
        mass[k] = turned[chosen[k]]
    return place, heading, mass, left_out


@kept
def drive_states(place, heading, mass, shape, free, used, kernel, cells, shares, weights, first, allowed):
    """Drive listed states by the kernels of their headings, and turn them.

    Parameters
    ----------
    place, heading, mass : shape (n,)
        As `turn_states` returns them.
    shape : (int, int, int)
        Numbers of x, y and headings.
    free : bool, shape (x, y)
        Mass that ends elsewhere is lost.
    used : bool, shape (headings,)
        Those that occur.
    kernel, cells, shares : shapes (m,), (m, 2), (m,)
        Entries of `LatticeKernels` of the headings in use, which are counted from 0 on.
    weights, first, allowed
        As of `turn_states`.

    Returns
    -------
    (states, masses, left_out)
    """
    rows, columns, size = shape
    taps = weights.shape[0]
    number, headings = np.cumsum(used) - 1, np.flatnonzero(used)
    count = headings.shape[0]
    # Entries by kernel: begins[k] is first the end of what has been put there, then where the next begins.
    begins, along, across = np.zeros(count + 2, np.int64), np.empty_like(kernel), np.empty_like(kernel)
    share = np.empty_like(shares)
    for k in range(kernel.shape[0]):
        begins[kernel[k] + 2] += 1
    for k in range(count):
        begins[k + 2] += begins[k + 1]
    for k in range(kernel.shape[0]):
        at = begins[kernel[k] + 1]
        along[at], across[at], share[at] = cells[k, 0], cells[k, 1], shares[k]
        begins[kernel[k] + 1] += 1
    # A border as wide as the longest drive, so that targets are sums of numbers.
    border = 0
    for entry in range(kernel.shape[0]):
        border = max(border, abs(along[entry]), abs(across[entry]))
    across += along * (columns + 2 * border)
    inside = np.zeros((rows + 2 * border, columns + 2 * border), np.bool_)
    inside[border : border + rows, border : border + columns] = free
    allowed_at, starts = inside.ravel(), np.empty_like(place)
    here, at = -1, 0
    for k in range(place.shape[0]):
        if place[k] != here:
            here = place[k]
            x = here // columns
            at = (x + border) * inside.shape[1] + here - x * columns + border
        starts[k] = at
    # First which places are reached, then what arrives there.
    slot, found = np.zeros(inside.size, np.int32), 0
    for k in range(place.shape[0]):
        direction = number[heading[k]]
        for entry in range(begins[direction], begins[direction + 1]):
            slot[_U(starts[k] + across[_U(entry)])] = 1
    reached = np.empty(inside.size, np.int32)
    for target in range(inside.size):
        if slot[target] and allowed_at[target]:
            slot[target], reached[found] = found, target
            found += 1
    after = np.zeros((found, count))
    for k in range(place.shape[0]):
        direction = number[heading[k]]
        for entry in range(begins[direction], begins[direction + 1]):
            target = _U(starts[k] + across[_U(entry)])
            if allowed_at[target]:
                after[_U(slot[target]), _U(direction)] += mass[k] * share[_U(entry)]
    blocks = _reached(used, taps, first)
    wide, start = LANES * blocks.shape[0], (1 - first - taps) % size
    line = zeros(LANES * -(-size // LANES) + taps, np.float64)
    turned, origin = np.empty(found * wide), np.empty(found, np.int64)
    for row in range(found):
        x, y = divmod(reached[row], inside.shape[1])
        origin[row] = ((x - border) * columns + y - border) * size
        for k in range(count):
            if after[row, k] > 0.0:
                _put(line, headings[k], after[row, k], start, size)
        _turn(line, weights, blocks, size, turned, row * wide)
        line[:] = 0.0
    chosen, left_out = heavy(turned, allowed)
    states, masses = np.empty(chosen.shape[0], np.int64), np.empty(chosen.shape[0])
    row = 0
    for k in range(chosen.shape[0]):
        while chosen[k] >= (row + 1) * wide:
            row += 1
        column = chosen[k] - row * wide
        states[k] = origin[row] + LANES * blocks[column // LANES] + column % LANES
        masses[k] = turned[chosen[k]]
    return states, masses, left_out
