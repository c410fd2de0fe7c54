r"""Selective updating: the filter works where the belief is, and looks everywhere when readings refute it.

Fox, Burgard, Thrun, Markov Localization for Mobile Robots in Dynamic Environments (JAIR 11, 1999), section
3.3: states that hold next to nothing are not updated one by one; they are passive, and have one common mass.
Here that mass is what has been given up, plus a small probability that the robot has been carried off; a
reading multiplies it by the mean likelihood over states all over the space, other ones each time, and by an
advantage, because that mass would gather, were it computed, where readings are explained better than on the
average. As long as the active states do better still, it stays small. When they do not, half of the belief is
spread over the whole space, and everything is computed again.

**What is left out.** Let k be the mass that is kept, not normalized, and r a bound on the mass that the
filter over all states has and this one has not. A step leaves out d, a likelihood is nowhere above S:
:math:`r \leftarrow S (r + d)`. The total variation between both posteriors is at most r / (k + r), because
every state that is kept has exactly its share of k, times k / (k + r). That is the worst case: that all that
was ever left out lay where every later reading was explained best. So the bound grows by S / evidence with
each reading and says nothing after some; `left_out_now`, of one step, stays, and `passive` is the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes import compiled
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.checks import belief_array, refuse_log_likelihood, whole
from ciberrato.bayes.filtering import predict, update
from ciberrato.bayes.kidnapping import inject
from ciberrato.bayes.motion.selected import States, heavy
from ciberrato.bayes.recovery import ImpossiblePolicy
from ciberrato.bayes.spaces import StateSpace

LogLikelihood = Callable[[IntArray | None], ArrayLike]
"""log p(reading | state) of the states with these numbers, shape (n,); of all, in the belief's shape, if
None.

`ScanTable.scan` makes one; its `highest`, if it has one, is what no state's exceeds."""

# Share of a belief that is refuted and spread over all states: it may be right, or worth nothing.
_EVEN = 0.5
_GOLDEN = 0.6180339887498949


class SelectiveMotion(Protocol):
    """A motion model that moves listed states: `TurnDriveTurn`."""

    @property
    def space(self) -> StateSpace:
        """Return the space of x, y and heading."""

    @property
    def free(self) -> BoolArray | None:
        """Return where the robot can be, shape (x, y)."""

    def predict(self, belief: ArrayLike, control: Any) -> FloatArray:
        """Move all states."""

    def predict_states(
        self, states: IntArray, masses: FloatArray, control: Any, *, skip: float = 0.0
    ) -> States:
        """Move some states, and leave out a share of their mass."""


