"""Markov localization over the recorded steps: which cell is the robot in, after each reading.

Grid localization (Thrun, Burgard, Fox, *Probabilistic Robotics*, 2005, table 8.1) over the cells of the lab,
driving to the right from an unknown cell. Two presets:

``seed``
    The published method as it is: uniform prior; likelihood of a step = product over the sensors of a
    Gaussian of variance 0.1 around 1/distance; the motion shifts the belief one column to the right and
    ignores walls; what is shifted out of the lab is lost.
``calibrated``
    The simulator's own noise: a reading is a Gaussian of the announced ObstacleNoise, rounded to 0.1, so
    its likelihood is the mass of the interval that rounds to it. Cells in which a robot cannot stand have no
    prior mass, and a step to the right is impossible through a wall. With motor noise the robot crosses a
    cell centre a little beside it and a little turned; the likelihood is then averaged over that error.

If no cell is left possible, both presets *restart*: the past is forgotten and the reading alone decides
(policy ``likelihood`` of `ciberrato.bayes.recovery`). Each such step is reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.infrared.model import reading_log_likelihood

if TYPE_CHECKING:
    from agent.offline.expected_readings import ExpectedReadings

Preset = Literal["seed", "calibrated"]
PRESETS: tuple[Preset, ...] = ("seed", "calibrated")


class Doubt(NamedTuple):
    """Doubt about a step, after a gap in which the robot may have been stopped.

    Attributes
    ----------
    step : float
        Probability that no cell was entered.
    reading : float
        Probability that the reading was taken elsewhere than at a cell's centre, and is not informative.
    """

    step: float = 0.0
    reading: float = 0.0


NO_DOUBT = Doubt()

LEAST_NOISE = 0.01
"""Standard deviation in 1/units that `calibrated` assumes where less is announced. A robot a hair's breadth
off the centre reads something that without any noise no cell could explain."""

SEED_VARIANCE = 0.1
"""Variance of a reading in the published method, in (1/units)²."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Localization:
    """The beliefs over a run.

    Attributes
    ----------
    beliefs : ndarray, shape (steps + 1, rows, columns)
        The prior, then one belief a step; each sums to 1, row 0 is the bottom row of the lab.
    log_evidence : ndarray, shape (steps,)
        Natural logarithm of the probability of each step given those before (motion and reading); -inf
        where no cell was left possible.
    recoveries : tuple of int
        The steps at which the filter restarted.
    """

    beliefs: Floats
    log_evidence: Floats
    recoveries: tuple[int, ...]


def localize(
    readings: Sequence[Sequence[float | None]],
    expected: ExpectedReadings,
    *,
    preset: Preset = "calibrated",
    obstacle_noise: float = 0.1,
    doubts: Sequence[Doubt] | None = None,
) -> Localization:
    """Run the filter over the recorded steps.

    Parameters
    ----------
    readings : sequence of shape (steps, sensors)
        Readings at the start cell and at the centre of each cell entered; None or nan where there is none.
    expected : ExpectedReadings
        Expected reading of each sensor in each cell, and between which cells there is no wall.
    preset : {"seed", "calibrated"}
        See the module's text.
    obstacle_noise : float
        Standard deviation that the simulator announced, in 1/units; `calibrated` uses it.
    doubts : sequence of Doubt, optional
        Doubts of each step; default: none.

    Returns
    -------
    Localization

    Raises
    ------
    ValueError
        If the readings have not as many sensors as were expected, or the preset is unknown.
    """
    rows, columns, sensors = expected.readings.shape
    observed = np.array(readings, dtype=float)  # None becomes nan
    if len(observed) and observed.shape[1] != sensors:
        raise ValueError(f"{observed.shape[1]} readings a step for {sensors} sensors")
    if preset == "seed":
        prior = np.full((rows, columns), 1.0 / (rows * columns))
        motion = BlockedShift(openings=Openings.free(rows, columns), blocked="lose")
    elif preset == "calibrated":
        free = expected.free if expected.free.any() else np.ones((rows, columns), dtype=bool)
        prior = free / free.sum()
        motion = BlockedShift(openings=Openings(east=expected.east, north=expected.north), blocked="lose")
    else:
        raise ValueError(f"unknown preset {preset!r}; choose one of {', '.join(PRESETS)}")
    beliefs = [prior]
    log_evidence = np.empty(len(observed))
    recoveries = []
    for step, reading in enumerate(observed):
        predicted = beliefs[-1] if step == 0 else motion.predict(beliefs[-1], "east")
        if preset == "seed":
            log_likelihood = seed_log_likelihood(reading, expected.readings)
        else:
            noise = max(obstacle_noise, LEAST_NOISE)
            log_likelihood = calibrated_log_likelihood(reading, expected, noise, at_start=step == 0)
        if doubts is not None and doubts[step] != NO_DOUBT:
            predicted, log_likelihood = _widened(beliefs[-1], predicted, log_likelihood, doubts[step])
        posterior, log_evidence[step] = update(predicted, log_likelihood, on_impossible="likelihood")
        if log_evidence[step] == -np.inf:
            recoveries.append(step)
        beliefs.append(posterior)
    return Localization(beliefs=np.array(beliefs), log_evidence=log_evidence, recoveries=tuple(recoveries))


