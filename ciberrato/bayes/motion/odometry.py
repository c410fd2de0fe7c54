r"""Odometry as turn, drive, turn with Gaussian noise.

From :math:`(x, y, \theta)` the robot turns by :math:`\delta_1`, drives :math:`\tau` and turns by
:math:`\delta_2`, each normal about the odometry's figure (Probabilistic Robotics, table 5.6). The prediction
has this model's mean and variance, made by the passes of `ciberrato.bayes.motion.turn_drive_turn`.

The density over the end pose itself is taken at the centres of the cells where `normalized` is false. The end
pose at distance r and direction :math:`\phi` from the start can be reached driving forward or, where the
noise makes :math:`\tau` negative, backward:

.. math::
   p(x', y', \theta' | u, x, y, \theta) = \frac1r \sum_{s = \pm 1} N(s r; \tau, \sigma_\tau^2)\,
       W(\phi_s - \theta - \delta_1; \sigma_1^2)\, W(\theta' - \phi_s - \delta_2; \sigma_2^2)

with W the normal distribution wound round the circle and :math:`\phi_{-1} = \phi + \pi`. 1 / r is the
Jacobian of polar coordinates, which the product in table 5.5 leaves out; `density="book"` leaves it out too,
and the backward way. Sampling (table 5.6) draws from the former.

The sum over all pairs of cells needs no loop over pairs: the density is A(d) B(d, heading before) C(d,
heading after) for a displacement d, so that a prediction is one matrix product, a shift of each of its rows,
and a second matrix product. That is exact; but what is near the start is seen from the centre of a cell, so
that the mean falls short by a twentieth of a cell where ways and noise are a cell or two.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.angles import wrapped_normal
from ciberrato.bayes.arraytypes import FloatArray, IntArray
from ciberrato.bayes.motion.displacements import Displacements, displacements
from ciberrato.bayes.motion.inputs import check_belief
from ciberrato.bayes.motion.odometry_reading import OdometryNoise, OdometryReading, Prediction
from ciberrato.bayes.motion.passes import PoseCarry, check_motion, check_space
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.spaces import StateSpace

__all__ = ["GaussianOdometry", "OdometryNoise", "OdometryReading", "Prediction"]

Density = Literal["pose", "book"]

# Grids with at most this many (displacement, cell) pairs are shifted by one table of indices, others by
# slices.
_TABLE_LIMIT = 1_000_000
_BLOCK = 64
# Noise that the densities need, in cells.
_FINEST = 0.6


class GaussianOdometry:
    """Turn, drive, turn over an (x, y, heading) grid.

    Mass that leaves the grid is lost. Mean and variance are right for ways and noise of any size, as far as
    cells can have them (`ciberrato.bayes.motion.turn_drive_turn` says how far), and `predict_carried` for any
    number of steps finer than the cells. The densities need a drive's noise of 0.6 cells and turns' noise of
    0.6 heading cells, and are a ValueError below.

    Parameters
    ----------
    space : StateSpace
        Three axes, in the order x, y, heading; the last periodic over a whole turn.
    noise : OdometryNoise
        Standard deviations; may be 0 without a density.
    density : {"pose", "book"}, optional
        Take the density over the end pose, or the product of table 5.5, at the centres of the cells, and of
        parts of those that are near against the noise of the first turn.
    window : float, optional
        Leave out displacements whose distance is more than this many sigmas from the drive; all count if
        None.
    skip_below : float
        Leave out start states with less mass than this.
    normalized : bool
        Divide a density by `kernel_mass`, so that each state's kernel sums to 1 before the edges take their
        part. Otherwise headings along the grid's axes and between them gain and lose mass where the noise is
        as fine as the cells. False asks for the density "pose" if none is named.
    """

    def __init__(
        self,
        space: StateSpace,
        noise: OdometryNoise,
        *,
        density: Density | None = None,
        window: float | None = None,
        skip_below: float = 0.0,
        normalized: bool = True,
    ) -> None:
        check_space(space, "odometry")
        if density not in (None, "pose", "book"):
            raise ValueError(f"the density is 'pose', 'book' or None, not {density!r}")
        if (window is not None and not window > 0.0) or not skip_below >= 0.0:
            raise ValueError("the window must be positive and the mass to skip 0 or more")
        self.space = space
        self.noise = noise
        self.density: Density | None = "pose" if density is None and not normalized else density
        self.window = window
        self.skip_below = skip_below
        self.normalized = normalized
        self._passes = TurnDriveTurn(space=space, noise=noise, window=6.1)
        self._headings = space.axes[2].centres
        self._cell = (space.axes[0].cell, space.axes[1].cell)
        self._reach = (space.shape[0] - 1, space.shape[1] - 1)
        self._finest: float | None = None
        if self.density is not None:
            self._prepare()

    def _prepare(self) -> None:
        # The book's density belongs to the cell centres.
        self._finest = _finest_turn(self.noise) if self.density == "pose" else None
        self._all = displacements(self._reach, self._cell, rotation=self._finest)
        self._beyond: dict[tuple[int, int], Displacements] = {}
        self._forward, self._backward = self._source_tables()
        # Work space: a fresh array of this size costs more in page faults than the arithmetic on it.
        count, cells = self._forward.shape
        self._padded = np.zeros((cells + 1, self.space.shape[2]))
        self._spread, self._moved, self._other = (np.zeros((count, cells + 1 - k)) for k in (0, 1, 1))

    def _source_tables(self) -> tuple[IntArray, IntArray]:
        rows, columns, _ = self.space.shape
        count = len(self._all.distance)
        if count * rows * columns > _TABLE_LIMIT:
            return np.empty((0, 0), np.intp), np.empty((0, 0), np.intp)
        x, y = (v.ravel() for v in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
        tables = []
        for sign in (-1, 1):
            i = x + sign * self._all.cells[:, :1]
            j = y + sign * self._all.cells[:, 1:]
            inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
            # Sources off the grid point to a column of zeros after the last cell.
            source = np.where(inside, i * columns + j, rows * columns)
            tables.append(source + np.arange(count)[:, np.newaxis] * (rows * columns + 1))
        return tables[0], tables[1]

    def predict(self, belief: ArrayLike, control: OdometryReading) -> FloatArray:
        """Move a belief, shape (x, y, heading), by an odometry reading. Not normalized."""
        return self.predict_with_losses(belief, control).belief

    def predict_with_losses(self, belief: ArrayLike, control: OdometryReading) -> Prediction:
        """Move a belief and say what was left out.

        Parameters
        ----------
        belief : array_like, shape (x, y, heading)
            Sums to 1.
        control : OdometryReading
            The relative motion measured.

        Returns
        -------
        Prediction
        """
        belief = check_belief(belief, self.space.shape)
        skipped = 0.0
        if self.skip_below > 0.0:
            small = belief < self.skip_below
            skipped = float(belief[small].sum())
            belief = np.where(small, 0.0, belief)
        if self.density is None:
            moved = self._passes.predict_with_losses(belief, control, cut=self.window)
            truncated = 0.0 if self.window is None else moved.truncated
            return Prediction(moved.belief, skipped, truncated)
        self._check_fineness(control)
        chosen, truncated = self._window(control)
        steps = self._all.take(chosen)
        before, after, forward, backward = factors = self._factors(steps, control)
        if self.normalized:
            # A window cuts the kernel and not its norm, so that the mass cut off is missing and can be seen.
            within = self._sum_within(factors if self.window is None else self._factors(self._all, control))
            before /= within + self._sum_beyond(control)
        if self._forward.size and self.skip_below == 0.0:
            predicted = self._by_table(belief, chosen, before, after, forward, backward)
        elif self._forward.size:
            predicted = self._by_scatter(belief, chosen, before, after, forward, backward)
        else:
            predicted = self._by_slices(belief, steps, before, after, forward, backward)
        return Prediction(predicted, skipped, truncated)

    def predict_carried(
        self, belief: ArrayLike, control: OdometryReading, carry: PoseCarry
    ) -> tuple[FloatArray, PoseCarry]:
        """Move a belief by whole cells and carry the fractions over, as `TurnDriveTurn.predict_carried`."""
        return self._passes.predict_carried(belief, control, carry)

    def _check_fineness(self, control: OdometryReading) -> None:
        """Raise ValueError where the density at cell centres is not the distribution over the cells."""
        rot1, trans, rot2 = self.noise.sigmas(control)
        check_motion(self.space, [control.trans], [control.rot1, control.rot2], [trans])
        cell, turn = max(self._cell), self.space.axes[2].cell
        if trans < (1.0 - 1e-9) * _FINEST * cell or min(rot1, rot2) < (1.0 - 1e-9) * _FINEST * turn:
            raise ValueError(
                f"noise of {trans:g} and {min(rot1, rot2):g} rad is finer than {_FINEST} cells of {cell:g} "
                f"and {turn:g} rad: leave `density` and `normalized` out, or take smaller cells"
            )

    def kernel_mass(self, control: OdometryReading) -> FloatArray:
        """Return the density's sum over an unbounded grid for each heading before, (headings,); ideally 1.

        1 without a density.
        """
        if self.density is None:
            return np.ones(len(self._headings))
        self._check_fineness(control)
        factors = self._factors(self._all, control)
        return self._sum_within(factors) + self._sum_beyond(control)

    def _sum_within(
        self, factors: tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]
    ) -> FloatArray:
        before, after, forward, backward = factors
        # Driving backward along direction(d) ends at -d, but it begins and ends with the same headings as
        # forward.
        weight = forward if backward is None else forward + backward
        return np.asarray((after.sum(axis=1) * weight) @ before)

    def _sum_beyond(self, control: OdometryReading) -> FloatArray:
        """Sum over the displacements that are longer than the grid."""
        _, trans, _ = self.noise.sigmas(control)
        far = abs(control.trans) + 5.5 * trans
        reach = (math.ceil(far / self._cell[0]), math.ceil(far / self._cell[1]))
        if reach[0] <= self._reach[0] and reach[1] <= self._reach[1]:
            return np.zeros(len(self._headings))
        if reach not in self._beyond:
            steps = displacements(reach, self._cell, rotation=self._finest)
            self._beyond[reach] = steps.take((np.abs(steps.cells) > np.array(self._reach)).any(axis=1))
        return self._sum_within(self._factors(self._beyond[reach], control))

    def _window(self, control: OdometryReading) -> tuple[IntArray, float]:
        if self.window is None:
            return np.arange(len(self._all.distance)), 0.0
        _, sigma, _ = self.noise.sigmas(control)
        limit = self.window * sigma
        distance = self._all.distance
        near = np.abs(distance - control.trans) <= limit
        if self.density == "pose":
            near |= np.abs(distance + control.trans) <= limit
        return np.flatnonzero(near), math.erfc(self.window / math.sqrt(2.0))

    def _factors(
        self, steps: Displacements, control: OdometryReading
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]:
        """Return B and C, (displacements, headings), and A for both directions, (displacements,)."""
        rot1, trans, rot2 = self.noise.sigmas(control)
        direction = steps.direction[:, np.newaxis]
        before = wrapped_normal(direction - (self._headings + control.rot1), rot1)
        after = wrapped_normal((self._headings - control.rot2) - direction, rot2)
        after *= self.space.axes[2].cell
        scale = 1.0 / (trans * math.sqrt(2.0 * math.pi))
        forward = np.exp(-0.5 * np.square((steps.distance - control.trans) / trans)) * scale
        if self.density == "book":
            return before, after, forward * steps.area, None
        backward = None
        if control.trans < 8.5 * trans:
            backward = np.exp(-0.5 * np.square((steps.distance + control.trans) / trans)) * scale
            backward *= steps.inverse_distance
        return before, after, forward * steps.inverse_distance, backward

    def _by_table(
        self,
        belief: FloatArray,
        chosen: IntArray,
        before: FloatArray,
        after: FloatArray,
        forward: FloatArray,
        backward: FloatArray | None,
    ) -> FloatArray:
        cells, headings = belief.shape[0] * belief.shape[1], belief.shape[2]
        count = len(before)
        self._padded[:-1] = belief.reshape(cells, headings)
        whole = count == len(self._spread)
        if whole:
            np.matmul(before, self._padded.T, out=self._spread)
        else:
            self._spread[chosen] = before @ self._padded.T
        moved, other = self._moved[:count], self._other[:count]
        # mode="clip" lets numpy write straight into `out`; all indices are valid.
        np.take(self._spread, self._forward if whole else self._forward[chosen], out=moved, mode="clip")
        moved *= forward[:, np.newaxis]
        if backward is not None:
            # Driving backward along direction(d) leads to -d.
            np.take(self._spread, self._backward if whole else self._backward[chosen], out=other, mode="clip")
            other *= backward[:, np.newaxis]
            moved += other
        return np.asarray((moved.T @ after).reshape(belief.shape))

    def _by_scatter(
        self,
        belief: FloatArray,
        chosen: IntArray,
        before: FloatArray,
        after: FloatArray,
        forward: FloatArray,
        backward: FloatArray | None,
    ) -> FloatArray:
        """Move only the places that hold something."""
        cells, headings = belief.shape[0] * belief.shape[1], belief.shape[2]
        flat = belief.reshape(cells, headings)
        held = np.flatnonzero(flat.any(axis=1))
        spread = before @ flat[held].T
        moved = self._spread
        moved[...] = 0.0
        # The tables of sources read the other way: where driving backward comes from, driving forward goes
        # to. One displacement leads different places to different ones, but for those off the grid, whose
        # column is not used.
        rows = moved.ravel()
        to, fro = (
            table[:, held] if len(chosen) == len(table) else table[chosen[:, np.newaxis], held]
            for table in (self._backward, self._forward)
        )
        rows[to] = forward[:, np.newaxis] * spread
        if backward is not None:
            rows[fro] += backward[:, np.newaxis] * spread
        arrived = moved[:, :cells] if len(chosen) == len(moved) else moved[chosen, :cells]
        return np.asarray((arrived.T @ after).reshape(belief.shape))

    def _by_slices(
        self,
        belief: FloatArray,
        steps: Displacements,
        before: FloatArray,
        after: FloatArray,
        forward: FloatArray,
        backward: FloatArray | None,
    ) -> FloatArray:
        rows, columns, headings = belief.shape
        result = np.zeros(belief.shape)
        if not len(steps.cells) or not belief.any():
            return result
        held = belief.any(axis=2)
        box = tuple(slice(int(i.min()), int(i.max()) + 1) for i in np.nonzero(held))
        inner = belief[box]
        reach = np.abs(steps.cells).max(axis=0)
        low = [max(0, box[i].start - int(reach[i])) for i in range(2)]
        high = [min(n, box[i].stop + int(reach[i])) for i, n in enumerate((rows, columns))]
        shape = (high[0] - low[0], high[1] - low[1])
        source = np.ascontiguousarray(inner.reshape(-1, headings).T)
        total = np.zeros((headings, shape[0] * shape[1]))
        for start in range(0, len(steps.cells), _BLOCK):
            block = slice(start, start + _BLOCK)
            spread = (before[block] @ source).reshape(-1, *inner.shape[:2])
            moved = np.zeros((len(spread), *shape))
            for k, (i, j) in enumerate(steps.cells[block]):
                ways = [(1, forward[start + k])]
                if backward is not None:
                    ways.append((-1, backward[start + k]))
                for sign, weight in ways:
                    if weight > 0.0:
                        _add_shifted(
                            moved[k], spread[k], box, low, (sign * int(i), sign * int(j)), float(weight)
                        )
            total += after[block].T @ moved.reshape(len(spread), -1)
        result[low[0] : high[0], low[1] : high[1]] = total.T.reshape(*shape, headings)
        return result


def _finest_turn(noise: OdometryNoise) -> float:
    """Return the least standard deviation that the first turn can have; a degree if nothing bounds it."""
    return max(noise.rotation, math.radians(1.0))


def _add_shifted(
    target: FloatArray,
    source: FloatArray,
    box: tuple[slice, ...],
    low: list[int],
    step: tuple[int, int],
    weight: float,
) -> None:
    """Add an image at `box` of the grid, moved by `step` cells, to `target`, which begins at `low`."""
    to, taken = [], []
    for axis in range(2):
        first = box[axis].start - low[axis] + step[axis]
        begin, end = max(first, 0), min(first + source.shape[axis], target.shape[axis])
        if begin >= end:
            return
        to.append(slice(begin, end))
        taken.append(slice(begin - first, end - first))
    target[to[0], to[1]] += weight * source[taken[0], taken[1]]
