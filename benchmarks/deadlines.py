"""Answers of the live agent beside processes that keep the machine busy: many runs, real programs over UDP.

As a program::

    python -m benchmarks.deadlines --runs 16 --busy 0 2

Prints, for each number of busy processes, kind of loops and cycle time, the answers of all runs: the median,
the slowest hundredth, the slowest, how many took longer than half a cycle, and how many messages were not
answered, in all and in the first ten cycles. The first runs of each kind have an empty cache if asked for.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
from pathlib import Path

from benchmarks.agent_live import Live, run
from benchmarks.busy import busy

KINDS = {"numpy": ("off", 50), "numba": ("auto", 20)}


def line(name: str, cycle_time: int, runs: list[Live]) -> str:
    """Return a row of the table."""
    medians = 1e3 * statistics.median(live.answers[0] for live in runs)
    slow = 1e3 * statistics.median(live.answers[1] for live in runs)
    most = 1e3 * max(live.answers[2] for live in runs)
    return (
        f"{name:24} {len(runs):3d} runs: {medians:6.1f} ms (median), {slow:6.1f} ms (99 %), {most:6.1f} ms "
        f"(most); {sum(live.late for live in runs)} of {sum(live.answered for live in runs)} later than "
        f"{cycle_time / 2:g} ms, in {sum(live.late > 0 for live in runs)} runs; "
        f"{sum(live.unanswered for live in runs)} not answered, {sum(live.first for live in runs)} of them "
        f"in the first ten cycles; load {os.getloadavg()[0]:.1f}"
    )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.deadlines")
    parser.add_argument("--runs", type=int, default=16)
    parser.add_argument("--busy", type=int, nargs="+", default=[0, 2], help="processes that only count")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each run")
    parser.add_argument("--kinds", nargs="+", choices=sorted(KINDS), default=sorted(KINDS))
    parser.add_argument("--lab", nargs="+", default=["standard", "corridors", "maze", "rooms"])
    parser.add_argument("--cold", action="store_true", help="an empty cache for each run")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found: dict[tuple[str, int], list[Live]] = {}
        for number in range(options.runs):  # all conditions in turn: the machine is not the same all the time
            lab = options.lab[number % len(options.lab)]
            for kind in options.kinds:
                compiled, cycle_time = KINDS[kind]
                cache = Path(folder) / (f"{number}-{kind}" if options.cold else "cache")
                for count in options.busy:
                    with busy(count):
                        live = run(
                            lab,
                            compiled,
                            cycle_time,
                            cache,
                            cycles=round(1000 * options.seconds / cycle_time),
                        )
                    found.setdefault((kind, count), []).append(live)
        for (kind, count), runs in found.items():
            cycle_time = KINDS[kind][1]
            name = f"{kind}, {cycle_time} ms, busy {count}" + ", cold" * options.cold
            print(line(name, cycle_time, runs), flush=True)


if __name__ == "__main__":
    main()
