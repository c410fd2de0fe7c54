"""The posterior by enumeration: every start cell's weight, with plain loops and `math` only.

An oracle for the agent's filter that shares no code with it: no prediction, no update, no arrays in the
mathematics. A run to the right fixes the cell of each step once the start cell is fixed, so the posterior of
step k is the weight of each start cell, moved k columns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from agent.offline.expected_readings import ExpectedReadings
from ciberrato.arrays import Floats

Reading = Sequence[float | None]


def enumerate_starts(
    readings: Sequence[Reading], expected: ExpectedReadings, *, preset: str, sigma: float
) -> list[Floats | None]:
    """Return the posterior after each step; None where no start cell is possible."""
    rows, columns = expected.free.shape
    free, east = expected.free.tolist(), expected.east.tolist()
    posteriors: list[Floats | None] = []
    weights: dict[tuple[int, int], float] = {}
    for last, reading in enumerate(readings):
        posterior = np.zeros((rows, columns))
        for row in range(rows):
            for start in range(columns):
                column = start + last
                if last == 0:
                    log_weight = 0.0 if preset == "seed" or free[row][start] else -math.inf
                else:
                    log_weight = weights[row, start]
                    if column >= columns or (preset == "calibrated" and not east[row][column - 1]):
                        log_weight = -math.inf
                if log_weight > -math.inf:
                    log_weight += _log_likelihood(preset, expected, last, (row, column), reading, sigma)
                weights[row, start] = log_weight
        best = max(weights.values())
        if best == -math.inf:
            posteriors.extend([None] * (len(readings) - last))
            return posteriors
        total = math.fsum(math.exp(weight - best) for weight in weights.values())
        for (row, start), weight in weights.items():
            if weight > -math.inf:
                posterior[row, start + last] = math.exp(weight - best) / total
        posteriors.append(posterior)
    return posteriors


def _log_likelihood(
    preset: str, expected: ExpectedReadings, step: int, cell: tuple[int, int], reading: Reading, sigma: float
) -> float:
    seen = [(index, value) for index, value in enumerate(reading) if value is not None]
    if preset == "seed":
        ideal = expected.readings[cell]
        return -math.fsum((value - ideal[index]) ** 2 for index, value in seen) / (2 * 0.1)
    if step == 0 or expected.spread is None:
        candidates = [(1.0, expected.readings[cell])]
    else:
        candidates = [(float(w), expected.spread[k][cell]) for k, w in enumerate(expected.weights)]
    total = sum(
        w * math.prod(rounded_probability(value, float(ideal[index]), sigma) for index, value in seen)
        for w, ideal in candidates
    )
    return math.log(total) if total > 0 else -math.inf


def rounded_probability(reading: float, ideal: float, sigma: float) -> float:
    """Return P(floor(10 (ideal + noise) + 0.5) / 10 = reading), from the tail that keeps its digits."""
    if sigma == 0:
        return 1.0 if math.floor(10 * ideal + 0.5) == round(10 * reading) else 0.0
    low, high = (reading - 0.05 - ideal) / sigma, (reading + 0.05 - ideal) / sigma
    if low > 0:
        return _tail(low) - _tail(high)
    return _tail(-high) - _tail(-low)


def _tail(x: float) -> float:
    return 0.5 * math.erfc(x / math.sqrt(2))
