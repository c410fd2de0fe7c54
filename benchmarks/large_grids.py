"""Time and memory of a step of the museum's filter, over all states and selectively, 10^4 to 10^8 states.

``python -m benchmarks.large_grids [FIGURE.png]`` prints the table and draws it. Times are those of one
processor core (CPU time of the thread, the least of several), so that other programs count little; memory is
what a step allocates at its peak. The largest grid is computed in machine code and single precision only.
"""

from __future__ import annotations

import math
import os
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from ciberrato.bayes import GridFilter, SelectiveFilter, compiled
from ciberrato.bayes.filtering import update
from examples import museum

GRIDS = ((0.8, 12), (0.4, 24), (0.4, 90), (0.2, 90), (0.2, 180), (0.2, 360))
LARGEST = (0.1, 720)
STOPS = 14
DOUBLE, SINGLE = "machine code", "machine code, float32"
ONE_PASS, ONE_PASS_SINGLE = "GridFilter, machine code", "GridFilter, machine code, float32"
SELECTIVE, LISTED = "selective", "selective, machine code"


class Size(NamedTuple):
    """One grid: states, those active, and of a step CPU seconds and bytes, by kind of computing."""

    states: int
    active: int
    seconds: dict[str, float]
    held: dict[str, int]
    distance: float


def cpu_time(work: Callable[[], Any], repeats: int) -> float:
    """Return the least CPU time of a call in this thread."""
    best = float("inf")
    for _ in range(repeats):
        begin = time.thread_time()
        work()
        best = min(best, time.thread_time() - begin)
    return best


def peak(work: Callable[[], Any]) -> int:
    """Return the bytes that a call allocates at its peak."""
    tracemalloc.start()
    work()
    result = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return result


def measure(cell: float, headings: int) -> Size:
    """Follow the tour from a start known to a metre; measure the last step."""
    hall = museum.build(cell, headings)
    compiled.use(None)
    tour = museum.visit(hall, 1)
    x, y = (axis.centres - pose for axis, pose in zip(hall.space.axes, tour.truth[0, :2], strict=False))
    heading = hall.space.axes[2].difference(hall.space.axes[2].centres, tour.truth[0, 2])
    prior = np.exp(-0.5 * (x[:, np.newaxis] ** 2 + y**2))[:, :, np.newaxis] * np.exp(-2.0 * heading**2)
    robot = SelectiveFilter(prior * hall.free[:, :, np.newaxis], hall.motion)
    beam = museum.BEAM.beam_log_likelihood
    for stop in range(STOPS):
        if stop:
            robot.predict(tour.controls[stop - 1])
        robot.update(hall.table.scan(tour.scans[stop], beam, weight=museum.WEIGHT))
    before, control, scan = robot.belief, tour.controls[STOPS - 1], tour.scans[STOPS]
    result = before

    def dense() -> None:
        nonlocal result
        predicted = hall.motion.predict(before, control)
        result, _ = update(predicted, hall.table.log_likelihood(scan, beam, weight=museum.WEIGHT))

    following = SelectiveFilter(before, hall.motion)

    def selective() -> None:
        nonlocal following
        following.predict(control)
        following.update(hall.table.scan(scan, beam, weight=museum.WEIGHT))

    active = following.active
    seconds, held = {"numpy": cpu_time(dense, 3)}, {"numpy": peak(dense)}
    distance = 0.0
    for name in (SELECTIVE, LISTED):
        if name == LISTED and not compiled.load():
            break
        fast = float("inf")
        for _ in range(9):
            following = SelectiveFilter(before, hall.motion)
            fast = min(fast, cpu_time(selective, 1))
        if name == SELECTIVE:
            distance = 0.5 * float(np.abs(following.belief - result).sum())
        following = SelectiveFilter(before, hall.motion)
        seconds[name], held[name] = fast, peak(selective)
    compiled.use(None)
    add_machine_code(hall, tour, before, seconds, held)
    return Size(hall.space.size, active, seconds, held, distance)


