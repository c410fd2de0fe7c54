"""The command line of the check: ``ciberrato-grade check``."""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ciberrato.command_line import ProgramParser
from ciberrato.errors import UsageError
from ciberrato.grading.conformance.rows import NAMES, ROWS
from ciberrato.plaintext import plain_lines

PROGRAM = "ciberrato-grade check"


def main(words: Sequence[str]) -> int:
    """Check an agent.

    Parameters
    ----------
    words : sequence of str
        Options, ``--``, and the agent's command line.

    Returns
    -------
    int
        Exit status: 0; 1 if a row failed.

    Raises
    ------
    CiberratoError
        For what the user can put right.
    """
    words = list(words)
    split = words.index("--") if "--" in words else len(words)
    options = _parser().parse_args(words[:split])
    if options.list:
        for row in ROWS:
            print(f"{row.name}\n    done      {row.done}\n    expected  {row.expected}")
        return 0
    command = words[split + 1 :]
    if not command:
        example = f"{PROGRAM} -- ./robot -h {{host}}"
        raise UsageError(
            f"there is no command line; write it after --, as in: {example} (see {PROGRAM} --help)"
        )
    return _check(options, command)


def _check(options: argparse.Namespace, command: list[str]) -> int:
    from ciberrato.files.atomic import replace_file
    from ciberrato.grading import sandbox
    from ciberrato.grading.agents import Agent, command_faults
    from ciberrato.grading.conformance.check import check_agent, rows_named
    from ciberrato.grading.conformance.report import json_report, junit_report, text_report
    from ciberrato.grading.course import GradedLab, Limits, grid_of
    from ciberrato.grading.runner import jobs_by_default
    from ciberrato.grading.workspace import stage_folder
    from ciberrato.labs import find_lab, find_parameters
    from ciberrato.progress import ProgressBar

    rows = rows_named([name for text in options.row for name in text.split(",")])
    faults = command_faults(command)
    if faults:
        raise UsageError("\n".join(faults))
    if not options.folder.is_dir():
        raise UsageError(f"--folder {options.folder}: no such folder; check the path")
    for path in (options.json, options.junit):
        if path is not None and not path.absolute().parent.is_dir():
            raise UsageError(f"{path}: cannot be written: no such folder")
    lab = GradedLab(
        options.lab,
        find_lab(options.lab).absolute(),
        grid_of(options.lab, options.grid),
        None if options.param is None else find_parameters(options.param).absolute(),
        position=options.position,
    )
    kind = sandbox.choose(options.sandbox)
    bar = ProgressBar(len(rows), None if options.quiet or not sys.stderr.isatty() else sys.stderr)
    with tempfile.TemporaryDirectory(prefix="ciberrato-check-", ignore_cleanup_errors=True) as name:
        folder = Path(name) / "agent"
        stage_folder(options.folder, folder)
        judged = check_agent(
            Agent("check", tuple(command), folder),
            lab,
            rows=rows,
            seed=options.seed,
            patience=options.patience,
            limits=Limits(time=120.0, registration=options.registration),
            sandbox=kind,
            jobs=options.jobs or jobs_by_default(lockstep=True),
            step=bar.step,
        )
    bar.close()
    print(f"{plain_lines(shlex.join(command))}\n\n{text_report(judged, failed_only=options.quiet)}")
    for path, write in ((options.json, json_report), (options.junit, junit_report)):
        if path is not None:
            replace_file(path, write(judged, command).encode())
    return 0 if all(one.passed for one in judged) else 1


def _parser() -> argparse.ArgumentParser:
    from ciberrato.grading.sandbox import KINDS

    parser = ProgramParser(
        PROGRAM,
        description="Test how an agent, in any language, copes with a network and a simulator: "
        "lost, doubled and late messages, Stop and Start, a new run, silence, the end. Each row shows what "
        "was done, what was expected and what happened. It needs no running simulator.",
        usage=f"{PROGRAM} [OPTIONS] -- COMMAND...",
        epilog=f"example: {PROGRAM} -- ./robot -h {{host}}:{{port}} -p {{pos}} -r {{name}}. In COMMAND "
        "{host}, {port}, {pos}, {lab} and {name} are filled in; it runs in a copy of --folder, without a "
        "shell. Exit status: 0; 1 if a row failed; 2 if it could not be checked.",
    )
    parser.add_argument(
        "--folder",
        type=Path,
        default=Path(),
        metavar="DIR",
        help="folder of the agent's files; default: this folder",
    )
    parser.add_argument(
        "--row",
        action="append",
        default=[],
        metavar="NAME[,NAME...]",
        help=f"check these rows only: {', '.join(NAMES)}; default: all",
    )
    parser.add_argument("--list", action="store_true", help="list the rows and end")
    parser.add_argument("--lab", default="maze", metavar="FILE", help="lab, file or name; default: maze")
    parser.add_argument(
        "--grid",
        default=None,
        metavar="FILE",
        help="start grid, file or name; default: the one that ships with the lab",
    )
    parser.add_argument(
        "--param", default=None, metavar="FILE", help="parameters, file or name; default: the simulator's"
    )
    parser.add_argument(
        "--position", type=_count, default=1, metavar="N", help="start position, {pos} in COMMAND; default: 1"
    )
    parser.add_argument("--seed", type=_seed, default=1, metavar="N", help="seed of the runs; default: 1")
    parser.add_argument(
        "--patience",
        type=_seconds,
        default=2.0,
        metavar="SECONDS",
        help="longest time for an answer; default: 2",
    )
    parser.add_argument(
        "--registration",
        type=_seconds,
        default=20.0,
        metavar="SECONDS",
        help="longest time for the registration; default: 20",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the report as JSON")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the report as JUnit XML")
    parser.add_argument(
        "--sandbox",
        choices=KINDS,
        default="none",
        help="sandbox, for programs that you do not trust; default: none",
    )
    parser.add_argument(
        "--jobs",
        type=_count,
        default=0,
        metavar="N",
        help="number of rows at a time; default: one per processor",
    )
    parser.add_argument(
        "--quiet", action="store_true", help="print only the rows that failed, and no progress bar"
    )
    return parser


def _seed(text: str) -> int:
    return _number(text, least=0)


def _count(text: str) -> int:
    return _number(text, least=1)


def _number(text: str, *, least: int) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 16 and int(text) >= least):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, {least} or more")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 3600.0:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a number of seconds, more than 0 and less than 3600"
        )
    return value
