"""All random numbers of a batch: for each use the streams of running worlds and of those that stand still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ciberrato.arrays import Floats, Integers
from simulator_stub.batch.noise import BatchStream, IdleStream
from simulator_stub.batch.plan import BatchPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.simulation import GPS_OFFSET_RANGE
from simulator_stub.world.noise import NoiseRoot

_DEVIATIONS = {
    "motors": "motor_deviation",
    "infrared": "obstacle_deviation",
    "compass": "compass_deviation",
    "gps": "gps_deviation",
    "beacons": "beacon_deviation",
}


class BatchNoise:
    """Draws what a cycle needs; what has no noise in any world draws nothing, which changes no other stream.

    Parameters
    ----------
    plan : BatchPlan
    """

    def __init__(self, plan: BatchPlan) -> None:
        self._plan = plan
        self._roots: list[NoiseRoot] = [NoiseRoot(())] * plan.worlds
        self._counts = {use: count for use, count, _ in plan.uses()}
        self._streams: dict[str, BatchStream] = {}
        self._idle = {
            use: IdleStream(plan.worlds, use, count, normal=normal) for use, count, normal in plan.uses()
        }

    def copy(self) -> BatchNoise:
        """Make another one that gives the same numbers from here on."""
        twin = BatchNoise.__new__(BatchNoise)
        twin._plan, twin._roots, twin._counts = self._plan, list(self._roots), self._counts
        twin._streams = {use: stream.copy() for use, stream in self._streams.items()}
        twin._idle = {use: stream.copy() for use, stream in self._idle.items()}
        return twin

    def renew(
        self,
        worlds: list[int],
        given: Sequence[NoiseRoot] | None,
        state: BatchState,
    ) -> None:
        """Let worlds begin anew, with new seeds or with fresh numbers of those that they have.

        Parameters
        ----------
        worlds : list of int
        given : sequence of NoiseRoot, or None
            One for each of these.
        state : BatchState
            Its deviations and labs say what is drawn; GPS offsets are set.
        """
        for place, world in enumerate(worlds):
            self._roots[world] = self._roots[world].next_world() if given is None else given[place]
        roots = [self._roots[world] for world in worlds]
        for use, count, normal in self._plan.uses():
            counts = self._counts_of_worlds(use, state)
            renewed = [counts[world] for world in worlds]
            self._idle[use].renew(worlds, roots, renewed)
            if use in self._streams:
                self._streams[use].renew(worlds, roots, renewed)
            elif self._is_needed(use, state):
                self._streams[use] = BatchStream(self._roots, use, count, normal=normal, counts=counts)
        if self._plan.shared.gps:
            for world, root in zip(worlds, roots, strict=True):
                draw = root.generator(0, "gps offset").random
                offset = (GPS_OFFSET_RANGE * float(draw()), GPS_OFFSET_RANGE * float(draw()))
                state.gps_offset[world] = offset

    def _counts_of_worlds(self, use: str, state: BatchState) -> list[int]:
        """How many numbers a cycle each world draws; only beacons are not the same number everywhere."""
        if use != "beacons":
            return [self._counts[use]] * self._plan.worlds
        there = [len(lab.world.lab.beacons) for lab in self._plan.labs]
        return [there[lab] for lab in state.lab.tolist()]

    def _is_needed(self, use: str, state: BatchState) -> bool:
        if use == "line":
            return bool((state.line_probability < 1.0).any())
        return bool((getattr(state, _DEVIATIONS[use]) > 0.0).any())

    def take(self, use: str, running: Integers, idle: Integers | None = None) -> Floats | None:
        """Draw the numbers of a cycle.

        Parameters
        ----------
        use : str
        running : array of int
            Worlds in which time passes.
        idle : array of int, optional
            Those in which it stands still; None for none.

        Returns
        -------
        array, shape (worlds, numbers), or None
            Normal or uniform numbers, to look at only; None where none are needed.
        """
        stream = self._streams.get(use)
        if stream is None:
            return None
        if idle is None or not idle.size:
            return stream.take()
        worlds, count = self._plan.worlds, self._counts[use]
        numbers = stream.take().copy() if running.size else np.zeros((worlds, count))
        numbers[idle] = self._idle[use].take(idle)
        return numbers
