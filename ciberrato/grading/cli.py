"""The command line of the grading."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from ciberrato.command_line import ProgramParser, run_program
from ciberrato.errors import UsageError
from ciberrato.grading.telling import PROGRAM, shown
from ciberrato.system.ending import word_and_status


def main(arguments: Sequence[str] | None = None) -> int:
    """Grade a course.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name.

    Returns
    -------
    int
        Exit status: 0; 1 if runs could not be, or an agent failed its check; 2 for what the user can put
        right; 130 if interrupted, 143 if terminated (what was run is kept).
    """
    words = list(sys.argv[1:] if arguments is None else arguments)

    def body() -> int:
        if words[:1] == ["check"]:
            from ciberrato.grading.conformance.cli import main as check

            return check(words[1:])
        return _init(words[1:]) if words[:1] == ["init"] else _run(_parser().parse_args(words))

    return run_program(PROGRAM, body)


def _init(words: Sequence[str]) -> int:
    from ciberrato.grading.init import write_course

    parser = ProgramParser(
        f"{PROGRAM} init",
        description="Create the repository of a new course: agents, labs, workflows, and a template for "
        "participants.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder = parser.parse_args(words).folder
    for path in write_course(folder):
        print(path)
    print(f"{PROGRAM}: next: {PROGRAM} {folder / 'course.toml'}; README.md says the rest", file=sys.stderr)
    return 0


def _run(options: argparse.Namespace) -> int:
    from ciberrato.grading import sandbox
    from ciberrato.grading.cgroups import Groups, find_groups
    from ciberrato.grading.course import read_course
    from ciberrato.grading.report import parquet, publish_report, write_report
    from ciberrato.grading.repositories import fetch_agents
    from ciberrato.grading.runner import Graded, grade, jobs_by_default, read_runs
    from ciberrato.grading.secret import with_secret
    from ciberrato.grading.standing import standings
    from ciberrato.grading.task import tasks_of

    whole = read_course(options.course)
    if options.secret is not None:
        whole = with_secret(whole, options.secret)
    course, faults = fetch_agents(whole, _teller(options), network=not options.report)
    if options.tournament:
        if options.sandbox == "docker" or options.scheduler is not None:
            raise UsageError("--tournament: neither in containers nor on a cluster; take --sandbox bwrap")
        from ciberrato.grading.tournament.command import run_tournament

        return run_tournament(options, course, faults)
    expected = len(whole.agents) * len(whole.labs) * len(whole.seeds)
    folder = options.output or options.course.with_suffix("").with_name(f"{options.course.stem}-report")
    if options.publish is not None and options.publish.resolve() == folder.resolve():
        raise UsageError(f"--publish {options.publish}: the whole report is there; name another folder")
    tasks = tasks_of(course)
    interrupt = None
    if not options.report:
        kind = options.sandbox
        if options.scheduler is None:
            kind = sandbox.choose(options.sandbox, course.image)
        if kind == "none":
            print(f"{PROGRAM}: {sandbox.WITHOUT}", file=sys.stderr)
        groups = find_groups() if kind in ("bwrap", "none") and options.scheduler is None else Groups()
        if kind in ("bwrap", "none"):
            _teller(options)(groups.told)
        try:
            faults += grade(
                course,
                tasks,
                folder,
                sandbox=kind,
                jobs=options.jobs or jobs_by_default(lockstep=course.lockstep),
                progress=None if options.quiet else sys.stderr,
                scheduler=options.scheduler,
                groups=groups,
            )
        except KeyboardInterrupt as ended:
            interrupt = ended
        finally:
            groups.close()
    done = read_runs(folder / "runs.jsonl")
    runs = [Graded(task, *done[task.key]) for task in tasks if task.key in done]
    if options.report and not runs:
        raise UsageError(f"{folder}: holds no runs of this course; grade it first, without --report")
    for fault in faults:
        print(f"{PROGRAM}: could not be run: {fault}", file=sys.stderr)
    if runs:
        ranked = standings(course, runs)
        write_report(course, ranked, folder, missing=expected - len(runs))
        if not parquet.available():
            _teller(options)(parquet.WITHOUT)
        if options.publish is not None:
            publish_report(course, ranked, folder, options.publish, missing=expected - len(runs))
        width = max(len(shown(one.agent)) for one in ranked)
        for one in ranked:
            bad = f"   {one.bad} of {len(one.runs)} runs failed" * (one.bad > 0)
            print(f"{one.place:3d}  {shown(one.agent):{width}s}  {one.total:10.2f}{bad}")
        if options.compare is not None:
            from ciberrato.grading.comparison import compare, words

            print(words(compare(ranked, *options.compare), *map(shown, options.compare)))
        print((folder if options.publish is None else options.publish) / "index.html")
    if interrupt is not None:
        word, status = word_and_status(interrupt)
        print(
            f"\n{PROGRAM}: {word} after {len(runs)} of {expected} runs; the same command continues from here",
            file=sys.stderr,
        )
        return status
    return 1 if faults else 0


def _teller(options: argparse.Namespace) -> Callable[[str], None]:
    """Return what says on standard error what goes on, if that is wanted."""
    return lambda line: None if options.quiet else print(f"{PROGRAM}: {shown(line)}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    from ciberrato.grading.sandbox import KINDS

    parser = ProgramParser(
        PROGRAM,
        description="Run every agent of a course in every lab with every seed, each in a sandbox with "
        "limits, and write a report: an offline site, CSV, JSON, JUnit and Gradescope. "
        f"`{PROGRAM} init FOLDER` creates a new course; `{PROGRAM} check -- COMMAND` tests how one agent "
        "copes with a bad network and with all that a simulator may do.",
    )
    parser.add_argument(
        "course", type=Path, metavar="COURSE.toml", help="course file: agents, labs, seeds, points"
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="folder of the report; default: COURSE-report beside the course",
    )
    parser.add_argument(
        "--secret",
        type=Path,
        metavar="FILE.toml",
        help="course file of more labs and seeds, hidden from published reports",
    )
    parser.add_argument(
        "--publish",
        type=Path,
        metavar="DIR",
        help="write a second report, without what is secret, into a folder",
    )
    parser.add_argument(
        "--sandbox",
        choices=KINDS,
        default="auto",
        help="sandbox of the agents; bwrap: bubblewrap, loopback only, other files hidden; docker: "
        "containers of the course's image (docker or podman); none: limits only; default: auto, "
        "bwrap where it works",
    )
    parser.add_argument(
        "--jobs",
        type=_jobs,
        default=0,
        metavar="N",
        help="number of runs at a time; default: one per processor",
    )
    parser.add_argument(
        "--tournament",
        action="store_true",
        help="run several agents at once, see [tournament] in the course; writes COURSE-tournament",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of a Dask cluster for the runs; default: this machine"
    )
    parser.add_argument(
        "--report", action="store_true", help="run nothing; write the report of the finished runs"
    )
    parser.add_argument(
        "--compare", nargs=2, metavar="AGENT", help="compare two agents by runs of the same lab and seed"
    )
    parser.add_argument("--quiet", action="store_true", help="print no progress bar")
    return parser


def _jobs(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of runs, 1 or more")
    return value
