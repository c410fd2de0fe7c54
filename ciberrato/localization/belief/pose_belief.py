"""The belief over (x, y, heading), and how it moves without blurring.

A state is a free square of the lattice and a bin of headings. Interpolating a belief from lattice to
lattice in every cycle would smear it, so the lattice moves with the robot: one offset is added to the
headings of all bins, and each bin has one offset in x and y, as all its states drive in the same
direction. Only when a bin's offset passes half the resolution do its states move by whole squares. What
blurs is what should: `diffuse`.

While much is possible the belief is an array of all states (*dense*); once little is, a list of the
states that have any weight (*sparse*). States too unlikely to matter leave the list for good; their total
weight is counted.

With the extra `fast` the loops run in machine code, see `ciberrato.localization.belief.compiled`; results are
the same.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from ciberrato.localization.belief import compiled
from ciberrato.localization.belief.lattice import Lattice

Weights = NDArray[np.float32]
Indices = NDArray[np.int64]

_SPARSE_BELOW = 0.1
"""Fraction of the states with weight below which a list of them is faster than an array of all."""
_LEAST_SHARE = 1e-7
"""Of a weight that is spread to a neighbour; less is lost in rounding, and slow: wheels never quite come to
rest, and what they give is squared until it is less than a processor takes for a normal number."""
REACH = 2
"""Greatest shift in squares at once."""


class PoseBelief:
    """Weights of all states; they sum to 1 after `normalize`.

    Parameters
    ----------
    lattice : Lattice
    bins : int
        Number of heading bins.
    prune : float
        Weight, in all, of the states that may be given up at once.
    uniform : bool
        Whether to begin with every free pose; otherwise with none, to be set.
    """

    def __init__(
        self, lattice: Lattice, bins: int = 72, *, prune: float = 1e-5, uniform: bool = True
    ) -> None:
        self.lattice = lattice
        self.bins = bins
        self.bin_width = 2.0 * math.pi / bins
        self.prune_weight = prune
        self.heading_offset = 0.0
        """Radians; bin k stands for the heading k * bin_width + heading_offset."""
        self.offset = np.zeros((bins, 2))
        """Units; a state of bin k is at its square's node plus row k."""
        self.given_up = 0.0
        """Weight of the states given up so far, before each normalization."""
        self._moves = lattice.move_table(REACH)
        self._spare: Weights | None = None
        self.dense: Weights | None = None
        self.bin: Indices = np.zeros(0, np.int64)
        self.square: Indices = np.zeros(0, np.int64)
        self.weight: Weights = np.zeros(0, np.float32)
        if uniform:
            self.set_uniform()

    # --- what it is ---------------------------------------------------------------------------------

    @property
    def states(self) -> int:
        """Number of states that have or may have weight."""
        return self.bins * self.lattice.size if self.dense is not None else len(self.weight)

    def headings(self) -> Floats:
        """Return the headings of the bins in radians, not wrapped; shape (bins,)."""
        return np.asarray(np.arange(self.bins) * self.bin_width + self.heading_offset)

    def set_uniform(self) -> None:
        """Set the belief to equal weights on every free pose."""
        self.heading_offset = 0.0
        self.offset[:] = 0.0
        shape = (self.bins, self.lattice.size + 1)  # the last column stands for all that is not free
        self.dense = np.full(shape, 1.0 / (self.bins * self.lattice.size), np.float32)
        self.dense[:, -1] = 0.0
        self._spare = np.zeros(shape, np.float32)

    def set_states(self, bins: Indices, squares: Indices) -> None:
        """Set the belief to equal weights on the given states only."""
        self.heading_offset = 0.0
        self.offset[:] = 0.0
        self.dense = self._spare = None
        self.bin, self.square = bins.copy(), squares.copy()
        self.weight = np.full(len(bins), 1.0 / max(len(bins), 1), np.float32)

    def set_weighted(
        self, bins: Indices, squares: Indices, weights: Floats, *, heading_offset: float
    ) -> None:
        """Set the belief to weighted states; equal states add up, squares not free are lost.

        Parameters
        ----------
        bins, squares : array of int
        weights : array
        heading_offset : float
            Radians.
        """
        self.heading_offset = heading_offset
        self.offset[:] = 0.0
        self.dense = self._spare = None
        self._merge([(bins, squares, weights.astype(np.float32))])
        self.normalize()

    def renumber(self, lattice: Lattice) -> None:
        """Change to a lattice with other numbers for the same nodes, on which all listed states are free.

        Parameters
        ----------
        lattice : Lattice
            Of the same lab and resolution; of another part of it.
        """
        old = self.lattice
        row, column = np.divmod(old.site[self.square], old.nx)
        column += old.corner[0] - lattice.corner[0]
        row += old.corner[1] - lattice.corner[1]
        self.square = lattice.index[row * lattice.nx + column]
        self.lattice, self._moves = lattice, lattice.move_table(REACH)

    def copy(self) -> PoseBelief:
        """Return a belief of its own that holds the same."""
        other = PoseBelief(self.lattice, self.bins, prune=self.prune_weight, uniform=False)
        other.heading_offset, other.offset = self.heading_offset, self.offset.copy()
        other.given_up = self.given_up
        other.dense = None if self.dense is None else self.dense.copy()
        other._spare = None if self._spare is None else np.zeros_like(self._spare)
        other.bin, other.square, other.weight = self.bin.copy(), self.square.copy(), self.weight.copy()
        return other

    def listed(self) -> tuple[Indices, Indices, Floats]:
        """List the states: bins, squares and weights; everything with weight if the belief is dense."""
        if self.dense is None:
            return self.bin, self.square, self.weight.astype(np.float64)
        bins, squares = np.nonzero(self.dense[:, :-1])
        return bins, squares, self.dense[bins, squares].astype(np.float64)

    def places(self, bins: Indices, squares: Indices) -> tuple[Floats, Floats]:
        """Return the x and y at which states are, their bins' offsets included, in units."""
        return (
            self.lattice.x[squares] + self.offset[bins, 0],
            self.lattice.y[squares] + self.offset[bins, 1],
        )

    def square_weights(self) -> Floats:
        """Return the weight of each square over all headings; shape (squares,)."""
        if self.dense is not None:
            return np.asarray(self.dense[:, :-1].sum(axis=0, dtype=np.float64))
        return np.bincount(self.square, self.weight, self.lattice.size).astype(np.float64)

    def bin_weights(self) -> Floats:
        """Return the weight of each bin of headings; shape (bins,)."""
        if self.dense is not None:
            return np.asarray(self.dense.sum(axis=1, dtype=np.float64))
        return np.bincount(self.bin, self.weight, self.bins).astype(np.float64)

    def entropy_bits(self) -> float:
        """Compute the entropy over all states, in bits."""
        weights = self.weight if self.dense is None else self.dense
        # In single precision, for speed; the sum is right to about 1e-5 bits.
        bits = np.log(np.maximum(weights, np.float32(1e-37)))
        bits *= weights
        return -_total(bits) / math.log(2.0)

    # --- evidence -------------------------------------------------------------------------------------

    def normalize(self) -> float:
        """Scale the weights to the sum 1 and return what it was; with nothing left, start from uniform."""
        weights = self.weight if self.dense is None else self.dense
        total = _total(weights)
        if not total > 1e-30:
            self.set_uniform()
            return 0.0
        weights *= np.float32(1.0 / total)
        return total

    def prune(self) -> None:
        """Drop what is too unlikely to matter; turn to the list when few states are left."""
        if self.dense is not None:
            least = np.float32(self.prune_weight / self.states)
            kept = self.dense > least
            count = np.count_nonzero(kept)
            if count > _SPARSE_BELOW * self.states:
                return
            # Copied, as numpy gives columns of one array: machine code is made for arrays without gaps.
            self.bin, self.square = (numbers.copy() for numbers in np.nonzero(kept))
            weight = self.dense[self.bin, self.square]
            self.dense = self._spare = None
        else:
            if len(self.weight) < 2:
                return
            keep = np.flatnonzero(self.weight > self.prune_weight / len(self.weight))
            if len(keep) > 0.97 * len(self.weight):
                return
            self.bin, self.square = self.bin[keep], self.square[keep]
            weight = self.weight[keep]
        self.weight = np.ascontiguousarray(weight)
        self.given_up += max(1.0 - float(weight.sum(dtype=np.float64)), 0.0)

    # --- motion ---------------------------------------------------------------------------------------

    def turn(self, angle: float) -> None:
        """Turn all states by an angle in radians."""
        self.heading_offset += angle

    def drive(self, distance: float, *, stay_if_blocked: bool) -> None:
        """Move every state along its heading.

        Parameters
        ----------
        distance : float
            Units; negative backwards; at most twice the resolution at once.
        stay_if_blocked : bool
            Whether states that would leave the free squares stay where they are; otherwise they are given up
            (the robot is known to have moved).
        """
        headings = self.headings()
        self.offset[:, 0] += distance * np.cos(headings)
        self.offset[:, 1] += distance * np.sin(headings)
        # Rounded a little coarser than the arithmetic, so that mirrored bins move in the same cycle.
        squares = np.round(np.round(self.offset / self.lattice.resolution, 9)).astype(np.int64)
        np.clip(squares, -REACH, REACH, out=squares)
        if not squares.any():
            return
        self.offset -= squares * self.lattice.resolution
        codes = _code(squares[:, 0], squares[:, 1])
        if self.dense is None:
            self._drive_sparse(codes, stay_if_blocked)
        else:
            self._drive_dense(codes, stay_if_blocked)

    def _drive_sparse(self, codes: Indices, stay_if_blocked: bool) -> None:
        kernels = compiled.kernels()
        if kernels is not None:
            self.square, count = kernels.drive_sparse(
                self.bin, self.square, self._moves, codes, stay_if_blocked
            )
            if count and not stay_if_blocked:
                self._drop(self.square == self.lattice.size)
            return
        target = self._moves[codes[self.bin], self.square]
        blocked = target == self.lattice.size
        if stay_if_blocked:
            self.square = np.where(blocked, self.square, target)
        else:
            self.square = target
            self._drop(blocked)

    def _drive_dense(self, codes: Indices, stay_if_blocked: bool) -> None:
        assert self.dense is not None
        assert self._spare is not None
        kernels = compiled.kernels()
        if kernels is not None:
            kernels.drive_dense(self.dense, self._spare, self._moves, codes, _STAY, stay_if_blocked)
            self.dense, self._spare = self._spare, self.dense
            return
        for row, code in enumerate(codes):
            old, new = self.dense[row], self._spare[row]
            if code == _STAY:
                new[:] = old
                continue
            old.take(self._moves[_OPPOSITE - code], out=new[:-1], mode="clip")
            if stay_if_blocked:
                blocked = np.flatnonzero(self._moves[code] == self.lattice.size)
                new[blocked] += old[blocked]
        self.dense, self._spare = self._spare, self.dense

    def _drop(self, gone: NDArray[np.bool_]) -> None:
        if gone.any():
            keep = np.flatnonzero(~gone)
            self.bin, self.square, self.weight = self.bin[keep], self.square[keep], self.weight[keep]

    def diffuse_place(self, variance: float, *, vertical: bool) -> None:
        """Spread along x, or along y.

        Parameters
        ----------
        variance : float
            Units squared.
        vertical : bool
            Along y instead of x.
        """
        share = min(variance / self.lattice.resolution**2 / 2.0, 0.3)
        if share < _LEAST_SHARE:
            return
        code = _code(0, 1) if vertical else _code(1, 0)
        if self.dense is not None:
            assert self._spare is not None
            source = (self._moves[code], self._moves[_OPPOSITE - code])
            keep = np.float32(1.0 - 2.0 * share)
            kernels = compiled.kernels()
            if kernels is not None:
                kernels.diffuse_place(self.dense, self._spare, *source, np.float32(share), keep)
                self.dense, self._spare = self._spare, self.dense
                return
            for old, new in zip(self.dense, self._spare, strict=True):
                np.add(old[source[0]], old[source[1]], out=new[:-1])
                new[:-1] *= np.float32(share)
                new += keep * old
            self.dense, self._spare = self._spare, self.dense
            return
        parts = [(self.bin, self.square, self.weight * np.float32(1.0 - 2.0 * share))]
        for step in (code, _OPPOSITE - code):
            target = self._moves[step, self.square]
            parts.append((self.bin, target, self.weight * np.float32(share)))
        self._merge(parts)

    def diffuse_heading(self, variance: float) -> None:
        """Spread over the neighbouring headings; variance in radians squared."""
        share = min(variance / self.bin_width**2 / 2.0, 0.3)
        if share < _LEAST_SHARE:
            return
        change = {step: self._row_change(step) for step in (1, -1)}
        if self.dense is not None:
            assert self._spare is not None
            keep, kernels = np.float32(1.0 - 2.0 * share), compiled.kernels()
            if kernels is not None:
                turned = (change[1], change[-1], _STAY, np.float32(share), keep)
                kernels.diffuse_heading(self.dense, self._spare, self._moves, *turned)
                self.dense, self._spare = self._spare, self.dense
                return
            np.multiply(self.dense, keep, out=self._spare)
            for step, codes in change.items():
                for row, code in enumerate(codes):
                    old = self.dense[row] * np.float32(share)
                    new = self._spare[(row + step) % self.bins]
                    if code == _STAY:
                        new += old
                    else:
                        new[:-1] += old[self._moves[_OPPOSITE - code]]
            self.dense, self._spare = self._spare, self.dense
            return
        parts = [(self.bin, self.square, self.weight * np.float32(1.0 - 2.0 * share))]
        for step, codes in change.items():
            target = self._moves[codes[self.bin], self.square]
            parts.append(((self.bin + step) % self.bins, target, self.weight * np.float32(share)))
        self._merge(parts)

    def _row_change(self, step: int) -> Indices:
        """Return by how many squares a state moves that changes to the next bin, whose offset differs."""
        difference = (self.offset - np.roll(self.offset, -step, axis=0)) / self.lattice.resolution
        squares = np.round(np.round(difference, 9)).astype(np.int64)
        return _code(squares[:, 0], squares[:, 1])

    def _merge(self, parts: list[tuple[Indices, Indices, Weights]]) -> None:
        """Add up the weights of equal states."""
        size = self.lattice.size
        kernels = compiled.kernels()
        if kernels is not None:
            room = self.lattice.scratch(self.bins)
            keys = np.empty(sum(len(weights) for _, _, weights in parts), np.int64)
            count = 0
            for bins, squares, weights in parts:
                count = kernels.add_up(room, keys, count, bins, squares, weights, size)
            met = np.sort(keys[:count])
            self.bin, self.square, self.weight = kernels.take_out(room, met, size)
            return
        bins, squares, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
        inside = np.flatnonzero((squares < size) & (weights > 0.0))
        keys, weights = bins[inside] * size + squares[inside], weights[inside]
        if len(weights) < 60_000:
            keys, inverse = np.unique(keys, return_inverse=True)
            total = np.bincount(inverse, weights, len(keys))
        else:
            sums = np.bincount(keys, weights, self.bins * size)
            keys = np.flatnonzero(sums)
            total = sums[keys]
        self.bin, self.square = keys // size, keys % size
        self.weight = total.astype(np.float32)


def _total(weights: Weights) -> float:
    """Sum up: rows in single precision (pairwise, so right to about 1e-7), which is much faster."""
    return float(weights.sum(axis=-1).sum(dtype=np.float64))


def _code(dx: Indices | int, dy: Indices | int) -> Indices:
    width = 2 * REACH + 1
    return np.asarray((np.asarray(dy) + REACH) * width + np.asarray(dx) + REACH, np.int64)


_STAY = int(_code(0, 0))
_OPPOSITE = 2 * _STAY
