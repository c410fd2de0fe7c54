"""Call every compiled loop once with arrays of the kinds that will come: all are there when needed."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from ciberrato.geometry.visible_faces import LONGEST, SECTORS


def call_all(kernels: ModuleType) -> None:
    """Compile all loops of `ciberrato.localization.belief.kernels`, or read them from numba's cache.

    Parameters
    ----------
    kernels : module
    """
    bins, size, stay = 4, 3, 0
    old, new = np.ones((bins, size + 1), np.float32), np.zeros((bins, size + 1), np.float32)
    moves, codes = np.zeros((1, size), np.int64), np.zeros(bins, np.int64)
    shown = np.zeros((2 * bins, size), np.uint8)[::2]  # a view of every other row, as of all tables
    table, share = np.ones(256, np.float32), np.float32(0.1)
    kernels.multiply_dense(old, shown, table)
    kernels.drive_dense(old, new, moves, codes, stay, True)
    kernels.diffuse_place(old, new, moves[0], moves[0], share, share)
    kernels.diffuse_heading(old, new, moves, codes, codes, stay, share, share)
    some, weight = np.zeros(2, np.int64), np.ones(2, np.float32)
    kernels.multiply_sparse(weight, some, some, shown, table)
    kernels.drive_sparse(some, some, moves, codes, True)
    sums, keys = np.zeros(bins * size), np.zeros(8, np.int64)
    count = kernels.add_up(sums, keys, 0, some, some, weight, size)
    kernels.take_out(sums, keys[:count], size)
    faces, place = np.ones((1, 9)), np.zeros(1)
    seen = np.full((1, SECTORS, LONGEST + 1, 2), np.inf, np.float32)
    kernels.cone_distances(faces, seen, some[:1], some[:1], place, place, place, place)
    row, ones, around = np.ones(1), np.ones((1, 2)), np.ones((2, 12, 2))
    walls = (ones, ones, ones, row, ones, row, row, some[:1])
    kernels.encode(kernels.sweep_tile(ones, walls, ones, around, 0.0), np.ones(1, np.uint8), row, 44, 0)
    kernels.wall_distances(ones, ones, ones, ones, row, 1.0)
    kernels.nearest_feet(ones, ones, ones, ones, row)
