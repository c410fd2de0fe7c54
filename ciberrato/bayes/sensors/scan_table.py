"""Whole scans over large (x, y, heading) grids by table.

A beam's range depends on where the robot is and on the beam's absolute direction, so one table of ranges over
(place, direction) serves all beams and all headings: a beam is a roll of the heading axis. Ranges are kept as
codes of 8 bits, two beams side by side as one of 16, and each scan is turned into a table of what every code
is worth. An update is then one look-up for every two beams.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.checks import positive, range_array, whole
from ciberrato.bayes.spaces import StateSpace

_LEVELS = 256

Caster = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]
BeamLogLikelihood = Callable[[FloatArray, FloatArray], FloatArray]


class ScanTable:
    """Ranges from every free place in every direction, for beams that are whole heading cells apart.

    Parameters
    ----------
    space : StateSpace
        x, y, heading; the last periodic over a whole turn.
    free : BoolArray, shape (x, y)
        Where the robot can be; states elsewhere are impossible.
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
        places = space.centres()[:, :, 0, :2][free]
        x, y = np.ascontiguousarray(places[:, 0]), np.ascontiguousarray(places[:, 1])
        ranges = np.empty((headings.size, len(x)), dtype=np.float32)
        for k, angle in enumerate(headings.centres):
            ranges[k] = range_array(cast(x, y, np.full(len(x), angle), max_range), what="expected range")
        unknown = np.isnan(ranges)
        self._unknown = bool(unknown.any())
        # A range that is not known has the last code for itself.
        top = _LEVELS - 2 if self._unknown else _LEVELS - 1
        ranges[unknown] = 0.0
        codes = np.rint(np.minimum(ranges, max_range) * (top / max_range)).astype(np.uint8)
        codes[unknown] = _LEVELS - 1
        self._codes = codes
        # [direction, place]: the code in the direction and the one a spacing further on.
        self._pairs = codes.astype(np.uint16) * _LEVELS + np.roll(codes, -spacing, axis=0)

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
        return self._codes.nbytes + self._pairs.nbytes

    def log_likelihood(
        self, scan: ArrayLike, beam: BeamLogLikelihood, *, weight: float = 1.0
    ) -> NDArray[np.float32]:
        """Return the log likelihood of a scan for every state.

        Parameters
        ----------
        scan : array_like, shape (beams,)
            Ranges, right to left; nan where missing, +inf where nothing is within range.
        beam : callable
            (reading, expected) -> log likelihood per beam, broadcasting, as `BeamModel.beam_log_likelihood`.
        weight : float
            Exponent of the likelihood, in (0, 1]: below 1 for beams that are not independent given the cell,
            because all of them miss what the cell's centre does not show.

        Returns
        -------
        ndarray of float32, shape (x, y, heading)
            -inf where the robot cannot be; a beam counts at least -1e4. Sums of 200 beams are right to
            0.01.

        Raises
        ------
        ValueError
            If a range is negative, there are more or fewer than beams, or the weight is not in (0, 1].
        """
        scan = range_array(scan, beams=len(self.steps))
        if not 0.0 < weight <= 1.0:
            raise ValueError(f"the weight of a scan is in (0, 1], not {weight}")
        present = ~np.isnan(scan)
        worth = np.zeros((len(scan), _LEVELS))
        worth[present] = weight * np.maximum(beam(scan[present, np.newaxis], self.levels), -1e4)
        headings, places = self._codes.shape
        total = np.zeros((headings, places), dtype=np.float32)
        part = np.empty(places, dtype=np.float32)
        paired = len(scan) // 2 * 2
        for first in range(0, len(scan), 2):
            if first < paired:
                table, codes = (worth[first][:, np.newaxis] + worth[first + 1]).ravel(), self._pairs
            else:
                table, codes = worth[first], self._codes
            table = table.astype(np.float32)
            step = int(self.steps[first])
            for heading in range(headings):
                # mode="clip" spares a copy; all codes are in the table.
                np.take(table, codes[(heading + step) % headings], out=part, mode="clip")
                total[heading] += part
        result = np.full(self.space.shape, -np.inf, dtype=np.float32)
        result[self.free] = total.T
        return result
