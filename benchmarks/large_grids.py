"""Time and memory of a step of the museum's filter, over all states and selectively, 10^4 to 10^7 states.

``python -m benchmarks.large_grids [FIGURE.png]`` prints the table and draws it. Times are those of one
processor core (CPU time of the thread, the least of several), so that other programs count little; memory is
what a step allocates at its peak, and what the belief takes.
"""

from __future__ import annotations

import os
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from ciberrato.bayes import SelectiveFilter
from ciberrato.bayes.filtering import update
from examples import museum

GRIDS = ((0.8, 12), (0.4, 24), (0.4, 90), (0.2, 90), (0.2, 180), (0.2, 360))
STOPS = 14


class Size(NamedTuple):
    """One grid: states, those active, and of a step CPU seconds and bytes, dense and selective."""

    states: int
    active: int
    dense: float
    selective: float
    dense_bytes: int
    selective_bytes: int
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
    slow, fast = cpu_time(dense, 3), float("inf")
    for _ in range(7):
        following = SelectiveFilter(before, hall.motion)
        fast = min(fast, cpu_time(selective, 1))
    distance = 0.5 * float(np.abs(following.belief - result).sum())
    following = SelectiveFilter(before, hall.motion)
    taken = peak(selective)
    return Size(hall.space.size, active, slow, fast, peak(dense), taken, distance)


def main() -> None:
    """Print the table; draw it where a path is told."""
    print("  states  active  share | dense/ms  selective/ms  ratio | dense/MB  selective/MB | distance")
    sizes = []
    for cell, headings in GRIDS:
        size = measure(cell, headings)
        sizes.append(size)
        print(
            f"{size.states:>9,} {size.active:>6,} {100 * size.active / size.states:5.2f} % |"
            f" {1e3 * size.dense:8.2f} {1e3 * size.selective:13.2f}"
            f" {100 * size.selective / size.dense:6.2f} % |"
            f" {size.dense_bytes / 1e6:8.1f} {size.selective_bytes / 1e6:13.2f} | {size.distance:.0e}",
            flush=True,
        )
    if len(sys.argv) > 1:
        draw(sizes, Path(sys.argv[1]))


def draw(sizes: list[Size], path: Path) -> None:
    """Draw time and memory against the number of states."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    states = [size.states for size in sizes]
    for axis, (dense, selective), scale, label in (
        (axes[0], ("dense", "selective"), 1e3, "CPU time of a step / ms"),
        (axes[1], ("dense_bytes", "selective_bytes"), 1e-6, "memory allocated in a step / MB"),
    ):
        axis.loglog(states, [scale * getattr(size, dense) for size in sizes], "o-", label="all states")
        axis.loglog(states, [scale * getattr(size, selective) for size in sizes], "s-", label="selective")
        axis.set(xlabel="states", ylabel=label)
        axis.grid(True, which="major", alpha=0.3)
        axis.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
