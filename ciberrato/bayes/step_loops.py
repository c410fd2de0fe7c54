# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# mypy: disable-error-code="assignment"
# The types are those of numba, which infers them.
"""The end of a prediction and a scan's update in one pass, in machine code made by numba.

Imported by `ciberrato.bayes.loops` only.
"""

from __future__ import annotations

import numba
import numpy as np

from ciberrato.bayes.motion_loops import drive_row, drive_work
from ciberrato.bayes.product_loops import product
from ciberrato.bayes.scan_loops import scan_place, scan_work
from ciberrato.bayes.vectors import LANES, add, count, load, positive, splat, total
from ciberrato.machine_code import kept

_part = numba.njit(error_model="numpy", nogil=True)
_U = np.uint64


@kept
def drive_and_correct(drives, scan, high, limits, out, begin, end):
    """Drive and turn to some rows of places, and multiply by the likelihood of a scan while they are near.

    Parameters
    ----------
    drives : tuple
        Arguments of `drive_and_turn`, up to the turn.
    scan : tuple
        Arguments of `scan_places`, up to the spacing.
    high : int
        The last one.
    limits : (float, float, float, float, float)
        Arguments of `products`, from the highest score on.
    out : shape (x * y * headings,)
        Not normalized.

    Returns
    -------
    (float, int, int)
        As of `products`.
    """
    turned, shape, margin, moves, shares, begins, free, weights, first = drives
    codes, row_of, worth, beams, spacing = scan
    _, columns, size = shape
    work, look = (
        drive_work(size, weights.shape[0], out),
        scan_work(size, worth.shape[0] // 256, beams, spacing),
    )
    full = size // LANES * LANES
    scores = np.full(size + LANES, -np.inf, np.float32)
    rest, made = np.zeros(LANES, out.dtype), np.zeros(LANES, out.dtype)
    best, far, least, floor, most = limits
    whole, small, wrong = splat(0.0), _U(0), _U(0)
    for x in range(begin, end):
        drive_row(x, turned, shape, margin, moves, shares, begins, free, weights, first, work, out)
        for y in range(columns):
            onto, row = (x * columns + y) * size, row_of[x * columns + y]
            if row < 0:
                out[onto : onto + size] = 0.0
                continue
            held = _U(0)
            for k in range(0, full, LANES):
                held |= positive(load(out, _U(onto + k)))
            for k in range(full, size):
                rest[k - full] = out[onto + k]
                held |= _U(out[onto + k] > 0.0)
            if not held:
                continue
            scan_place(codes[row], worth, beams, spacing, high, look, scores, _U(0))
            for k in range(0, full, LANES):
                at = _U(onto + k)
                one, low, odd = product(out, at, scores, _U(k), best, far, least, floor, most, out, at)
                whole = add(whole, one)
                small += count(low)
                wrong |= odd
            if full < size:
                # The rest, filled up: its scores go on with -inf.
                one, low, odd = product(
                    rest, _U(0), scores, _U(full), best, far, least, floor, most, made, _U(0)
                )
                out[onto + full : onto + size] = made[: size - full]
                whole = add(whole, one)
                small += count(low)
                wrong |= odd
    return total(whole), small, wrong
