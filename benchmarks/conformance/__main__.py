"""Run all checks and print their rows; exit status 1 on any difference, 2 on a wrong command line."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.conformance import Finding

CHECKS = (
    "labs",
    "infrared",
    "motion",
    "codec",
    "transcripts",
    "logs",
    "noise",
    "scoring",
    "homeward",
    "seed_runs",
)
"""Modules of this package, in the order of the table."""
OWN = Path(__file__).parents[2] / "tests" / "data" / "golden"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the checks.

    Parameters
    ----------
    argv : sequence of str or None
        Arguments; None = those of the process.

    Returns
    -------
    int
        Exit status: 0 if every row passed, 1 if not, 2 if a folder that was named is missing.
    """
    parser = argparse.ArgumentParser(prog="python -m benchmarks.conformance", description=__doc__)
    parser.add_argument(
        "--golden",
        type=Path,
        metavar="DIR",
        help="folder of recordings: ir/, physics/, ...; default: $CIBERRATO_GOLDEN, or those of the tests",
    )
    parser.add_argument(
        "--labs",
        type=Path,
        metavar="DIR",
        help="folder of the labs that recordings name; default: $CIBERRATO_LABS, or only the labs that ship",
    )
    parser.add_argument(
        "--only", action="append", choices=CHECKS, help="run this check alone (may be repeated)"
    )
    arguments = parser.parse_args(argv)
    golden = arguments.golden or _folder("CIBERRATO_GOLDEN")
    labs = arguments.labs or _folder("CIBERRATO_LABS")
    for folder in (golden, labs):
        if folder is not None and not folder.is_dir():
            print(f"{folder}: no such folder; name one that is there", file=sys.stderr)
            return 2
    if golden is None:
        print(
            "the recordings that come with the tests; for others: --golden DIR or CIBERRATO_GOLDEN",
            file=sys.stderr,
        )
    if labs is None:
        print(
            "the labs that ship; for others that recordings name: --labs DIR or CIBERRATO_LABS",
            file=sys.stderr,
        )
    began = time.perf_counter()
    table: list[Finding] = []
    for row in all_rows(golden or OWN, labs, arguments.only or CHECKS):
        table.append(row)
        print(_line(row), flush=True)
    failed = sum(not row.passed for row in table)
    cases = sum(row.cases for row in table)
    print(f"{len(table)} rows, {cases:,} cases, {failed} failed, {time.perf_counter() - began:.1f} s")
    return 1 if failed else 0


def _folder(variable: str) -> Path | None:
    name = os.environ.get(variable)
    return Path(name) if name else None


def all_rows(golden: Path, labs: Path | None, checks: Sequence[str] = CHECKS) -> Iterator[Finding]:
    """Run checks one after the other; one that breaks is a failed row, and the others go on.

    Parameters
    ----------
    golden : Path
        Folder of recordings.
    labs : Path or None
        Folder of labs.
    checks : sequence of str
        Names of modules of this package.

    Yields
    ------
    Finding
    """
    for name in checks:
        try:
            yield from importlib.import_module(f"{__package__}.{name}").rows(golden, labs)
        except Exception as error:
            yield Finding(name, 0, None, False, f"the check broke: {type(error).__name__}: {error}")


def _line(row: Finding) -> str:
    difference = "" if row.difference is None else f"{row.difference:.1e}"
    verdict = "ok" if row.passed and row.cases else "skipped" if row.passed else "DIFFERS"
    return f"{row.check:36} {row.cases:>9,} {difference:>9}  {verdict:8} {row.note}".rstrip()


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())