class SelectiveFilter:
    """A belief over a large grid, of which only states that matter are computed.

    Parameters
    ----------
    prior : array_like
        Initial belief, shape of the space; is normalized.
    motion : SelectiveMotion
        `TurnDriveTurn`.
    skip : float
        Share of the mass that a step may leave out, in states that hold least; 0: none but zeros.
    widest : float
        Share of all states up to which those that matter are listed; above it all are computed.
    kidnapped : float
        Probability, for each prediction, that the robot has been carried off to anywhere; 0: what is left
        out alone can refute the belief.
    advantage : float
        Nats by which a robot that is elsewhere would explain its readings better than the average state.
        More finds the kidnapped sooner, and looks more often for nothing where readings tell little.
    refuted : float
        Probability of the passive states at which all are looked at again.
    probes : int
        States all over the free space whose likelihood is asked for at every reading.
    on_impossible : {"raise", "keep", "uniform", "likelihood"}
        Policy for readings that are impossible in all states, or in all that the belief holds possible
        (with `kidnapped` = 0).

    Attributes
    ----------
    left_out : float
        Bound on the total variation between this belief and that of a filter over all states, since the last
        time that all were computed: no event's probabilities differ by more.
    left_out_now : float
        The same of what has been left out since before the last prediction: bound on the distance to a filter
        that has computed all states in this step alone.
    skipped : float
        Mass that the last prediction or update has left out itself.
    passive : float
        Estimate of the probability that the robot is not in an active state.
    looks : int
        Number of readings that have refuted the belief, so that all states were computed again.
    log_evidence : float
        Sum of the log evidence of all possible readings.
    recoveries : int
        Number of readings that were impossible, so that the policy decided.
    """

    def __init__(
        self,
        prior: ArrayLike,
        motion: SelectiveMotion,
        *,
        skip: float = 1e-9,
        widest: float = 0.05,
        kidnapped: float = 1e-6,
        advantage: float = 1.5,
        refuted: float = 1e-3,
        probes: int = 1000,
        on_impossible: ImpossiblePolicy = "raise",
    ) -> None:
        for name, value in (("skip", skip), ("widest", widest), ("kidnapped", kidnapped)):
            if not 0.0 <= value < 1.0:
                raise ValueError(f"{name} is a share in [0, 1), not {value}")
        if not 0.0 <= advantage < math.inf:
            raise ValueError(f"the advantage is 0 or more nats, not {advantage}")
        if not 0.0 < refuted < 1.0:
            raise ValueError(f"refuted is a probability between 0 and 1, not {refuted}")
        self.log_evidence = self.passive = 0.0
        self.looks = self.recoveries = 0
        self._missing: FloatArray = np.zeros(2)
        self._forget()
        self._motion, self._skip, self._widest = motion, skip, widest
        self._kidnapped, self._advantage, self._refuted = kidnapped, advantage, refuted
        self._policy: ImpossiblePolicy = on_impossible
        shape = motion.space.shape
        free = np.ones(shape[:2], dtype=bool) if motion.free is None else motion.free
        self._places: IntArray = np.flatnonzero(free)
        if not len(self._places):
            raise ValueError("no cell is free")
        self._probes = min(whole(probes, what="the number of probes", least=1), len(self._places) * shape[2])
        self._readings = 0
        # All masses, or those of the states listed.
        self._states: IntArray | None = None
        self._masses: FloatArray = belief_array(prior, what="prior", shape=shape)
        self._masses = self._masses / self._masses.sum()
        self._narrow()

    @property
    def active(self) -> int:
        """Number of states that are computed."""
        return self._masses.size

    @property
    def states(self) -> IntArray:
        """Numbers, in the raveled belief, of the states that are computed, rising."""
        return np.arange(self._masses.size) if self._states is None else self._states

    @property
    def masses(self) -> FloatArray:
        """Probabilities of `states`; their sum is 1."""
        return self._masses.ravel()

    @property
    def belief(self) -> FloatArray:
        """Belief over all states, a new array of the space's shape; sums to 1."""
        if self._states is None:
            return self._masses.copy()
        result = np.zeros(self._motion.space.shape)
        result.ravel()[self._states] = self._masses
        return result

    def predict(self, control: Any) -> None:
        """Move the belief by a control; mass lost over edges counts in the evidence."""
        self._missing[1] = self.left_out_now = 0.0
        if self._states is None:
            self._masses, log_kept = predict(self._motion.predict, self._masses, control)
            self.skipped = 0.0
        else:
            moved = self._motion.predict_states(self._states, self._masses, control, skip=self._skip)
            log_kept = self._keep(moved.states, moved.masses, moved.left_out, 0.0)
        if log_kept > -math.inf:
            self.log_evidence += log_kept
        self.passive += self._kidnapped * (1.0 - self.passive)

    def update(self, log_likelihood: LogLikelihood, *, highest: float | None = None) -> None:
        """Correct the belief by a reading.

        Parameters
        ----------
        log_likelihood : callable
            Of numbers of states, or None for all: their log p(reading | state), -inf where impossible.
        highest : float, optional
            Upper bound of the log likelihoods, for `left_out`: that of the function if it has one;
            if it is not known, `left_out` is 1.

        Raises
        ------
        ImpossibleReadingError
            If the reading is impossible and `on_impossible` is "raise". The belief stays.
        ValueError
            If the likelihoods have the wrong shape, are nan or infinite, or above the highest.
        """
        if self._states is None:
            self._look(log_likelihood, self._masses)
            return
        if highest is None:
            highest = float(getattr(log_likelihood, "highest", math.inf))
        asked = np.concatenate([self._states, self._probed()])
        found = _checked(log_likelihood(asked), asked.shape, highest)
        scores, probes = found[: -self._probes], found[-self._probes :]
        with np.errstate(divide="ignore"):
            logs = np.log(self._masses) + scores
            best = max(float(logs.max(initial=-np.inf)), float(probes.max()))
            if best == -math.inf:
                kept = elsewhere = 0.0
            else:
                weights = np.exp(np.maximum(logs - best, -700.0)) * (logs > -np.inf)
                kept = (1.0 - self.passive) * float(weights.sum())
                average = float(np.exp(np.maximum(probes - best, -700.0)).mean())
                elsewhere = self.passive * average * math.exp(self._advantage)
        self._readings += 1
        if not kept > 0.0 or elsewhere > self._refuted * (kept + elsewhere):
            self._look(log_likelihood, inject(self.belief, max(self.passive, _EVEN), self._everywhere()))
            self.looks += 1
            return
        self.passive = elsewhere / (kept + elsewhere)
        total = float(weights.sum())
        chosen, left_out = self._heavy(weights, self._skip * total)
        self.log_evidence += best + math.log(total)
        self._keep(self._states[chosen], weights[chosen], left_out, highest - best)

    def _look(self, log_likelihood: LogLikelihood, belief: FloatArray) -> None:
        """Correct all states of a belief, which becomes this one."""
        posterior, log_evidence = update(belief, log_likelihood(None), on_impossible=self._policy)
        self._masses, self._states = posterior, None
        if log_evidence > -math.inf:
            self.log_evidence += log_evidence
        else:
            self.recoveries += 1
        self._forget()
        self._narrow()

    def _forget(self) -> None:
        """Begin to count anew what is left out: all states are computed."""
        self.skipped = self.passive = self.left_out = self.left_out_now = 0.0
        self._missing = np.zeros(2)  # r for k = 1: since all were computed, and since before this prediction

    def _narrow(self) -> None:
        """List the states that matter if they are few."""
        least = self._skip / self._masses.size
        if np.count_nonzero(self._masses >= least if least > 0.0 else self._masses) <= (
            self._widest * self._masses.size
        ):
            chosen, left_out = self._heavy(self._masses, self._skip)
            self._states = chosen
            self._keep(chosen, self._masses.ravel()[chosen], left_out, 0.0)

    def _heavy(self, masses: FloatArray, allowed: float) -> tuple[IntArray, float]:
        """Do what `heavy` does, by machine code if loaded."""
        loops: Any = compiled.kernels(math.prod(self._motion.space.shape))
        return heavy(masses, allowed) if loops is None else loops.heavy(masses.ravel(), allowed)

    def _keep(self, states: IntArray, masses: FloatArray, left_out: float, log_highest: float) -> float:
        """Set the belief to states listed, normalized; count what is left out; return the log of the sum.

        Parameters
        ----------
        states : IntArray, shape (n,)
        masses : FloatArray, shape (n,)
        left_out : float
            Mass, on the same scale, that these states do not have.
        log_highest : float
            Upper bound of the factor of mass elsewhere, on the same scale.
        """
        total = float(masses.sum())
        if total <= 0.0:
            # All has left the grid or ended in walls: start over from everywhere, as a kidnapped robot.
            self._masses, self._states = self._everywhere(), None
            self._forget()
            self.looks += 1
            return -math.inf
        self.skipped = left_out / (left_out + total)
        grown = math.exp(min(log_highest - math.log(total), 300.0))
        self._missing = np.minimum(self._missing * grown + left_out / total, 1e100)
        self.left_out, self.left_out_now = (self._missing / (1.0 + self._missing)).tolist()
        self.passive = min(self.passive + self.skipped, 1.0)
        self._states, self._masses = states, masses / total
        if len(states) > self._widest * math.prod(self._motion.space.shape):
            self._masses, self._states = self.belief, None
        return math.log(total)

    def _everywhere(self) -> FloatArray:
        """Return the belief that all states of the free space are equally likely."""
        shape = self._motion.space.shape
        belief = np.zeros((shape[0] * shape[1], shape[2]))
        belief[self._places] = 1.0 / (len(self._places) * shape[2])
        return belief.reshape(shape)

    def _probed(self) -> IntArray:
        """Return states at equal distances all over the free space, others after every reading."""
        headings = self._motion.space.shape[2]
        size = len(self._places) * headings
        begin = (self._readings * _GOLDEN) % 1.0
        number = ((np.arange(self._probes) + begin) * (size / self._probes)).astype(np.intp)
        place, heading = np.divmod(np.minimum(number, size - 1), headings)
        return np.asarray(self._places[place] * headings + heading)


def _checked(scores: ArrayLike, shape: tuple[int, ...], highest: float) -> FloatArray:
    """Return log likelihoods as an array of doubles; ValueError if they are none."""
    values: FloatArray = np.asarray(scores, dtype=float)
    if values.shape != shape:
        raise ValueError(f"the log likelihoods have shape {values.shape}, the states {shape}")
    greatest = float(values.max(initial=-np.inf))
    if not greatest < math.inf:
        refuse_log_likelihood(values)
    if greatest > highest:
        raise ValueError(f"a log likelihood of {greatest:g} is above the highest one, {highest:g}")
    return values
