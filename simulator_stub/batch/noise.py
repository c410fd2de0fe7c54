"""Random numbers for many worlds: the streams of `simulator_stub.world.noise`, drawn in blocks.

Running worlds step together, so their numbers are drawn for many cycles at once. Blocks form a chain: each is
followed by the next one that was drawn. Whatever holds a block, a snapshot for one, finds the numbers that
follow it there, and only at the end of the chain are numbers drawn. So copies of a batch share their
generators and still all see the same numbers. A world that begins anew gets new numbers in the blocks that
are left; if a copy looks at these, too, the chain is copied before.

Worlds that do not run (before the start, after the end) draw one at a time.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from ciberrato.arrays import Floats, Integers
from simulator_stub.world.noise import NoiseRoot

_BLOCK_NUMBERS = 2**19
"""Numbers drawn at a time, about, in all worlds together; of no influence on the numbers."""
_MOST_STEPS = 64
_IDLE_CYCLES = 8
_ROBOT = 1
"""Every world has one robot."""


class _Block:
    """Numbers for some cycles; shape (cycles, worlds, numbers a cycle)."""

    __slots__ = ("following", "numbers")

    def __init__(self, numbers: Floats) -> None:
        self.numbers = numbers
        self.following: _Block | None = None


class _Source:
    """The generators of one use, one for each world, made when they are first needed.

    Attributes
    ----------
    shared : bool
        Whether more than one stream draws from it.
    counts : list of int
        Numbers a cycle of each world, of which there is room for `count`.
    """

    def __init__(
        self, roots: Sequence[NoiseRoot], use: str, counts: list[int], count: int, normal: bool
    ) -> None:
        self._roots, self._use, self._normal = list(roots), use, normal
        self.counts, self.count = counts, count
        self._steps = max(1, min(_MOST_STEPS, _BLOCK_NUMBERS // max(1, len(roots) * count)))
        self._generators: list[np.random.Generator | None] = [None] * len(roots)
        self.shared = False

    def draw(self) -> _Block:
        """Draw the next block."""
        numbers = np.zeros((len(self._roots), self._steps, self.count))
        for world in range(len(numbers)):
            self.fill(world, numbers[world])
        # Those of one cycle side by side: they are read together.
        return _Block(np.ascontiguousarray(numbers.transpose(1, 0, 2)))

    def fill(self, world: int, numbers: Floats) -> None:
        """Fill in the next numbers of one world, shape (cycles, count)."""
        generator = self._generators[world]
        if generator is None:
            generator = self._generators[world] = self._roots[world].generator(_ROBOT, self._use)
        count = self.counts[world]
        draw = generator.standard_normal if self._normal else generator.random
        if count == self.count and numbers.flags.c_contiguous:
            draw(out=numbers)
        elif count:
            numbers[:, :count] = draw((len(numbers), count))

    def renew(self, world: int, root: NoiseRoot, count: int) -> None:
        """Reset a world's numbers."""
        self._roots[world], self._generators[world], self.counts[world] = root, None, count

    def detached(self) -> _Source:
        """Return a copy that goes on independently with the same numbers."""
        twin = copy.copy(self)
        twin._roots, twin.counts = list(self._roots), list(self.counts)
        twin._generators = copy.deepcopy(self._generators)
        twin.shared = False
        return twin


class BatchStream:
    """The streams of one use in all running worlds.

    Parameters
    ----------
    roots : sequence of NoiseRoot
        The worlds' seeds.
    use : str
        Purpose of the numbers, as in a single simulation.
    count : int
        Numbers a cycle, at most.
    normal : bool
        Standard normal numbers, or uniform ones in [0, 1).
    counts : list of int, optional
        Numbers a cycle of each world; default: `count`.
    """

    __slots__ = ("_block", "_next", "_source")

    def __init__(
        self,
        roots: Sequence[NoiseRoot],
        use: str,
        count: int,
        *,
        normal: bool = True,
        counts: list[int] | None = None,
    ) -> None:
        self._source = _Source(roots, use, counts or [count] * len(roots), count, normal)
        self._block = _Block(np.empty((0, len(roots), count)))  # where the chain begins: no numbers yet
        self._next = 0

    def copy(self) -> BatchStream:
        """Return a copy that draws the same numbers from here on."""
        twin = BatchStream.__new__(BatchStream)
        self._source.shared = True
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

    def renew(self, worlds: Sequence[int], roots: Sequence[NoiseRoot], counts: Sequence[int]) -> None:
        """Reset some worlds' numbers at the next cycle; those of the others stay."""
        if self._source.shared:
            self._detach()
        for world, root, count in zip(worlds, roots, counts, strict=True):
            self._source.renew(world, root, count)
            block: _Block | None = self._block
            begin = self._next
            while block is not None:
                if begin < len(block.numbers):
                    self._source.fill(world, block.numbers[begin:, world])
                block, begin = block.following, 0

    def _detach(self) -> None:
        self._source = self._source.detached()
        old: _Block | None = self._block
        first = last = _Block(np.empty((0, *self._block.numbers.shape[1:])))
        begin = self._next
        while old is not None:
            last.following = _Block(old.numbers[begin:].copy())
            last, old, begin = last.following, old.following, 0
        self._block, self._next = first, 0


class IdleStream:
    """The streams of one use for cycles in which time stands still, drawn world by world.

    Parameters
    ----------
    worlds : int
    use : str
    count : int
    normal : bool
        As in `BatchStream`.
    """

    __slots__ = ("_count", "_next", "_normal", "_tapes", "_use")

    def __init__(self, worlds: int, use: str, count: int, *, normal: bool = True) -> None:
        self._use, self._count, self._normal = use, count, normal
        self._tapes: list[_Tape | None] = [None] * worlds
        self._next = [0] * worlds

    def copy(self) -> IdleStream:
        """Return a copy that draws the same numbers from here on: a tape only grows."""
        twin = IdleStream(0, self._use, self._count, normal=self._normal)
        twin._tapes, twin._next = list(self._tapes), list(self._next)
        return twin

    def take(self, worlds: Integers) -> Floats:
        """Return the next numbers of some worlds, shape (len(worlds), count)."""
        rows = np.zeros((len(worlds), self._count))
        for row, world in enumerate(worlds.tolist()):
            tape = self._tapes[world]
            assert tape is not None
            begin = self._next[world]
            self._next[world] = begin + tape.count
            rows[row, : tape.count] = tape.read(begin)
        return rows

    def renew(self, worlds: Sequence[int], roots: Sequence[NoiseRoot], counts: Sequence[int]) -> None:
        """Reset some worlds' numbers."""
        for world, root, count in zip(worlds, roots, counts, strict=True):
            self._tapes[world] = _Tape(root, self._use, count, self._normal)
            self._next[world] = 0


class _Tape:
    """The idle numbers of one world, as far as they were drawn."""

    __slots__ = ("_generator", "_key", "_normal", "_numbers", "count")

    def __init__(self, root: NoiseRoot, use: str, count: int, normal: bool) -> None:
        self._key, self.count, self._normal = (root, use), count, normal
        self._generator: np.random.Generator | None = None
        self._numbers: list[float] = []

    def read(self, begin: int) -> list[float]:
        if len(self._numbers) < begin + self.count:
            if self._generator is None:
                root, use = self._key
                self._generator = root.generator(_ROBOT, use, running=False)
            draw = self._generator.standard_normal if self._normal else self._generator.random
            self._numbers += draw(_IDLE_CYCLES * self.count).tolist()
        return self._numbers[begin : begin + self.count]
