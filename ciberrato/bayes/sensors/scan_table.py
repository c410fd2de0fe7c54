"""Whole scans over large (x, y, heading) grids by table.

A beam's range depends on where the robot is and on the beam's absolute direction, so one table of ranges over
(place, direction) serves all beams and all headings: a beam is a roll of the heading axis. Ranges are kept as
codes of 8 bits, and each scan is turned into a table of what every code is worth. Neighbouring beams are
looked up together (`ciberrato.bayes.sensors.fans`): 3 look-ups a state for scans of 46 beams.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import positive, range_array, whole
from ciberrato.bayes.sensors.fans import Fans, sums_of_states
from ciberrato.bayes.spaces import StateSpace
from ciberrato.reprs import short_repr

_LEVELS = 256
# Rays to ask for at a time: a thread's worth for each core.
_RAYS = 1_000_000
# Places whose headings are laid side by side at a time: few enough for the second cache.
_PLACES = 512
# States whose beams are looked up at a time.
_STATES = 1024

Caster = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]
BeamLogLikelihood = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class ScanLikelihood:
    """The log likelihood of one scan, to be asked for some states or all.

    Attributes
    ----------
    table : ScanTable
    worth : FloatArray, shape (beams, 256)
        Log likelihood of each code of a range, by beam.
    """

    __repr__ = short_repr

    table: ScanTable
    worth: FloatArray

    def __call__(self, states: IntArray | None = None) -> NDArray[np.float32]:
        """Return it for states with these numbers, shape (n,); for all, shape of the space, if None."""
        if compiled.kernels(self.table.space.size) is not None:
            return self.table._compiled(states, self.worth)
        if states is None:
            return self.table._of_all(self.worth)
        return self.table._of_states(states, self.worth)

    def for_loops(self) -> tuple[Any, ...] | None:
        """Return what `TurnDriveTurn.step` takes; None if machine code is not loaded."""
        if compiled.kernels(self.table.space.size) is None:
            return None
        return self.table._for_loops(self.worth)

    @property
    def highest(self) -> float:
        """Log likelihood that no state exceeds: each beam's best range, wherever it may be."""
        best = float(self.worth.max(axis=1).sum())
        return best + 1e-6 * (1.0 + abs(best))  # single precision may round up


