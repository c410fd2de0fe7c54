"""A tournament from the command line."""

from __future__ import annotations

import argparse
import dataclasses
import sys

from ciberrato.errors import UsageError
from ciberrato.grading import sandbox
from ciberrato.grading.course import Course
from ciberrato.grading.report import publish_report, write_report
from ciberrato.grading.runner import jobs_by_default
from ciberrato.grading.telling import PROGRAM, shown
from ciberrato.grading.tournament.matches import matches_of
from ciberrato.grading.tournament.runner import play, read_matches
from ciberrato.grading.tournament.table import played, tournament_standings
from ciberrato.system import descendants
from ciberrato.system.ending import word_and_status


def run_tournament(options: argparse.Namespace, course: Course, faults: list[str]) -> int:
    """Play a course's tournament, or write the report of what was played.

    Parameters
    ----------
    options : argparse.Namespace
        Options of the command line.
    course : Course
    faults : list of str
        Reasons for which agents could not be had.

    Returns
    -------
    int
        Exit status, as of a grading.
    """
    if not options.report and descendants.MEASURES != "all":
        raise UsageError("--tournament: needs Linux, whose /proc tells which agent has registered a robot")
    matches = matches_of(course)
    folder = options.output or options.course.with_suffix("").with_name(f"{options.course.stem}-tournament")
    if options.compare is not None:
        raise UsageError("--compare: of gradings only; a tournament's report says who beat whom")
    if options.publish is not None and options.publish.resolve() == folder.resolve():
        raise UsageError(f"--publish {options.publish}: the whole report is there; name another folder")
    interrupt = None
    if not options.report:
        kind = sandbox.choose(options.sandbox)
        if kind == "none":
            print(f"{PROGRAM}: {sandbox.WITHOUT}", file=sys.stderr)
        try:
            faults = faults + play(
                course,
                matches,
                folder,
                sandbox=kind,
                jobs=options.jobs or jobs_by_default(lockstep=course.lockstep),
                progress=None if options.quiet else sys.stderr,
            )
        except KeyboardInterrupt as ended:
            interrupt = ended
    done = read_matches(folder / "runs.jsonl")
    runs = played(course, matches, done)
    count = sum(match.key in done for match in matches)
    if options.report and not runs:
        raise UsageError(f"{folder}: holds no runs of this tournament; play it first, without --report")
    for fault in faults:
        print(f"{PROGRAM}: could not be run: {shown(fault)}", file=sys.stderr)
    if runs:
        ranked = tournament_standings(course, runs)
        write_report(_counted(course), ranked, folder, missing=len(matches) - count)
        if options.publish is not None:
            missing = len(matches) - count
            publish_report(_counted(course), ranked, folder, options.publish, missing=missing)
        width = max(len(shown(one.agent)) for one in ranked)
        for one in ranked:
            bad = f"   {one.bad} of {len(one.runs)} runs failed" * (one.bad > 0)
            print(f"{one.place:3d}  {shown(one.agent):{width}s}  {one.total:10.2f}{bad}")
        print((folder if options.publish is None else options.publish) / "index.html")
    if interrupt is not None:
        word, status = word_and_status(interrupt)
        print(
            f"\n{PROGRAM}: {word} after {count} of {len(matches)} runs; the same command continues from here",
            file=sys.stderr,
        )
        return status
    return 1 if faults else 0


def _counted(course: Course) -> Course:
    """Return the course with the points that a tournament counts, for the report."""
    table = course.tournament.points
    points = dataclasses.replace(course.points, maximum=100.0 if table is None else None, passing=None)
    return dataclasses.replace(course, points=points)
