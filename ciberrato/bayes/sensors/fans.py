"""Scans by fans of neighbouring beams: few look-ups for each state, where many places see alike.

From most places a wall looks as it does from others: of the eight codes of a fan of beams there are some
4,000 combinations in each direction of a museum of 30,000 places. Each is numbered, a scan is added up for
every combination once, and states look the sums of their fans up. Two halves of a scan go side by side, as
real and imaginary part of one number.

`ciberrato.bayes.sensors.scan_table.ScanTable` is made of this.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import FloatArray, IntArray

FAN = 8
"""Beams of a fan: pairs of pairs of pairs."""

# Combinations up to this many times the places are numbered by a table, more by sorting.
_SPARSE = 8


class Fans:
    """The combinations of codes that there are in each direction, and which of them each place has.

    Parameters
    ----------
    codes : uint8 array, shape (directions, places)
    spacing : int
        Directions between two beams.
    """

    def __init__(self, codes: NDArray[np.uint8], spacing: int) -> None:
        directions = len(codes)
        self._spacing = spacing
        numbers = codes.astype(np.intp)
        begins = np.arange(directions + 1) * 256
        # For pairs, fours and fans: numbers of the two halves of each combination, all directions in a row.
        self._halves: list[tuple[IntArray, IntArray]] = []
        width = 1
        while width < FAN:
            found, first, second, counts = [], [], [], [0]
            for k in range(directions):
                ahead = (k + width * spacing) % directions
                held, number = _numbered(numbers[k], numbers[ahead], int(begins[ahead + 1] - begins[ahead]))
                first.append(held[0] + begins[k])
                second.append(held[1] + begins[ahead])
                counts.append(len(held[0]))
                found.append(number)
            if width == 1:  # codes are the same in all directions
                first, second = ([part % 256 for part in parts] for parts in (first, second))
            self._halves.append((np.concatenate(first), np.concatenate(second)))
            numbers, begins = np.array(found), np.cumsum(counts)
            width *= 2
        most = int(np.diff(begins).max())
        self._numbers = numbers.astype(np.uint16 if most <= 65536 else np.int32)
        self._begins = begins

    @property
    def nbytes(self) -> int:
        """Memory that the combinations take."""
        return self._numbers.nbytes + sum(part.nbytes for pair in self._halves for part in pair)

    def sums(self, worth: FloatArray, first: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return what both halves of the beams are worth in all, each of shape (headings, places).

        Parameters
        ----------
        worth : FloatArray, shape (beams, 256)
            By code; neighbouring beams are a spacing apart.
        first : int
            Directions between straight ahead and the first beam.
        """
        directions, places = self._numbers.shape
        table = halved(worth)
        fans = len(table) // FAN
        values = list(table)
        for one, other in self._halves:
            values = self._joined(values, one, other)
        here, ahead = (np.empty((directions, places), dtype=np.float32) for _ in range(2))

        def look(begin: int, end: int) -> None:
            both, part = np.empty(places, np.complex64), np.empty(places, np.complex64)
            for heading in range(begin, end):
                for fan in range(fans):
                    seen = (heading + first + fan * FAN * self._spacing) % directions
                    table = values[fan][self._begins[seen] : self._begins[seen + 1]]
                    # mode="clip" spares a copy; all numbers are in the table.
                    np.take(table, self._numbers[seen], out=part if fan else both, mode="clip")
                    if fan:
                        np.add(both, part, out=both)
                here[heading] = both.real
                # The second half of the scan is that of another heading.
                ahead[(heading - fans * FAN * self._spacing) % directions] = both.imag

        compiled.share(look, directions, here.size)
        return here, ahead

    @staticmethod
    def _joined(
        values: list[NDArray[np.complex64]], one: IntArray, other: IntArray
    ) -> list[NDArray[np.complex64]]:
        """Return the sums of neighbouring tables, for the combinations of their entries."""

        def join(begin: int, end: int) -> list[NDArray[np.complex64]]:
            part = np.empty(len(one), np.complex64)
            sums = []
            for k in range(begin, end):
                np.take(values[2 * k + 1], other, out=part, mode="clip")
                sums.append(np.take(values[2 * k], one, mode="clip"))
                sums[-1] += part
            return sums

        found = compiled.share(join, len(values) // 2, len(values) // 2 * len(one))
        return [part for some in found for part in some]


def halved(worth: FloatArray) -> NDArray[np.complex64]:
    """Return what beams are worth, the second half of them as imaginary parts, shape (n, 256).

    n is the least multiple of `FAN` for both halves; beams that are not there are worth nothing.
    """
    count = -(-len(worth) // (2 * FAN)) * FAN
    both = np.zeros((2, count, worth.shape[1]), dtype=np.float32)
    both.reshape(2 * count, -1)[: len(worth)] = worth
    return np.asarray(both[0] + 1j * both[1], dtype=np.complex64)


def sums_of_states(worth: FloatArray, codes: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return what the beams of some states are worth in all, added in the order of `Fans.sums`, shape (n,).

    Parameters
    ----------
    worth : FloatArray, shape (beams, 256)
    codes : uint8 array, shape (beams, n)
    """
    count = -(-len(worth) // (2 * FAN)) * FAN
    values = np.zeros((2 * count, codes.shape[1]), dtype=np.float32)
    flat = worth.astype(np.float32).ravel()
    np.take(flat, codes + 256 * np.arange(len(worth))[:, np.newaxis], out=values[: len(worth)], mode="clip")
    width = 1
    while width < FAN:
        values = values[::2] + values[1::2]
        width *= 2
    # Row by row.
    half = len(values) // 2
    return np.asarray(np.add.reduce(values[:half], axis=0) + np.add.reduce(values[half:], axis=0))


def _numbered(first: IntArray, second: IntArray, seconds: int) -> tuple[tuple[IntArray, IntArray], IntArray]:
    """Return the pairs that there are, and which each place has.

    Parameters
    ----------
    first, second : IntArray, shape (places,)
    seconds : int
        Numbers of the second kind.
    """
    key = first * seconds + second
    size = (int(first.max()) + 1) * seconds
    if size <= _SPARSE * len(key) + 65536:
        there = np.zeros(size, dtype=bool)
        there[key] = True
        pairs = np.flatnonzero(there)
        number = np.empty(size, dtype=np.intp)
        number[pairs] = np.arange(len(pairs))
        return np.divmod(pairs, seconds), number[key]
    pairs, number = np.unique(key, return_inverse=True)
    return np.divmod(pairs, seconds), number
