"""Random numbers for many worlds: the streams of `simulator_stub.world.noise`, drawn in blocks.

Blocks form a chain: each is followed by the next one that was drawn. The holder of a block, a snapshot for
one, finds the numbers that follow it there, and only who comes to the end of the chain draws. So copies of
a batch share their generators and still all see the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ciberrato.arrays import Floats
from simulator_stub.world.noise import NoiseRoot

_BLOCK_NUMBERS = 2**19
"""Numbers drawn at a time, about, in all worlds together; of no influence on the numbers."""
_MOST_STEPS = 64
_ROBOT = 1
"""Every world has one robot."""


class _Block:
    """Numbers for some cycles; shape (cycles, worlds, numbers a cycle)."""

    __slots__ = ("following", "numbers")

    def __init__(self, numbers: Floats) -> None:
        self.numbers = numbers
        self.following: _Block | None = None


class _Source:
    """The generators of one use, one for each world, made when they are first needed."""

    def __init__(
        self, roots: Sequence[NoiseRoot], use: str, count: int, *, running: bool, normal: bool
    ) -> None:
        self._roots, self._use, self._running, self._normal = roots, use, running, normal
        self._count = count
        self._steps = max(1, min(_MOST_STEPS, _BLOCK_NUMBERS // max(1, len(roots) * count)))
        self._generators: list[np.random.Generator] | None = None

    def draw(self) -> _Block:
        """Draw the next block."""
        if self._generators is None:
            self._generators = [
                root.generator(_ROBOT, self._use, running=self._running) for root in self._roots
            ]
        numbers = np.empty((len(self._generators), self._steps, self._count))
        for generator, world in zip(self._generators, numbers, strict=True):
            if self._normal:
                generator.standard_normal(out=world)
            else:
                generator.random(out=world)
        # Those of one cycle side by side: they are read together.
        return _Block(np.ascontiguousarray(numbers.transpose(1, 0, 2)))


class BatchStream:
    """The streams of one use in all worlds.

    Parameters
    ----------
    roots : sequence of NoiseRoot
        The worlds' seeds.
    use : str
        What the numbers are for, as in a single simulation.
    count : int
        Numbers a cycle.
    running : bool
        Whether they are for running cycles.
    normal : bool
        Standard normal numbers, or uniform ones in [0, 1).
    """

    __slots__ = ("_block", "_next", "_source")

    def __init__(
        self, roots: Sequence[NoiseRoot], use: str, count: int, *, running: bool, normal: bool = True
    ) -> None:
        self._source = _Source(roots, use, count, running=running, normal=normal)
        self._block = _Block(np.empty((0, len(roots), count)))  # where the chain begins: no numbers yet
        self._next = 0

    def copy(self) -> BatchStream:
        """Make another one that gives the same numbers from here on."""
        twin = BatchStream.__new__(BatchStream)
        twin._source, twin._block, twin._next = self._source, self._block, self._next
        return twin

    def take(self) -> Floats:
        """Return the numbers of the next cycle.

        Returns
        -------
        array, shape (worlds, count)
            To look at only.
        """
        if self._next == len(self._block.numbers):
            if self._block.following is None:
                self._block.following = self._source.draw()
            self._block = self._block.following
            self._next = 0
        numbers: Floats = self._block.numbers[self._next]
        self._next += 1
        return numbers
