# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, disallow-untyped-decorators=False
# The types are those of numba, which infers them.
"""Parts of `ciberrato.infrared.sweep` for machine code made by numba: the same distances to the last bit.

What only says which faces cannot be nearest (boxes, bearings, runs of directions) is that of
`ciberrato.infrared.sweep_plan`, with its margins, for one tile at a time.

numba keeps what it compiled until the file of the *calling* function changes: after a change here, remove
the caches of the caller, `ciberrato.localization.belief.kernels` (``__pycache__``).
"""

from __future__ import annotations

import math

import numpy as np
from numba.extending import register_jitable

from ciberrato.infrared.model import HALF_APERTURE, SENSOR_OFFSET
from ciberrato.infrared.sweep_plan import ALONG, ASIDE, INSIDE, NEAR, SIDE, SLACK, TOUCH

_BATCH = 8
"""Faces painted between two looks at how far the farthest ray of each direction reaches."""
_CORNER_TOUCH = TOUCH * math.cos(HALF_APERTURE)


@register_jitable
def face_distance(x, y, start, end, direction, length):
    """Return the distance of a point to a face, as `ciberrato.geometry.walls.face_distances` does."""
    dx, dy, ex, ey = x - start[0], y - start[1], x - end[0], y - end[1]
    along = dx * direction[0] + dy * direction[1]
    if along < 0.0:
        return math.sqrt(dx * dx + dy * dy)
    if along > length:
        return math.sqrt(ex * ex + ey * ey)
    return abs(dx * direction[1] - dy * direction[0])


@register_jitable
def near(places, start, end, direction, length):
    """List the faces that may be the nearest one of some places."""
    x = 0.5 * (places[:, 0].min() + places[:, 0].max())
    y = 0.5 * (places[:, 1].min() + places[:, 1].max())
    radius = 0.0
    for number in range(places.shape[0]):
        radius = max(radius, math.hypot(places[number, 0] - x, places[number, 1] - y))
    distance = np.empty(length.shape[0])
    for face in range(length.shape[0]):
        distance[face] = face_distance(x, y, start[face], end[face], direction[face], length[face])
    return np.flatnonzero(distance <= distance.min() + 2.0 * radius + 1e-6)


@register_jitable
def paint_faces(places, box, aside, walls, units, first):
    """Return the distances of the first faces along rays; shape (3, directions of the ray, places)."""
    start, end, _, length, normal, offsets, _, _ = walls
    count, size = aside.shape
    rays, far = np.full((3, count, size), np.inf), np.full((3, count), np.inf)
    distances, hidden = _visible(places, box, walls)
    away, fresh, painted = np.empty(size), np.zeros((3, count), np.bool_), 0
    farthest = np.full(count, np.inf)
    for face in np.argsort(distances):
        if hidden[face]:
            continue
        bound = distances[face] - SENSOR_OFFSET
        if painted >= _BATCH:
            for row in range(count):
                for ray in range(3):
                    if fresh[ray, row]:
                        far[ray, row] = greatest_of(rays[ray, row])
                farthest[row] = max(far[0, row], far[1, row], far[2, row])
            fresh[:], painted = False, 0
            if bound > farthest.max():
                break
        low, high = _bearings(box, start[face], end[face])
        turn = math.asin(min(SIDE / max(distances[face], SIDE), 1.0))
        everywhere = distances[face] < INSIDE or high - low + 2.0 * turn >= math.pi
        begin, number = _run(low - turn, high + turn, everywhere, first, count)
        least = -TOUCH if everywhere or distances[face] < NEAR else -math.inf
        known = False
        for step in range(number):
            row = (begin + step) % count
            if bound > farthest[row]:
                continue  # behind others
            from_side, to_side = dot(units[1, row], start[face]), dot(units[1, row], end[face])
            if abs(to_side - from_side) <= TOUCH * length[face]:
                continue  # edge-on
            if not known:
                known = True
                painted += 1
                for place in range(size):
                    away[place] = offsets[face] - dot(normal[face], places[place])
            rate = 1.0 / dot(units[0, row], normal[face])
            lean = dot(units[1, row], normal[face]) * rate
            for ray in range(3):
                if bound > far[ray, row]:
                    continue
                lead = ALONG[ray] + ASIDE[ray] * lean
                left = (min(from_side, to_side) - TOUCH) - ASIDE[ray]
                right = (max(from_side, to_side) + TOUCH) - ASIDE[ray]
                nearest, here = rays[ray, row], aside[row]
                for place in range(size):
                    reach, old = rate * away[place] - lead, nearest[place]
                    seen = (here[place] >= left) & (here[place] <= right) & (reach >= least) & (reach < old)
                    nearest[place] = reach if seen else old
                fresh[ray, row] = True
    return rays


