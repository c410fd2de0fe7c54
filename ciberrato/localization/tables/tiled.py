"""Fine tables of a lab too large for them: tile by tile, where the belief has mass.

The belief on the fine lattice is a list of few states (`ciberrato.localization.filtering.stage`), which lie
in few places. Only the tiles around them are computed, when the belief comes near them; a *part* of the lab,
tables of some tiles, takes the place of tables of all of it. Squares of a part have the order that they have
in the whole lab, and what is computed of a place does not depend on its tile: so a belief on a part is, to
the last bit, what it is on tables of all squares, as long as no state comes near the part's edge.

What takes time is rationed: `TiledTables.fetch` computes a few tiles at most. It counts them, and does not
look at a clock, so that the same messages lead to the same belief.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ciberrato.arrays import Floats, Integers
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.sweep import Sweep
from ciberrato.localization.belief import compiled
from ciberrato.localization.belief.lattice import PAD, Lattice, Nodes
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.tables.pose_tables import BINS, FINE, Codes, PoseTables
from ciberrato.localization.tables.reading_codes import encode
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab

_EDGE = 20
"""Nodes along the edge of a tile: two units, as much as `ciberrato.infrared.sweep` computes at once."""
_BLOCK = 5
"""Nodes along the edge of the blocks in which states are looked for; a part of `_EDGE`."""
_MOST = 128
"""Tiles of a part: 512 square units, for which tables, moves and room take at most 60 MB."""
_KEPT = 512
"""Tiles kept, in the order of their last use; of at most 80 kB each for one table."""

Tiling = frozenset[int]


@dataclass(frozen=True, slots=True, eq=False)
class _Tile:
    """Free squares of a tile, by their columns and rows among all nodes of the lab, and their codes."""

    __repr__ = short_repr

    lattice: Lattice
    column: Integers
    row: Integers
    codes: tuple[Codes, ...]


class TiledTables:
    """Computes tiles of a lab's tables, and joins them.

    Parameters
    ----------
    lab : Lab
    whole : PoseTables
        Tables of all of the lab on a coarser lattice.
    resolution : float
        Units between nodes.
    most, kept : int
        Tiles of a part, and tiles kept.
    """

    def __init__(
        self, lab: Lab, whole: PoseTables, resolution: float = FINE, *, most: int = _MOST, kept: int = _KEPT
    ) -> None:
        self.whole = whole
        self._most, self._kept = most, max(kept, most)
        self._nodes = Nodes(lab, resolution)
        self._across = math.ceil(len(self._nodes.columns) / _EDGE)
        walls, around = WallMap.from_lab(lab), BINS * whole.steps
        self._sweeps = [
            Sweep(walls, math.radians(fraction), around, convert=encode, loops=compiled.kernels())
            for fraction in whole.fractions
        ]
        self._tiles: OrderedDict[int, _Tile] = OrderedDict()
        self._room = np.zeros(0)
        self.computed = 0
        """Tiles computed so far, those again that were forgotten."""

    @property
    def resolution(self) -> float:
        """Units between nodes."""
        return self._nodes.resolution

    @property
    def megabytes(self) -> float:
        """Memory of the tiles kept."""
        arrays = [tile.lattice.index.nbytes + 64 * len(tile.row) for tile in self._tiles.values()]
        codes = [one.nbytes for tile in self._tiles.values() for one in tile.codes]
        return (sum(arrays) + sum(codes)) / 1e6

    def around(self, belief: PoseBelief, reach: float) -> Tiling | None:
        """Return the tiles within a reach of all states of a belief.

        Parameters
        ----------
        belief : PoseBelief
            A list of states, on any lattice of the lab.
        reach : float
            Units along each axis; as much as half a unit more is taken.

        Returns
        -------
        frozenset of int or None
            None if they are more than a part may have.
        """
        x, y = belief.places(belief.bin, belief.square)
        column, row = self._nearest(x, self._nodes.columns), self._nearest(y, self._nodes.rows)
        blocks = len(self._nodes.columns) // _BLOCK + 1, len(self._nodes.rows) // _BLOCK + 1
        marked = np.zeros(blocks[::-1], np.bool_)
        marked[row // _BLOCK, column // _BLOCK] = True
        met_row, met_column = (_BLOCK * index for index in np.nonzero(marked))
        if len(met_row) > self._most * (_EDGE // _BLOCK) ** 2:
            return None
        nodes = math.ceil(reach / self.resolution)
        found: set[int] = set()
        steps = [*range(-nodes, nodes + _BLOCK, _EDGE), nodes + _BLOCK - 1]
        columns = [np.clip(met_column + step, 0, len(self._nodes.columns) - 1) // _EDGE for step in steps]
        rows = [np.clip(met_row + step, 0, len(self._nodes.rows) - 1) // _EDGE for step in steps]
        for across in columns:
            for up in rows:
                found.update(np.unique(up * self._across + across).tolist())
        return frozenset(found) if len(found) <= self._most else None

    def _nearest(self, places: Floats, axis: Floats) -> Integers:
        number = np.round((places - axis[0]) / self.resolution).astype(np.int64)
        return np.asarray(np.clip(number, 0, len(axis) - 1))

    def missing(self, tiles: Iterable[int]) -> int:
        """Return how many of some tiles would have to be computed."""
        return sum(tile not in self._tiles for tile in tiles)

    def fetch(self, tiles: Tiling, most: int) -> bool:
        """Compute tiles, at most so many of those that are missing; return whether all are there."""
        for number in sorted(tiles):
            if number in self._tiles:
                self._tiles.move_to_end(number)
            elif most > 0:
                most -= 1
                self._tiles[number] = self._compute(number)
                self.computed += 1
        while len(self._tiles) > self._kept:
            self._tiles.popitem(last=False)
        return self.missing(tiles) == 0

    def _compute(self, number: int) -> _Tile:
        up, across = divmod(number, self._across)
        columns, rows = (slice(_EDGE * first, _EDGE * (first + 1)) for first in (across, up))
        lattice = self._nodes.lattice(columns, rows)
        row, column = np.divmod(lattice.site, lattice.nx)
        around = BINS * self.whole.steps
        codes = tuple(
            sweep.tile(lattice.representative) if lattice.size else np.zeros((around, 0), np.uint8)
            for sweep in self._sweeps
        )
        return _Tile(lattice, column + columns.start, row + rows.start, codes)

    def part(self, tiles: Tiling) -> PoseTables:
        """Join tiles that `fetch` has computed.

        Parameters
        ----------
        tiles : frozenset of int

        Returns
        -------
        PoseTables
            Their squares row by row, as in tables of all of the lab.
        """
        chosen = [self._tiles[number] for number in sorted(tiles)]
        column, row = (np.concatenate([getattr(tile, name) for tile in chosen]) for name in ("column", "row"))
        # The least box around them, padded like a lab.
        left = _EDGE * min(number % self._across for number in tiles) - PAD
        right = _EDGE * (max(number % self._across for number in tiles) + 1) + PAD
        below = _EDGE * min(number // self._across for number in tiles) - PAD
        above = _EDGE * (max(number // self._across for number in tiles) + 1) + PAD
        nx, ny = right - left, above - below
        site = (row - below) * nx + column - left
        order = np.argsort(site)
        site = site[order]
        index = np.full(nx * ny + 1, len(site), np.int64)
        index[site] = np.arange(len(site))

        def joined(name: str) -> Floats:
            return np.concatenate([getattr(tile.lattice, name) for tile in chosen])[order]

        first = self._nodes.columns[0], self._nodes.rows[0]
        lattice = Lattice(
            resolution=self.resolution,
            nx=nx,
            ny=ny,
            origin=(float(first[0] + left * self.resolution), float(first[1] + below * self.resolution)),
            x=joined("x"),
            y=joined("y"),
            representative=joined("representative"),
            clearance=joined("clearance"),
            cell=joined("cell").astype(np.int64),
            site=site,
            index=index,
            whole=self.whole.lattice,
            corner=(left, below),
            first=(float(first[0]), float(first[1])),
        )
        if compiled.kernels() is not None:
            self._share_room(lattice)
        return PoseTables(
            lattice=lattice,
            steps=self.whole.steps,
            codes=tuple(self._joined_codes(chosen, table, order) for table in range(len(self._sweeps))),
            sensors=self.whole.sensors,
            fractions=self.whole.fractions,
            whole=self.whole,
        )

    def _joined_codes(self, chosen: list[_Tile], table: int, order: Integers) -> Codes:
        codes = np.concatenate([tile.codes[table] for tile in chosen], axis=1)
        twice = np.empty((2 * len(codes), codes.shape[1]), np.uint8)
        np.take(codes, order, axis=1, out=twice[: len(codes)], mode="clip")
        twice[len(codes) :] = twice[: len(codes)]
        return twice

    def _share_room(self, lattice: Lattice) -> None:
        if len(self._room) < BINS * lattice.size:
            self._room = np.zeros(BINS * lattice.size)
        lattice.share_scratch(BINS, self._room)
