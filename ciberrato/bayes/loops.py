# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""Steps of the Bayes filter over large (x, y, heading) grids, in machine code made by numba.

Each does some parts of its arrays, so that threads share the work. Beliefs are of double or single precision,
as they come. Sums are in a fixed order; a product and a sum may be one operation with one rounding. Unsigned
indices spare numba's check for negative ones, which would keep the compiler from using vectors.

Imported by `ciberrato.bayes.compiled` only.
"""

from __future__ import annotations

import numba
import numpy as np

_jit = numba.njit(cache=True, error_model="numpy", nogil=True)
_contracting = numba.njit(cache=True, error_model="numpy", nogil=True, fastmath={"contract"})
_U = np.uint64

LEAD = 3
"""Columns of zeros before the beams in the table of `scan_places`, and at least as many behind them."""

# exp(x) for x from -700 to 0: 2^n exp(r), |r| <= log(2) / 2, by its series to the 13th power.
_POWERS = np.ldexp(1.0, np.arange(-1074, 2))
_PER_LOG2 = 1.4426950408889634
_LOG2_HIGH, _LOG2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
_PIECE = 256
# Places whose headings are turned together, so that whole cache lines are written.
_TILE = 16


@_jit
def scan_places(codes, row_of, worth, stride, spacing, high, out, begin, end):
    """Sum up what the beams are worth, for all headings at some places.

    The code of one direction is worth something to as many headings as there are beams, a spacing apart: a
    run of sums, if headings are kept by their remainder, and go on beyond a turn. Four directions at a time.

    Parameters
    ----------
    codes : uint8, shape (rows, directions)
    row_of : int, shape (places,)
        Row of codes, -1 where the robot cannot be.
    worth : float32, shape (256 * stride,)
        By code; in a row `LEAD` zeros, the beams from left to right, `LEAD` zeros or more.
    stride, spacing, high : int
        Length of these rows; headings between two beams; those from straight ahead to the leftmost beam.
    out : float32, shape (places, headings)
    """
    headings = codes.shape[1]
    width = (headings + spacing - 1) // spacing + stride
    sums = np.empty(spacing * width, np.float32)
    run = stride - LEAD
    row = _U(stride)
    for place in range(begin, end):
        result = out[place]
        if row_of[place] < 0:
            result[:] = -np.inf
            continue
        code = codes[row_of[place]]
        sums[:] = 0.0
        for part in range(spacing):
            at = _U(part * width)
            direction = part
            while direction + 3 * spacing < headings:
                # Each further direction begins one sum later.
                a = _U(code[direction]) * row + _U(3)
                b = _U(code[direction + spacing]) * row + _U(2)
                c = _U(code[direction + 2 * spacing]) * row + _U(1)
                d = _U(code[direction + 3 * spacing]) * row
                for beam in range(run):
                    k = _U(beam)
                    sums[at + k] = (((sums[at + k] + worth[a + k]) + worth[b + k]) + worth[c + k]) + worth[
                        d + k
                    ]
                at += _U(4)
                direction += 4 * spacing
            while direction < headings:
                a = _U(code[direction]) * row + _U(3)
                for beam in range(run):
                    sums[at + _U(beam)] += worth[a + _U(beam)]
                at += _U(1)
                direction += spacing
        result[:] = 0.0
        heading = (-high) % headings
        for at in range(width):
            for part in range(spacing):
                result[heading] += sums[part * width + at]
                heading += 1
                if heading == headings:
                    heading = 0


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
        total = np.float32(0.0)
        for at in range((heading + high) % headings, headings + (beams - 1) * spacing, headings):
            part = np.float32(0.0)
            last = min(at // spacing, beams - 1)
            first = max(0, -(-(at - headings + 1) // spacing))
            for beam in range(last, first - 1, -1):
                part += worth[code[at - beam * spacing] * stride + LEAD + beam]
            total += part
        out[state] = total


@_contracting
def _turn(row, wrapped, weights, first, out):
    """Convolve round a turn: what is at h goes to h + first + k with weights[k]."""
    size, taps = row.shape[0], weights.shape[0]
    at = (1 - first - taps) % size
    for k in range(size + taps - 1):
        wrapped[k] = row[at]
        at += 1
        if at == size:
            at = 0
    out[:] = 0.0
    for k in range(0, taps - 3, 4):
        begin = taps - 1 - k
        a, b, c, d = weights[k], weights[k + 1], weights[k + 2], weights[k + 3]
        p, q = wrapped[begin : begin + size], wrapped[begin - 1 : begin - 1 + size]
        r, s = wrapped[begin - 2 : begin - 2 + size], wrapped[begin - 3 : begin - 3 + size]
        for h in range(size):
            out[h] += (a * p[h] + b * q[h]) + (c * r[h] + d * s[h])
    for k in range(taps // 4 * 4, taps):
        a, p = weights[k], wrapped[taps - 1 - k : taps - 1 - k + size]
        for h in range(size):
            out[h] += a * p[h]


@_contracting
def turn_rows(belief, weights, first, out, begin, end):
    """Turn the headings of some rows of places, and lay each heading's places side by side.

    Parameters
    ----------
    belief : shape (x, y, headings)
    weights, first : shape (n,), int
        Distribution of the turn in cells, as of `ciberrato.bayes.convolution.convolve`.
    out : shape (x, headings, y)

    Returns
    -------
    int
        Number of entries that are nan, infinite or negative.
    """
    columns, size = belief.shape[1:]
    tile = np.empty((_TILE, size), belief.dtype)
    wrapped = np.empty(size + weights.shape[0], belief.dtype)
    wrong = 0
    for x in range(begin, end):
        lines = out[x]
        for y in range(0, columns, _TILE):
            count = min(_TILE, columns - y)
            for k in range(count):
                row = belief[x, y + k]
                held = 0
                for h in range(size):
                    wrong += not (row[h] >= 0.0 and row[h] < np.inf)
                    held += row[h] > 0.0
                if held:
                    _turn(row, wrapped, weights, first, tile[k])
                else:
                    tile[k] = 0.0
            for h in range(size):
                line = lines[h]
                for k in range(count):
                    line[y + k] = tile[k, h]
    return wrong


@_contracting
def drive_and_turn(turned, cells, shares, begins, free, weights, first, out, begin, end):
    """Drive each heading by its kernel and turn again, to some rows of places.

    Parameters
    ----------
    turned : shape (x, headings, y)
    cells, shares : int, shape (n, 2), and shape (n,)
        Displacements of all kernels, and their probabilities, in the belief's precision.
    begins : int, shape (headings + 1,)
        First entry of each heading's kernel.
    free : bool, shape (x, y)
        What ends elsewhere is lost.
    weights, first : shape (n,), int
        Distribution of the turn.
    out : shape (x, y, headings)
    """
    rows, size, columns = turned.shape
    lines = np.empty((size, columns), out.dtype)
    tile = np.empty((_TILE, size), out.dtype)
    wrapped = np.empty(size + weights.shape[0], out.dtype)
    for x in range(begin, end):
        for h in range(size):
            line = lines[h]
            line[:] = 0.0
            for entry in range(begins[h], begins[h + 1]):
                source, step = x - cells[entry, 0], cells[entry, 1]
                low, high = max(0, step), min(columns, columns + step)
                if 0 <= source < rows and low < high:
                    share, onto = shares[entry], line[low:high]
                    old = turned[source, h, low - step : high - step]
                    for y in range(high - low):
                        onto[y] += share * old[y]
        for y in range(0, columns, _TILE):
            count = min(_TILE, columns - y)
            for h in range(size):
                line = lines[h]
                for k in range(count):
                    tile[k, h] = line[y + k]
            for k in range(count):
                if free[x, y + k]:
                    _turn(tile[k], wrapped, weights, first, out[x, y + k])
                else:
                    out[x, y + k] = 0.0


@_contracting
def products(belief, scores, best, far, least, most, out, begin, end):
    """Multiply beliefs by exp(scores - best), all flat.

    Parameters
    ----------
    belief, scores, out : shape (n,)
    best, far : float
        The highest score; states whose score is this many nats (negative) from it get zero.
    least, most : float
        Products of possible states below, and beliefs above, are counted.

    Returns
    -------
    (float, int, int)
        Sum of the products; number of those that are below `least` though the state is possible; number of
        beliefs that are nan, negative or above `most`.
    """
    total, small, wrong = 0.0, 0, 0
    factor, power = np.empty(_PIECE), np.empty(_PIECE, np.int64)
    for piece in range(begin, end, _PIECE):
        size = min(_PIECE, end - piece)
        first = _U(piece)
        for k in range(size):
            x = np.float64(scores[first + _U(k)]) - best
            x = x if x > far else far
            n = np.floor(x * _PER_LOG2 + 0.5)
            power[_U(k)] = np.int64(n)
            factor[_U(k)] = (x - n * _LOG2_HIGH) - n * _LOG2_LOW
        for k in range(size):
            r = factor[_U(k)]
            p = 1.6059043836821613e-10
            p = p * r + 2.08767569878681e-09
            p = p * r + 2.505210838544172e-08
            p = p * r + 2.755731922398589e-07
            p = p * r + 2.7557319223985893e-06
            p = p * r + 2.48015873015873e-05
            p = p * r + 0.0001984126984126984
            p = p * r + 0.001388888888888889
            p = p * r + 0.008333333333333333
            p = p * r + 0.041666666666666664
            p = p * r + 0.16666666666666666
            p = p * r + 0.5
            p = p * r + 1.0
            factor[_U(k)] = p * r + 1.0
        for k in range(size):
            factor[_U(k)] *= _POWERS[_U(power[_U(k)] + 1074)]
        part = 0.0
        for k in range(size):
            held, score = belief[first + _U(k)], np.float64(scores[first + _U(k)])
            product = factor[_U(k)] * held if score - best >= far else 0.0
            out[first + _U(k)] = product
            part += product
            small += product < least and held > 0.0 and score > -np.inf
            wrong += not (held >= 0.0 and held <= most)
        total += part
    return total, small, wrong


@_jit
def scale(values, factor, begin, end):
    """Multiply by a factor, in place."""
    for k in range(begin, end):
        values[_U(k)] *= factor
