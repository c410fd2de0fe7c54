"""The command line of the grading."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from ciberrato.command_line import ProgramParser
from ciberrato.errors import CiberratoError, UsageError

PROGRAM = "ciberrato-grade"


def main(arguments: Sequence[str] | None = None) -> int:
    """Grade a course.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name.

    Returns
    -------
    int
        Exit status: 0; 1 if runs could not be; 2 for what the user can put right; 130 if interrupted (what
        was run is kept).
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        status = _init(words[1:]) if words[:1] == ["init"] else _run(_parser().parse_args(words))
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # The reader of our output has seen enough; what is still buffered must not fail at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except CiberratoError as error:
        for line in str(error).splitlines():
            print(f"{PROGRAM}: {line}", file=sys.stderr)
        return 2


def _init(words: Sequence[str]) -> int:
    from ciberrato.grading.init import write_course

    parser = ProgramParser(f"{PROGRAM} init", description="Write a course to begin with.")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    for path in write_course(parser.parse_args(words).folder):
        print(path)
    return 0


def _run(options: argparse.Namespace) -> int:
    from ciberrato.grading import sandbox
    from ciberrato.grading.course import read_course
    from ciberrato.grading.report import write_report
    from ciberrato.grading.runner import Graded, grade, jobs_by_default, read_runs
    from ciberrato.grading.standing import standings
    from ciberrato.grading.task import tasks_of

    course = read_course(options.course)
    folder = options.output or options.course.with_suffix("").with_name(f"{options.course.stem}-report")
    tasks = tasks_of(course)
    faults: list[str] = []
    interrupted = False
    if not options.report:
        kind = sandbox.choose(options.sandbox)
        if kind == "none":
            print(f"{PROGRAM}: {sandbox.WITHOUT}", file=sys.stderr)
        try:
            faults = grade(
                course,
                tasks,
                folder,
                sandbox=kind,
                jobs=options.jobs or jobs_by_default(lockstep=course.lockstep),
                progress=None if options.quiet else sys.stderr,
            )
        except KeyboardInterrupt:
            interrupted = True
    done = read_runs(folder / "runs.jsonl")
    runs = [Graded(task, *done[task.key]) for task in tasks if task.key in done]
    if options.report and not runs:
        raise UsageError(f"{folder}: holds no runs of this course; grade it first, without --report")
    for fault in faults:
        print(f"{PROGRAM}: could not be run: {fault}", file=sys.stderr)
    if runs:
        ranked = standings(course, runs)
        write_report(course, ranked, folder, missing=len(tasks) - len(runs))
        width = max(len(_shown(one.agent)) for one in ranked)
        for one in ranked:
            bad = f"   {one.bad} of {len(one.runs)} runs failed" * (one.bad > 0)
            print(f"{one.place:3d}  {_shown(one.agent):{width}s}  {one.total:10.2f}{bad}")
        if options.compare is not None:
            from ciberrato.grading.comparison import compare, words

            print(words(compare(ranked, *options.compare), *map(_shown, options.compare)))
        print(folder / "index.html")
    if interrupted:
        print(
            f"\n{PROGRAM}: interrupted after {len(runs)} of {len(tasks)} runs; the same command goes on "
            "from here",
            file=sys.stderr,
        )
        return 130
    return 1 if faults else 0


def _shown(name: str) -> str:
    """Return a name without what a terminal would obey."""
    return "".join(sign if sign.isprintable() else "?" for sign in name)


def _parser() -> argparse.ArgumentParser:
    from ciberrato.grading.sandbox import KINDS

    parser = ProgramParser(
        PROGRAM,
        description="Run every agent of a course in every lab with every seed, each in a sandbox with "
        "limits, and write a report: a site without a network, CSV, JSON, JUnit and Gradescope. "
        f"`{PROGRAM} init FOLDER` writes a course to begin with.",
    )
    parser.add_argument("course", type=Path, metavar="COURSE.toml", help="agents, labs, seeds, points")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="of the report; default: COURSE-report beside the course"
    )
    parser.add_argument(
        "--sandbox",
        choices=KINDS,
        default="auto",
        help="bwrap: bubblewrap, loopback only, other files unseen; none: limits only; default: auto, bwrap "
        "where it works",
    )
    parser.add_argument(
        "--jobs", type=_jobs, default=0, metavar="N", help="runs at a time; default: one a processor"
    )
    parser.add_argument("--report", action="store_true", help="run nothing, write the report of what was run")
    parser.add_argument(
        "--compare", nargs=2, metavar="AGENT", help="compare two agents by runs of the same lab and seed"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser


def _jobs(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of runs, 1 or more")
    return value
