"""A robot that was not heard for a while: it may have been stopped at any moment, or gone on all the time.

Agents that hear nothing stop their robot, but whether and when that has reached it is not known: on a network
that carries nothing in either direction the last command stays in force. So the belief after a gap is a
mixture over the moment of the stop: of the beliefs along the way that the last command makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.localization.belief.pose_belief import Indices, PoseBelief
from ciberrato.physics.kinematics import STANDSTILL, Command

SURE = 4
"""Cycles after the last message in which the robot does as it was told in any case: an agent misses three,
its stop acts in the next cycle, and the wheels need about one more to come to rest."""
_EARLY, _NEVER = 0.4, 0.4
"""Prior probability that the stop reached the robot at once, or not before messages came again."""
LOST = 0.2
"""Prior probability that the last command before the gap was lost, too, and the one before it stayed."""
_MOST = 64
"""Greatest number of moments considered."""
_NOT_MOVING = 0.02
"""Probability that a robot that was stopped is said to collide."""


def doubtful_cycles(cycles: int, commands: Sequence[Command]) -> int:
    """Return in how many of the cycles between two messages it is not sure what the robot did.

    Parameters
    ----------
    cycles : int
    commands : sequence of (float, float)
        Commands that may have been in effect.
    """
    return 0 if all(command == STANDSTILL for command in commands) else max(cycles - SURE, 0)


class Interruption:
    """The beliefs along a way, or several, on which the robot may have been stopped.

    For each way `begin`, then `keep` before each doubtful cycle, and `end`; then `mix`.

    Parameters
    ----------
    moments : int
        Doubtful cycles.
    collided : bool
        Whether the message that ended the gap reports a collision.
    """

    def __init__(self, moments: int, *, collided: bool) -> None:
        shares = np.full(moments + 1, (1.0 - _EARLY - _NEVER) / (moments + 1))
        shares[: min(moments, 2)] += _EARLY / min(moments, 2)
        shares[-1] += _NEVER
        self._shares = shares
        self._step = -(-moments // _MOST)
        self._stopped = _NOT_MOVING if collided else 1.0
        self._number = 0
        self._share = self._way = 0.0
        self._kept: list[_Kept] = []

    def begin(self, share: float) -> None:
        """Begin a drive, which was the robot's with this probability."""
        self._number, self._share, self._way = 0, 0.0, share

    def keep(self, belief: PoseBelief) -> None:
        """Store a belief at which the robot may have stopped."""
        self._share += float(self._shares[self._number])
        self._number += 1
        if self._number % self._step == 0 or self._number == len(self._shares) - 1:
            self._note(belief, self._share * self._stopped)
            self._share = 0.0

    def end(self, belief: PoseBelief) -> None:
        """Store the belief at the drive's end, of a robot that was not stopped."""
        self._note(belief, float(self._shares[-1]))

    def _note(self, belief: PoseBelief, share: float) -> None:
        self._kept.append(_Kept(self._way * share, belief.copy()))

    def mix(self, belief: PoseBelief) -> None:
        """Replace a belief, that at the end of the last drive, by the mixture of all that were stored."""
        if all(kept.belief.dense is None for kept in self._kept):
            parts = [_moved(belief, kept.belief, kept.share) for kept in self._kept]
            bins, squares, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
            offset = belief.offset.copy()
            belief.set_weighted(bins, squares, weights, heading_offset=belief.heading_offset)
            belief.offset[:] = offset
            return
        mixed = np.zeros((belief.bins, belief.lattice.size + 1), np.float32)
        for kept in self._kept:
            states = kept.belief.dense
            assert states is not None
            turned = round((kept.belief.heading_offset - belief.heading_offset) / belief.bin_width)
            mixed += np.roll(states, turned, axis=0) * np.float32(
                kept.share / max(float(states.sum()), 1e-30)
            )
        mixed[:, -1] = 0.0
        belief.dense = mixed
        belief.normalize()


class _Kept(NamedTuple):
    share: float
    belief: PoseBelief


def _moved(belief: PoseBelief, other: PoseBelief, share: float) -> tuple[Indices, Indices, Floats]:
    """Express another belief's states by the offsets of this one, to half a square and half a bin."""
    bins, squares, weights = other.listed()
    lattice = belief.lattice
    turned = round((other.heading_offset - belief.heading_offset) / belief.bin_width)
    now = (bins + turned) % belief.bins
    shift = np.round((other.offset[bins] - belief.offset[now]) / lattice.resolution).astype(np.int64)
    site = lattice.site[squares] + shift[:, 1] * lattice.nx + shift[:, 0]
    inside = (site >= 0) & (site < len(lattice.index) - 1)
    target = np.where(inside, lattice.index[np.where(inside, site, 0)], lattice.size)
    # A square that is not free is one in which the robot would touch a wall: it is where it was.
    target = np.where(target == lattice.size, squares, target)
    return now, target, weights * (share / max(float(weights.sum()), 1e-30))