class ScanTable:
    """Ranges from every free place in every direction, for beams that are whole heading cells apart.

    Parameters
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    free : BoolArray, shape (x, y)
        Cells in which the robot can be; states elsewhere are impossible.
    cast : callable
        (x, y, angle, max_range) -> ranges, as `OccupancyGrid.cast` and `SegmentMap.cast`; nan where unknown.
    beams : int
        Number of beams of a scan, from right to left, symmetric about straight ahead.
    spacing : int
        Heading cells between two beams.
    max_range : float
        Longest range, in units of length.
    """

    def __init__(
        self, space: StateSpace, free: BoolArray, cast: Caster, *, beams: int, spacing: int, max_range: float
    ) -> None:
        if len(space.axes) != 3 or not math.isclose(space.axes[2].length, 2.0 * math.pi):
            raise ValueError("a scan table needs axes x, y, heading, the last over a whole turn")
        if free.shape != space.shape[:2] or not free.any():
            raise ValueError(
                f"the free cells have shape {free.shape}, the space {space.shape[:2]}; some must be free"
            )
        beams = whole(beams, what="the number of beams", least=1)
        spacing = whole(spacing, what="the spacing of the beams", least=1)
        positive(max_range, what="max_range")
        self.space = space
        self.free = free
        self.max_range = max_range
        headings = space.axes[2]
        # With an even number of beams none looks straight ahead: half a spacing, rounded to cells, is left
        # over.
        self.steps = (np.arange(beams) - (beams - 1) // 2) * spacing
        self._spacing = spacing
        compiled.load_for(space.size)
        x, y = (axis.centres[at] for axis, at in zip(space.axes, np.nonzero(free), strict=False))
        ranges = np.empty((headings.size, len(x)), dtype=np.float32)
        some = max(1, _RAYS // len(x))
        for k in range(0, headings.size, some):
            angles = headings.centres[k : k + some]
            found = cast(np.tile(x, len(angles)), np.tile(y, len(angles)), angles.repeat(len(x)), max_range)
            ranges[k : k + some] = range_array(found, what="expected range").reshape(len(angles), -1)
        self._unknown = bool(np.isnan(ranges.min()))
        # A range that is not known has the last code for itself.
        top = _LEVELS - 2 if self._unknown else _LEVELS - 1
        self._codes = np.empty(ranges.shape, dtype=np.uint8)
        for codes, row in zip(self._codes, ranges, strict=True):
            unknown = np.isnan(row)
            row[unknown] = 0.0
            codes[:] = np.rint(np.minimum(row, max_range) * (top / max_range))
            codes[unknown] = _LEVELS - 1
        # Made when numpy first looks at all states.
        self._fans: Fans | None = None
        # Made when states are first asked for one by one.
        self._rows: NDArray[np.uint8] | None = None
        # The codes place by place; made when machine code first asks for them.
        self._by_place: NDArray[np.uint8] | None = None
        self._row_of: IntArray = np.where(free.ravel(), np.cumsum(free) - 1, -1)

    @property
    def angles(self) -> FloatArray:
        """Directions of the beams relative to the heading, shape (beams,), radians."""
        return np.asarray(self.steps * self.space.axes[2].cell, dtype=np.float64)

    @property
    def levels(self) -> FloatArray:
        """Ranges that the codes stand for, shape (256,); a range is off by at most half a step.

        The last is nan, of rays that come to an unknown cell, if there are any.
        """
        if self._unknown:
            return np.append(np.linspace(0.0, self.max_range, _LEVELS - 1), np.nan)
        return np.linspace(0.0, self.max_range, _LEVELS)

    @property
    def nbytes(self) -> int:
        """Memory that the table takes."""
        others = [one for one in (self._rows, self._by_place, self._fans) if one is not None]
        return sum(one.nbytes for one in (self._codes, self._row_of, *others))

    def log_likelihood(
        self,
        scan: ArrayLike,
        beam: BeamLogLikelihood,
        *,
        weight: float = 1.0,
        states: IntArray | None = None,
    ) -> NDArray[np.float32]:
        """Return the log likelihood of a scan for every state, or for some.

        Parameters
        ----------
        scan : array_like, shape (beams,)
            Ranges, right to left; nan where missing, +inf where nothing is within range.
        beam : callable
            (reading, expected) -> log likelihood per beam, broadcasting, as `BeamModel.beam_log_likelihood`.
        weight : float
            Exponent of the likelihood, in (0, 1]: below 1 for beams that are not independent given the cell,
            because all of them miss what the cell's centre does not show.
        states : IntArray, shape (n,), optional
            Numbers of cells in the raveled belief. What they get is what they get among all.

        Returns
        -------
        ndarray of float32, shape (x, y, heading) or (n,)
            -inf where the robot cannot be; a beam counts -1e4 at least. Sums of 200 beams are right to
            0.01. In machine code (`ciberrato.bayes.compiled`) they are added up in another order, and differ
            by at most 1.2e-7 for each beam times the sum of what the beams are worth.

        Raises
        ------
        ValueError
            If a range is negative, there are more or fewer than beams, or the weight is not in (0, 1].
        """
        return self.scan(scan, beam, weight=weight)(states)

    def scan(self, scan: ArrayLike, beam: BeamLogLikelihood, *, weight: float = 1.0) -> ScanLikelihood:
        """Return the log likelihood of a scan as a function of states, for `SelectiveFilter.update`.

        Parameters and errors as of `log_likelihood`.
        """
        scan = range_array(scan, beams=len(self.steps))
        if not 0.0 < weight <= 1.0:
            raise ValueError(f"the weight of a scan is in (0, 1], not {weight}")
        present = ~np.isnan(scan)
        worth = np.zeros((len(scan), _LEVELS))
        worth[present] = weight * np.maximum(beam(scan[present, np.newaxis], self.levels), -1e4)
        return ScanLikelihood(self, worth)

    def _of_all(self, worth: FloatArray) -> NDArray[np.float32]:
        if self._fans is None:
            self._fans = Fans(self._codes, self._spacing)
        here, ahead = self._fans.sums(worth, int(self.steps[0]))
        result = np.full((len(self._row_of), len(here)), -np.inf, dtype=np.float32)
        rows = np.flatnonzero(self.free)

        def lay(begin: int, end: int) -> None:
            for first in range(begin, end, _PLACES):
                block = slice(first, min(first + _PLACES, end))
                result[rows[block]] = np.ascontiguousarray((here[:, block] + ahead[:, block]).T)

        compiled.share(lay, len(rows), here.size)
        return result.reshape(self.space.shape)

    def _of_states(self, states: IntArray, worth: FloatArray) -> NDArray[np.float32]:
        """Return the log likelihood of some states, summed as that of all is."""
        headings = len(self._codes)
        low, high = int(self.steps.min()), int(self.steps.max())
        if self._rows is None:
            # [place, direction]: all beams of a state lie side by side, without a seam at half a turn.
            around = np.arange(low, headings + high) % headings
            self._rows = np.ascontiguousarray(self._codes[around].T)
        place, heading = np.divmod(np.asarray(states, dtype=np.intp), headings)
        row = self._row_of[place]
        at = np.maximum(row, 0) * self._rows.shape[1] + heading - low
        codes, steps = self._rows.ravel(), self.steps[:, np.newaxis]
        total = np.empty(len(at), dtype=np.float32)
        for begin in range(0, len(at), _STATES):
            piece = slice(begin, begin + _STATES)
            total[piece] = sums_of_states(worth, np.take(codes, at[piece] + steps))
        total[row < 0] = -np.inf
        return total

    def _for_loops(self, worth: FloatArray) -> tuple[Any, ...]:
        """Return what `ciberrato.bayes.scan_loops.scan_places` takes, up to its array for the result."""
        loops: Any = compiled.kernels(self.space.size)
        if self._by_place is None:
            # Directions with the same remainder by the spacing lie side by side.
            order = np.argsort(np.arange(len(self._codes)) % self._spacing, kind="stable")
            self._by_place = np.ascontiguousarray(self._codes[order].T)
        beams = len(worth)
        stride = -(-beams // loops.RUN) * loops.RUN
        table = _aligned(_LEVELS * stride)
        table.reshape(-1, stride)[:, :beams] = worth[::-1].T
        return self._by_place, self._row_of, table, beams, self._spacing, int(self.steps.max())

    def _compiled(self, states: IntArray | None, worth: FloatArray) -> NDArray[np.float32]:
        """Return the log likelihood of all states or some, by machine code."""
        loops: Any = compiled.kernels(self.space.size)
        given = self._for_loops(worth)
        if states is not None:
            some = np.ascontiguousarray(states, dtype=np.intp)
            chosen = np.empty(len(some), dtype=np.float32)
            loops.scan_states(*given, some, chosen)
            return chosen
        result = np.empty(self.space.size, dtype=np.float32)
        compiled.share(
            lambda begin, end: loops.scan_places(*given, result, begin, end),
            len(self._row_of),
            result.size,
        )
        return result.reshape(self.space.shape)


def _aligned(size: int) -> NDArray[np.float32]:
    """Return zeros that begin with a cache line."""
    room = np.zeros(size + 16, dtype=np.float32)
    begin = -room.ctypes.data % 64 // 4
    return room[begin : begin + size]
