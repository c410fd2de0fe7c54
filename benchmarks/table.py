"""The command line of the benchmarks: run them, print ratios, write build/bench.json."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.bandwidth import bytes_per_second
from benchmarks.measure import Row

MODULES = (
    "bandwidth",
    "bayes_lines",
    "bayes_poses",
    "agent_timing",
    "agent_live",
    "pose_tables",
    "simulator_speed",
    "gym_speed",
    "simulator_lockstep",
    "lockstep_parts",
    "simulator_crowd",
)
"""Modules of this package with `rows() -> Iterator[Row]`, in the order of the table. Add yours here."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all modules, or those named; exit status 1 if a target is missed and `--strict` given."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description="Measure speed, print ratios, write build/bench.json."
    )
    parser.add_argument("module", nargs="*", help=f"any of {', '.join(MODULES)} (all)")
    parser.add_argument("--output", type=Path, default=Path("build/bench.json"), help="(%(default)s)")
    parser.add_argument("--strict", action="store_true", help="exit status 1 if a target is missed")
    options = parser.parse_args(arguments)
    for name in options.module:
        if name not in MODULES:
            print(f"no benchmark {name!r}: there are {', '.join(MODULES)}", file=sys.stderr)
            return 2
    bandwidth = bytes_per_second()
    print(f"one core moves {bandwidth / 1e9:.1f} GB/s; times are the least of several series")
    print("columns: time, times faster than the plain reference, memory, share of bandwidth, target")
    done: list[Row] = []
    for name in options.module or MODULES:
        for row in importlib.import_module(f"benchmarks.{name}").rows():
            done.append(row)
            _print(row, done, bandwidth)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    machine = {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "bytes_per_second": bandwidth,
    }
    document = {"machine": machine, "rows": [asdict(row) for row in done]}
    options.output.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {options.output}")
    missed = [row for row in done if row.target and row.seconds and row.seconds > row.target]
    for row in missed:
        print(f"missed: {row.group}, {row.who}: {_time(row.seconds)} against {_time(row.target)}")
    return 1 if missed and options.strict else 0


def _print(row: Row, done: Sequence[Row], bandwidth: float) -> None:
    if row.group not in {other.group for other in done[:-1]}:
        print(f"\n{row.group}")
    reference = next((r.seconds for r in done if r.group == row.group and r.reference), None)
    ratio = f"{reference / row.seconds:,.1f} x" if reference and row.seconds else ""
    memory = f"{row.megabytes:,.1f} MB" if row.megabytes is not None else ""
    share = f"{row.moved / row.seconds / bandwidth:.0%} of bandwidth" if row.moved and row.seconds else ""
    target = f"target {_time(row.target)}" if row.target else ""
    cells = (f"{_time(row.seconds):>10}", f"{ratio:>12}", f"{memory:>11}", f"{share:>19}", f"{target:>16}")
    print(f"  {row.who:38}{''.join(cells)}  {row.note}".rstrip(), flush=True)


def _time(seconds: float | None) -> str:
    if seconds is None:
        return "-"
    for unit, scale in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds / 1e-6:.3g} us"
