"""Lines, matrices and small planes: against plain loops, filterpy and hmmlearn."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from benchmarks.measure import Row, absent, best_time
from ciberrato.bayes.convolution import convolve
from ciberrato.bayes.filtering import update, update_by_likelihood
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.bayes.sensors.landmarks import LandmarkSensor
from ciberrato.bayes.smoothing import forward
from ciberrato.bayes.spaces import rectangle


def lines() -> Iterator[Row]:
    """Yield one prediction and update on a circle."""
    kernel = np.array([0.1, 0.8, 0.1])
    for size, target in ((100, 17e-6), (100_000, 6e-3)):
        group = f"1-D predict + update, {size:,} cells"
        rng = np.random.default_rng(1)
        belief, likelihood = rng.dirichlet(np.ones(size)), rng.random(size)
        listed, weights, chances = belief.tolist(), kernel.tolist(), likelihood.tolist()

        def loops(
            listed: list[float] = listed,
            weights: list[float] = weights,
            chances: list[float] = chances,
            n: int = size,
        ) -> list[float]:
            after = [0.0] * n
            for i in range(n):
                for k in range(3):
                    after[(i + k) % n] += weights[k] * listed[i]
            after = [a * c for a, c in zip(after, chances, strict=True)]
            total = sum(after)
            return [a / total for a in after]

        def ours(belief: Any = belief, likelihood: Any = likelihood) -> Any:
            return update_by_likelihood(convolve(belief, kernel, 0, edge="wrap"), likelihood).posterior

        yield Row(group=group, who="nested loops", seconds=best_time(loops), reference=True)
        try:
            from filterpy import discrete_bayes
        except ImportError:
            yield from absent(group, "filterpy", "filterpy")
        else:

            def theirs(
                belief: Any = belief, likelihood: Any = likelihood, library: Any = discrete_bayes
            ) -> Any:
                return library.update(likelihood, library.predict(belief, 1, kernel))

            worst = np.abs(theirs() - ours()).max() / ours().max()
            yield Row(group=group, who="filterpy", seconds=best_time(theirs), note=f"differs by {worst:.0e}")
        yield Row(
            group=group,
            who="ours",
            ours=True,
            seconds=best_time(ours),
            target=target,
            megabytes=3 * belief.nbytes / 1e6,
            moved=3.0 * belief.nbytes,
        )


def matrices() -> Iterator[Row]:
    """Yield one step of the forward pass with a dense matrix, out of a sequence of 400."""
    times = 400
    for states, target in ((98, 3e-6), (1000, 0.4e-3)):
        group = f"dense forward step, {states:,} states"
        rng = np.random.default_rng(2)
        matrix, prior = rng.dirichlet(np.ones(states), states), np.full(states, 1.0 / states)
        scores = np.log(rng.random((times, states)))
        if states < 200:
            rows_, chances = matrix.tolist(), np.exp(scores[0]).tolist()

            def loops(rows_: Any = rows_, chances: Any = chances, n: int = states) -> list[float]:
                after = [0.0] * n
                for i in range(n):
                    for j in range(n):
                        after[j] += rows_[i][j] / n
                after = [a * c for a, c in zip(after, chances, strict=True)]
                return [a / sum(after) for a in after]

            yield Row(group=group, who="nested loops", seconds=best_time(loops), reference=True)
        try:
            from hmmlearn import _hmmc
        except ImportError:
            yield from absent(group, "hmmlearn", "hmmlearn")
        else:
            chances = np.exp(scores)
            result = _hmmc.forward_scaling(prior, matrix, chances)
            ours = forward(prior, scores, matrix)
            worst = abs(result[0] - ours.log_evidence.sum())
            yield Row(
                group=group,
                who="hmmlearn, scaling (C)",
                note=f"log evidence differs by {worst:.0e}",
                reference=states >= 200,
                seconds=best_time(partial(_hmmc.forward_scaling, prior, matrix, chances)) / times,
            )
        yield Row(
            group=group,
            who="ours",
            ours=True,
            target=target,
            megabytes=matrix.nbytes / 1e6,
            moved=float(matrix.nbytes),
            seconds=best_time(partial(forward, prior, scores, matrix)) / times,
        )


def planes() -> Iterator[Row]:
    """Yield a 60 x 60 plane with landmarks, and the 98 cells of a lab."""
    group = "60 x 60 motion + 4 landmark ranges"
    space = rectangle((60, 60), cell=0.5)
    belief = space.uniform()
    landmarks = ((10.0, 0.0), (10.0, 10.0), (0.0, 15.0), (-5.0, 20.0))
    ranges = (9.0, 6.0, 11.0, 18.0)
    poses = space.centres()
    sensor = LandmarkSensor(landmarks=landmarks, range_sigma=3.0)
    along = [GaussianShift(cell=0.5, sigma=0.5, edge="lose", axis=axis) for axis in (0, 1)]

    def loops() -> np.ndarray:
        taps = [math.exp(-0.5 * k * k) / 2.5066 for k in range(-6, 7)]
        first, second = np.zeros((60, 60)), np.zeros((60, 60))
        for source, target, axis in ((belief, first, 0), (first, second, 1)):
            for i in range(60):
                for j in range(60):
                    for k in range(13):
                        a, b = (i + k - 5, j) if axis == 0 else (i, j + k - 5)
                        if 0 <= a < 60 and 0 <= b < 60:
                            target[a, b] += taps[k] * source[i, j]
        for i in range(60):
            for j in range(60):
                x, y = poses[i, j]
                for (u, v), z in zip(landmarks, ranges, strict=True):
                    second[i, j] *= math.exp(-0.5 * ((z - math.hypot(u - x, v - y)) / 3.0) ** 2)
        return np.asarray(second / second.sum())

    def ours() -> np.ndarray:
        moved = along[1].predict(along[0].predict(belief, 0.5), 0.5)
        return update(moved, sensor.log_likelihood(poses, range(4), ranges)).posterior

    worst = np.abs(loops() - ours()).max() / ours().max()
    yield Row(group=group, who="nested loops", seconds=best_time(loops, repeats=2), reference=True)
    yield Row(
        group=group,
        who="ours",
        ours=True,
        seconds=best_time(ours),
        target=16.9e-3,
        megabytes=4 * belief.nbytes / 1e6,
        note=f"differs by {worst:.0e}; PythonRobotics needs 169 ms for a like step",
    )

    group = "98 cells, 4 sensors, sense + move"
    rng = np.random.default_rng(3)
    mean, reading = rng.uniform(0.1, 5.0, (7, 14, 4)), rng.uniform(0.1, 5.0, 4)
    start = np.full((7, 14), 1 / 98)
    gaussian, motion = GaussianSensor(sigma=0.6), BlockedShift(openings=Openings.free(7, 14), blocked="lose")

    def sense_and_move() -> list[list[float]]:
        after = [[0.0] * 14 for _ in range(7)]
        total = 0.0
        for i in range(7):
            for j in range(14):
                p = start[i, j]
                for k in range(4):
                    p *= math.exp(-0.5 * ((reading[k] - mean[i, j, k]) / 0.6) ** 2) / (
                        0.6 * 2.5066282746310002
                    )
                after[i][j] = p
                total += p
        return [[0.0] + [p / total for p in row[:-1]] for row in after]

    def ours_small() -> np.ndarray:
        return motion.predict(update(start, gaussian.log_likelihood(reading, mean)).posterior, "east")

    worst = np.abs(np.array(sense_and_move()) - ours_small()).max()
    yield Row(group=group, who="nested loops", seconds=best_time(sense_and_move), reference=True)
    yield Row(
        group=group,
        who="ours",
        ours=True,
        seconds=best_time(ours_small),
        target=0.48e-3,
        note=f"differs by {worst:.0e}",
    )


def rows() -> Iterator[Row]:
    """Yield all rows."""
    yield from lines()
    yield from matrices()
    yield from planes()
