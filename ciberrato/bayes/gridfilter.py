"""A belief over a large (x, y, heading) grid: prediction and scan in one pass where machine code does it.

A prediction is put off until the scan comes. Then each place is predicted, looked up and multiplied while it
is in the cache, and the belief is not scaled: the next step divides by its sum. That spares two thirds of
what the three steps read and write one after another.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import belief_array
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.odometry_reading import OdometryReading
from ciberrato.bayes.motion.turn_drive_turn import Plan, TurnDriveTurn
from ciberrato.bayes.recovery import ImpossiblePolicy
from ciberrato.bayes.selective import LogLikelihood

# Likelihoods are followed down to so many nats below the highest that there may be; products below the least
# become zero; sums below the last are left to the steps one after another.
_DOUBLE = -600.0, 1e-300, 1e-50
_SINGLE = -87.0, 1.1754944e-38, 1e-12


class GridFilter:
    """A belief over all states of a large grid.

    Parameters
    ----------
    prior : array_like
        Initial belief, shape of the space; is normalized.
    motion : TurnDriveTurn
    on_impossible : {"raise", "keep", "uniform", "likelihood"}
        Policy for impossible readings.
    dtype : {float64, float32}
        Precision of the belief, as of `MarkovFilter`.

    Attributes
    ----------
    log_evidence : float
        Sum of the log evidence of all possible readings so far, mass lost in predictions included.
    recoveries : int
        Number of readings that were impossible, so that the policy decided.
    lost : int
        Number of states that a reading has set to zero although they were possible: below 1e-200 in double
        precision, 1e-25 in single.

    Notes
    -----
    In double precision a belief differs from that of prediction and update one after another by 1e-14 of its
    greatest entry a step, in single by 1e-5 of each entry of 1e-25 or more.
    """

    def __init__(
        self,
        prior: ArrayLike,
        motion: TurnDriveTurn,
        *,
        on_impossible: ImpossiblePolicy = "raise",
        dtype: DTypeLike = np.float64,
    ) -> None:
        kind = np.dtype(dtype)
        if kind not in (np.float32, np.float64):
            raise ValueError(f"the belief is of float64 or float32, not {kind}")
        self.log_evidence = 0.0
        self.recoveries = self.lost = 0
        self._motion = motion
        self._policy: ImpossiblePolicy = on_impossible
        self._limits = _SINGLE if kind == np.float32 else _DOUBLE
        given = belief_array(prior, what="prior", shape=motion.space.shape)
        # The belief is this array times a factor, once it has been moved by the control put off.
        self._masses: FloatArray = np.ascontiguousarray(given / given.sum(), dtype=kind)
        self._factor = 1.0
        self._put_off: tuple[OdometryReading, Plan | None] | None = None
        # Room for the next belief; none where a caller has the last one.
        self._spare: FloatArray | None = None
        self._lent = False

    @property
    def belief(self) -> FloatArray:
        """Current belief, sums to 1; zero if a prediction has lost all. It stays as it is in later steps."""
        if self._put_off is not None:
            self._move()
            kept = float(self._masses.sum(dtype=np.float64)) * self._factor
            if kept > 0.0:
                self.log_evidence += math.log(kept)
                self._factor /= kept
        self._scale()
        self._lent = True
        return self._masses

    def predict(self, control: OdometryReading) -> None:
        """Move the belief by an odometry reading; errors as of `TurnDriveTurn.predict_with_losses`."""
        plan = self._motion.plan(control)
        self._move()
        self._put_off = control, plan

    def update(self, log_likelihood: LogLikelihood) -> None:
        """Correct the belief by a reading.

        Parameters
        ----------
        log_likelihood : callable
            As of `SelectiveFilter.update`; `ScanTable.scan` makes one that is taken in one pass.

        Raises
        ------
        ImpossibleReadingError
            If the reading is impossible and `on_impossible` is "raise". The belief stays as predicted.
        ValueError
            If the likelihoods have the wrong shape, are nan or infinite.
        """
        if self._step(log_likelihood):
            return
        self._move()
        self._scale()
        scores = log_likelihood(None)
        result = update(self._masses, scores, on_impossible=self._policy, out=self._room())
        self._taken(result.posterior)
        self.lost += result.lost
        if result.log_evidence > -math.inf:
            self.log_evidence += result.log_evidence
        else:
            self.recoveries += 1

    def _step(self, log_likelihood: LogLikelihood) -> bool:
        """Predict and correct in one pass; return whether that could be done."""
        look: Any = log_likelihood
        if self._put_off is None or self._put_off[1] is None or not hasattr(look, "for_loops"):
            return False
        scan = look.for_loops()
        if scan is None or look.table.space.shape != self._masses.shape:
            return False
        out = self._room()
        far, least, least_sum = self._limits
        limits = look.highest, far, least, least, 1e300 / out.size
        total, lost = self._motion.step(self._put_off[1], self._masses, self._factor, scan, limits, out)
        if not least_sum < total < math.inf:
            return False
        self._taken(out)
        self._put_off, self._factor = None, 1.0 / total
        self.log_evidence += look.highest + math.log(total)
        self.lost += lost
        return True

    def _room(self) -> FloatArray:
        """Return an array for the next belief."""
        if self._spare is None:
            self._spare = np.empty_like(self._masses)
        return self._spare

    def _taken(self, masses: FloatArray) -> None:
        """Set the array of the belief; the last one is room from now on, unless a caller has it."""
        self._spare = None if self._lent else self._masses
        self._masses, self._lent = masses, False

    def _scale(self) -> None:
        """Multiply the belief by its factor."""
        if self._factor != 1.0:
            np.multiply(self._masses, self._masses.dtype.type(self._factor), out=self._masses)
            self._factor = 1.0

    def _move(self) -> None:
        """Do the prediction that has been put off, if any."""
        if self._put_off is not None:
            control, self._put_off = self._put_off[0], None
            self._masses, self._lent = self._motion.predict(self._masses, control), False