def add_machine_code(
    hall: museum.Museum,
    tour: museum.Tour,
    belief: np.ndarray,
    seconds: dict[str, float],
    held: dict[str, int],
) -> None:
    """Measure the last step in machine code, in the precisions that the belief can have; one core."""
    if not compiled.load():
        return
    for name, whole, kind in ((DOUBLE, ONE_PASS, np.float64), (SINGLE, ONE_PASS_SINGLE, np.float32)):
        if belief.dtype == np.float32 and kind == np.float64:
            continue
        now = belief.astype(kind, copy=False)

        def step(now: np.ndarray = now) -> None:
            predicted = hall.motion.predict(now, tour.controls[STOPS - 1])
            scores = hall.table.log_likelihood(
                tour.scans[STOPS], museum.BEAM.beam_log_likelihood, weight=museum.WEIGHT
            )
            update(predicted, scores, out=predicted)

        step()
        seconds[name], held[name] = cpu_time(step, 3), peak(step)
        robot = GridFilter(now, hall.motion, dtype=kind)

        def one_pass(robot: GridFilter = robot) -> None:
            robot.predict(tour.controls[STOPS - 1])
            robot.update(
                hall.table.scan(tour.scans[STOPS], museum.BEAM.beam_log_likelihood, weight=museum.WEIGHT)
            )

        one_pass()
        seconds[whole], held[whole] = cpu_time(one_pass, 3), peak(one_pass)
    compiled.use(None)


def measure_largest(cell: float, headings: int) -> Size:
    """Measure a step from all free places alike, in machine code and single precision."""
    hall = museum.build(cell, headings)
    belief = np.repeat(hall.free[:, :, np.newaxis].astype(np.float32), headings, axis=2)
    belief /= np.float32(belief.sum(dtype=float))
    seconds: dict[str, float] = {}
    held: dict[str, int] = {}
    add_machine_code(hall, museum.visit(hall, 1), belief, seconds, held)
    return Size(hall.space.size, hall.space.size, seconds, held, math.nan)


def main() -> None:
    """Print the table; draw it where a path is told."""
    compiled._cores = lambda: 1  # type: ignore[assignment]  # times are of one core
    print("CPU time of a step / ms, memory allocated in it / MB")
    sizes = []
    for grid in (*GRIDS, LARGEST):
        size = measure_largest(*grid) if grid == LARGEST else measure(*grid)
        sizes.append(size)
        dense = size.seconds.get("numpy", math.nan)
        told = " | ".join(
            f"{name} {1e3 * seconds:.2f} ms {size.held[name] / 1e6:.1f} MB"
            + (f" {100.0 * seconds / dense:.2g} % of numpy" if name in (SELECTIVE, LISTED) else "")
            for name, seconds in size.seconds.items()
        )
        print(f"{size.states:,} states, {size.active:,} active: {told}; {size.distance:.0e}", flush=True)
    if len(sys.argv) > 1:
        draw(sizes, Path(sys.argv[1]))


def draw(sizes: list[Size], path: Path) -> None:
    """Draw time and memory against the number of states."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4.6), layout="constrained")
    for axis, field, scale, label in (
        (axes[0], "seconds", 1e3, "CPU time of a step / ms"),
        (axes[1], "held", 1e-6, "memory allocated in a step / MB"),
    ):
        for name, mark in (
            ("numpy", "o-"),
            (DOUBLE, "^-"),
            (SINGLE, "v-"),
            (ONE_PASS, "<-"),
            (ONE_PASS_SINGLE, ">-"),
            (SELECTIVE, "s-"),
            (LISTED, "D-"),
        ):
            known = [size for size in sizes if name in size.seconds]
            values = [scale * getattr(size, field)[name] for size in known]
            axis.loglog([size.states for size in known], values, mark, label=name)
        axis.set(xlabel="states", ylabel=label)
        axis.grid(True, which="major", alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
