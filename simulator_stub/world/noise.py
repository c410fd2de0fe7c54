"""Random numbers: one independent stream for each robot, each use, and each kind of cycle.

Everything random in a simulation comes from one seed. It is not drawn from one sequence, though: each
stream below is a generator of its own, whose seed is derived from the simulation's seed and from

- the number of the world (0 at first, one more after each Reset),
- the robot's position number,
- the name of the use (``motors``, or the name of a sensor),
- whether the cycle is a running one or not.

So switching a sensor on, adding a robot, or registering robots in another order leaves all other noise as
it was. And because cycles in which time stands still draw from streams of their own, the noise of the
running cycles does not depend on how long the robots waited for Start.

Within a stream the order is: ``motors`` two normals a running cycle, right wheel first; a sensor as its
module says, once a cycle, whether or not the reading is then sent.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = 256
"""Numbers drawn at a time; of no influence on the numbers."""


@dataclass(frozen=True, slots=True)
class NoiseRoot:
    """The seed of one world, from which all its streams are derived.

    Attributes
    ----------
    entropy : tuple of int
        32-bit words, drawn once from the simulation's generator.
    world : int
        Number of times that the world has begun anew.
    """

    entropy: tuple[int, ...]
    world: int = 0

    @classmethod
    def from_generator(cls, generator: np.random.Generator) -> NoiseRoot:
        """Draw the seed of all streams; this is the only use of the simulation's generator."""
        return cls(tuple(int(word) for word in generator.integers(0, 2**32, size=4, dtype=np.uint64)))

    @classmethod
    def from_seed(cls, seed: int | np.random.Generator) -> NoiseRoot:
        """Draw the seed of all streams from a seed or a generator; TypeError if it is neither."""
        if isinstance(seed, np.random.Generator):
            return cls.from_generator(seed)
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
            raise TypeError(f"seed: {seed!r:.60} is neither a whole number nor a numpy Generator")
        if seed < 0:
            raise ValueError(f"seed: {seed!r} is below 0")
        return cls.from_generator(np.random.default_rng(int(seed)))

    def next_world(self) -> NoiseRoot:
        """Return the seed of the world after a Reset."""
        return NoiseRoot(self.entropy, self.world + 1)

    def generator(self, robot_id: int, use: str, *, running: bool = True) -> np.random.Generator:
        """Create the generator of one stream.

        Parameters
        ----------
        robot_id : int
            Position number; 0 for what belongs to the world.
        use : str
            Purpose of the numbers.
        running : bool
            Whether they are for running cycles.

        Returns
        -------
        numpy.random.Generator
        """
        key = (self.world, robot_id, zlib.crc32(use.encode()), int(running))
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence(self.entropy, spawn_key=key)))


class Stream:
    """A supply of random numbers, drawn in blocks because single draws from numpy are slow.

    Parameters
    ----------
    root : NoiseRoot
    robot_id : int
    use : str
    running : bool
        As in `NoiseRoot.generator`.

    Attributes
    ----------
    position : int
        Place of the next normal number in the block that was drawn last.
    """

    __slots__ = ("_generator", "_key", "_normals", "_root", "position")

    def __init__(self, root: NoiseRoot, robot_id: int, use: str, *, running: bool) -> None:
        self._root = root
        self._key = (robot_id, use, running)
        self._generator: np.random.Generator | None = None
        self._normals: list[float] = []
        self.position = 0

    def normal(self) -> float:
        """Return the next standard normal number."""
        number = self.position
        if number == len(self._normals):
            return self.normals(1)[0]
        self.position = number + 1
        return self._normals[number]

    def normals(self, count: int) -> list[float]:
        """Return the next standard normal numbers, at most `BLOCK` of them.

        A stream should serve either normals or uniforms: with both, the numbers depend on `BLOCK`.
        """
        begin = self.position
        end = self.position = begin + count
        if end > len(self._normals):
            self.position = begin
            self.peek(count)
            begin, end = 0, count
            self.position = count
        return self._normals[begin:end]

    def peek(self, count: int) -> list[float]:
        """Return the normal numbers that come next, at most `BLOCK`, and leave them in the stream.

        Who uses them adds their number to `position`.
        """
        begin = self.position
        if begin + count > len(self._normals):
            self._normals = self._normals[begin:] + self._source().standard_normal(BLOCK).tolist()
            self.position = begin = 0
        return self._normals[begin : begin + count]

    def uniforms(self, count: int) -> NDArray[np.float64]:
        """Return the next numbers uniform in [0, 1), drawn when requested: request many at a time."""
        return self._source().random(count)

    def _source(self) -> np.random.Generator:
        if self._generator is None:
            robot_id, use, running = self._key
            self._generator = self._root.generator(robot_id, use, running=running)
        return self._generator


def streams(root: NoiseRoot, robot_id: int, use: str) -> tuple[Stream, Stream]:
    """Create the two streams of one use: ``streams(...)[running]`` is the one for a cycle."""
    return (
        Stream(root, robot_id, use, running=False),
        Stream(root, robot_id, use, running=True),
    )