@register_jitable
def paint_corner(corner, squared, far, places, box, ahead, aside, units, first):
    """Apply a corner to squared distances, whose greatest roots are `far`, where it is in the cone."""
    count, size, shift = squared.shape[0], squared.shape[1], squared.shape[0] // 12
    distance = _point_box(corner, box)
    if distance - SENSOR_OFFSET > far.max():
        return
    low, high = _bearings(box, corner, corner)
    begin, number = _run(low - HALF_APERTURE, high + HALF_APERTURE, distance < INSIDE, first, count)
    bound, known = distance - SENSOR_OFFSET, False
    squares = np.empty(size)
    for step in range(number):
        row = (begin + step) % count
        if bound > far[row]:
            continue
        if not known:
            known = True
            for place in range(size):
                dx, dy = corner[0] - places[place, 0], corner[1] - places[place, 1]
                squares[place] = (dx * dx + dy * dy) + SENSOR_OFFSET**2
        before, after = (row - shift) % count, (row + shift) % count
        forward = dot(units[0, row], corner)
        left = dot(units[1, after], corner) + SIDE - _CORNER_TOUCH
        right = dot(units[1, before], corner) - SIDE + _CORNER_TOUCH
        nearest, along, at_left, at_right = squared[row], ahead[row], aside[after], aside[before]
        for place in range(size):
            reach, old = along[place] + squares[place] - forward, nearest[place]
            seen = (at_left[place] >= left) & (at_right[place] <= right) & (reach < old)
            nearest[place] = reach if seen else old


@register_jitable
def _visible(places, box, walls):
    """Return the distances of faces from a box, and which are far sides of convex walls."""
    start, end, direction, length, normal, offsets, outward, wall = walls
    faces, walls_there = length.shape[0], int(wall.max()) + 1
    distances, behind, near = np.empty(faces), np.empty(faces, np.bool_), math.inf
    outside, touched = np.zeros(walls_there, np.bool_), np.zeros(walls_there, np.bool_)
    for face in range(faces):
        nearest = min(_point_box(start[face], box), _point_box(end[face], box))
        least, most = math.inf, -math.inf
        for x in (box[0], box[2]):
            for y in (box[1], box[3]):
                away = face_distance(x, y, start[face], end[face], direction[face], length[face])
                nearest = min(nearest, away)
                side = x * normal[face, 0] + y * normal[face, 1] - offsets[face]
                least, most = min(least, side), max(most, side)
        apart = least > 0.0 or most < 0.0
        for axis in range(2):
            apart |= min(start[face, axis], end[face, axis]) > box[2 + axis]
            apart |= max(start[face, axis], end[face, axis]) < box[axis]
        distances[face] = nearest if apart else 0.0
        if outward[face] < 0.0:
            least, most = -most, -least
        convex = outward[face] != 0.0
        outside[wall[face]] |= convex and least > 0.0
        behind[face] = convex and most < -NEAR
        touched[wall[face]] |= distances[face] < NEAR
        if distances[face] < NEAR:  # a sensor of a robot that touches it may be behind it
            for x, y in places:
                away = face_distance(x, y, start[face], end[face], direction[face], length[face])
                near = min(near, away)
    stick_out = near < SENSOR_OFFSET - TOUCH / 2.0
    for face in range(faces):
        behind[face] &= outside[wall[face]] and not (stick_out and touched[wall[face]])
    return distances, behind


@register_jitable
def _bearings(box, one, other):
    """Return between which angles a face lies, seen from a box that it does not meet."""
    x, y = 0.5 * (one[0] + other[0] - box[0] - box[2]), 0.5 * (one[1] + other[1] - box[1] - box[3])
    middle, least, most = math.atan2(y, x), math.inf, -math.inf
    for x in (box[0], box[2]):
        for y in (box[1], box[3]):
            for point in (one, other):
                turned = math.atan2(point[1] - y, point[0] - x) - middle
                turned -= 2.0 * math.pi * math.floor(turned / (2.0 * math.pi) + 0.5)
                least, most = min(least, turned), max(most, turned)
    return middle + least, middle + most


@register_jitable
def _run(low, high, everywhere, first, count):
    """Return the first direction between two angles, and the number of directions."""
    step = 2.0 * math.pi / count
    begin = math.floor((low - first) / step - SLACK)
    number = math.ceil((high - first) / step + SLACK) + 1 - begin
    if everywhere or number >= count:
        return 0, count
    return begin % count, number


@register_jitable
def _point_box(point, box):
    dx = max(box[0] - point[0], point[0] - box[2], 0.0)
    dy = max(box[1] - point[1], point[1] - box[3], 0.0)
    return math.sqrt(dx * dx + dy * dy)


@register_jitable
def greatest_of(row):
    """Return the greatest of some numbers, or 0; as integers, whose greatest is found many at a time."""
    greatest = np.int64(0)
    for bits in row.view(np.int64):
        greatest = max(greatest, bits)
    return np.array([greatest]).view(np.float64)[0]


@register_jitable
def dot(one, other):
    """Return the product of two vectors of two numbers."""
    return one[0] * other[0] + one[1] * other[1]