def _widened(
    before: Floats, predicted: Floats, log_likelihood: Floats, doubt: Doubt
) -> tuple[Floats, Floats]:
    """Return prediction and log-likelihood of a step that may not have been one."""
    predicted = (1.0 - doubt.step) * predicted + doubt.step * before
    if doubt.reading > 0.0 and np.isfinite(log_likelihood).any():
        best = log_likelihood.max()
        likelihood = np.exp(log_likelihood - best)
        mixed = (1.0 - doubt.reading) * likelihood + doubt.reading * likelihood.mean()
        log_likelihood = np.log(mixed) + best
    return predicted, log_likelihood


def seed_log_likelihood(reading: Floats, expected: Floats) -> Floats:
    """Return the published method's log-likelihood of a step in every cell, up to a constant.

    Parameters
    ----------
    reading : ndarray, shape (sensors,)
        nan where there is none.
    expected : ndarray, shape (..., sensors)
        1/distance at the cell centres.

    Returns
    -------
    ndarray, shape (...)
    """
    seen = ~np.isnan(reading)
    errors = reading[seen] - expected[..., seen]
    return np.asarray(-(errors**2).sum(axis=-1) / (2.0 * SEED_VARIANCE))


def calibrated_log_likelihood(
    reading: Floats, expected: ExpectedReadings, obstacle_noise: float, *, at_start: bool
) -> Floats:
    """Return the exact log-probability of the rounded readings of a step in every cell.

    Parameters
    ----------
    reading : ndarray, shape (sensors,)
        nan where there is none.
    expected : ExpectedReadings
        With the readings at the pose errors that motor noise makes likely at a crossing.
    obstacle_noise : float
        Standard deviation in 1/units.
    at_start : bool
        The robot stands where it was put: exactly in the centre of a cell.

    Returns
    -------
    ndarray, shape (rows, columns)
        Natural logarithm; averaged, as a probability, over the pose errors unless `at_start`.
    """
    seen = ~np.isnan(reading)
    if at_start or expected.spread is None:
        return _joint(reading[seen], expected.readings[..., seen], obstacle_noise)
    each = _joint(reading[seen], expected.spread[..., seen], obstacle_noise)  # (errors, rows, columns)
    with np.errstate(divide="ignore"):  # a pose error of weight 0 has the logarithm -inf, rightly
        each = each + np.log(expected.weights)[:, None, None]
    best = each.max(axis=0)
    scale = np.where(np.isfinite(best), best, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(scale + np.log(np.exp(each - scale).sum(axis=0)))


def _joint(reading: Floats, expected: Floats, obstacle_noise: float) -> Floats:
    # The sensors' errors are independent: their log-probabilities add up.
    return np.asarray(reading_log_likelihood(reading, expected, obstacle_noise).sum(axis=-1))
