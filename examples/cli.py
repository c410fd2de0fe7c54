"""The command line of the examples."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from examples import PROBLEMS


def main(arguments: Sequence[str] | None = None) -> int:
    """List the problems, or run those named; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m examples", description="The classic localization problems, solved, with figures."
    )
    parser.add_argument("problem", nargs="*", help=f"all, or any of: {', '.join(PROBLEMS)}; none: list them")
    parser.add_argument(
        "--output", type=Path, default=Path("build/figures"), help="where figures go (%(default)s)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (%(default)s)")
    options = parser.parse_args(arguments)
    if not options.problem:
        for name, path in PROBLEMS.items():
            print(f"{name:8}  {importlib.import_module(path).TITLE}")
        return 0
    names = list(PROBLEMS) if options.problem == ["all"] else options.problem
    for name in names:
        if name not in PROBLEMS:
            print(f"unknown problem {name!r}; choose one of {', '.join(PROBLEMS)}, and all", file=sys.stderr)
            return 2
    options.output.mkdir(parents=True, exist_ok=True)
    for name in names:
        module = importlib.import_module(PROBLEMS[name])
        print(f"== {module.TITLE} (seed {options.seed})")
        for written in module.run(options.output, options.seed):
            print(f"wrote {written}")
    return 0
