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

import numpy as np

from ciberrato.geometry.visible_faces import LONGEST
from ciberrato.infrared.cone_compiled import nearest_listed
from ciberrato.infrared.sweep_compiled import dot, face_distance, greatest_of, near, paint_corner, paint_faces
from ciberrato.machine_code import kept

_BLOCK = 16
"""Places, one behind the other, whose near faces are looked for together."""


@kept
def multiply_dense(dense, codes, table):
    """Multiply all states by the likelihood of their codes."""
    for row in range(dense.shape[0]):
        weights, code = dense[row], codes[row]
        for square in range(code.shape[0]):
            weights[square] *= table[code[square]]


@kept
def multiply_sparse(weight, bins, squares, codes, table):
    """Multiply listed states by the likelihood of their codes."""
    for state in range(weight.shape[0]):
        weight[state] *= table[codes[bins[state], squares[state]]]


@kept
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


@kept
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


@kept
def diffuse_place(old, new, forward, backward, share, keep):
    """Spread along an axis."""
    for row in range(old.shape[0]):
        before, after = old[row], new[row]
        for square in range(forward.shape[0]):
            spread = (before[forward[square]] + before[backward[square]]) * share
            after[square] = spread + keep * before[square]


@kept
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


@kept
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


@kept
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


@kept
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


@kept
def encode(distances, codes, greatest, shift, nearest):
    """Convert distances to codes; see `ciberrato.localization.tables.reading_codes.encode`."""
    bits, last = distances.view(np.int64), codes.shape[0] - 1
    coded = np.empty(distances.shape, np.uint8)
    for row in range(distances.shape[0]):
        for place in range(distances.shape[1]):
            distance = distances[row, place]
            index = min(max((bits[row, place] >> shift) - nearest, 0), last)
            code = codes[index] - (distance > greatest[index])
            coded[row, place] = code if distance < math.inf else 255
    return coded


@kept
def wall_distances(places, start, end, direction, length, most):
    """Return the distances of places to the nearest face; see `ciberrato.geometry.tiles.wall_distances`."""
    result = np.empty(places.shape[0])
    for begin in range(0, places.shape[0], _BLOCK):
        some = places[begin : begin + _BLOCK]
        listed = near(some, start, end, direction, length)
        for number in range(some.shape[0]):
            least = most
            for face in listed:
                distance = face_distance(
                    some[number, 0], some[number, 1], start[face], end[face], direction[face], length[face]
                )
                least = min(least, distance)
            result[begin + number] = least
    return result


@kept
def nearest_feet(places, start, end, direction, length):
    """Return the nearest wall point to each place and its distance; see `belief.lattice`."""
    foot, result = np.empty(places.shape), np.empty(places.shape[0])
    for begin in range(0, places.shape[0], _BLOCK):
        some = places[begin : begin + _BLOCK]
        listed = near(some, start, end, direction, length)
        for number in range(some.shape[0]):
            x, y, least = some[number, 0], some[number, 1], math.inf
            for face in listed:
                (start_x, start_y), (ux, uy) = start[face], direction[face]
                along = min(max((x - start_x) * ux + (y - start_y) * uy, 0.0), length[face])
                foot_x, foot_y = start_x + along * ux, start_y + along * uy
                squared = (x - foot_x) * (x - foot_x) + (y - foot_y) * (y - foot_y)
                if squared < least:
                    least = squared
                    foot[begin + number, 0], foot[begin + number, 1] = foot_x, foot_y
            result[begin + number] = math.sqrt(least)
    return foot, result


@kept
def sweep_tile(places, walls, corners, units, first):
    """Return the distances that a sensor takes in a tile; see `ciberrato.infrared.sweep`.

    The arithmetic of a distance is the same; what cannot be nearest is left out direction by direction.

    Parameters
    ----------
    places : array, shape (places, 2)
    walls : tuple of array
        Start, end, direction, length, normal, offset, outward side and number of the wall of each face.
    corners : array, shape (corners, 2)
    units : array, shape (2, directions, 2)
        Unit vectors ahead and aside.
    first : float
        First direction, in radians.

    Returns
    -------
    array, shape (directions, places)
    """
    count, size = units.shape[1], places.shape[0]
    box = places[:, 0].min(), places[:, 1].min(), places[:, 0].max(), places[:, 1].max()
    ahead, aside = np.empty((count, size)), np.empty((count, size))
    for row in range(count):
        for place in range(size):
            ahead[row, place] = dot(units[0, row], places[place])
            aside[row, place] = dot(units[1, row], places[place])
    rays = paint_faces(places, box, aside, walls, units, first)
    squared, far, shift = np.empty((count, size)), np.empty(count), count // 12
    for row in range(count):
        left, right, axis = rays[1, (row + shift) % count], rays[2, (row - shift) % count], rays[0, row]
        for place in range(size):
            squared[row, place] = max(min(min(left[place], right[place]), axis[place]), 0.0)
        far[row] = greatest_of(squared[row])
        for place in range(size):
            squared[row, place] *= squared[row, place]
    for corner in corners:
        paint_corner(corner, squared, far, places, box, ahead, aside, units, first)
    for row in range(count):
        for place in range(size):
            squared[row, place] = math.sqrt(max(squared[row, place], 0.0))
    return squared
