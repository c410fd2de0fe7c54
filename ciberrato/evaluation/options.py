"""The options of the evaluation's command line."""

from __future__ import annotations

import argparse
from pathlib import Path

from agent.drives.registry import parse_drive
from ciberrato.command_line import ProgramParser
from ciberrato.evaluation.task import BUILT_IN, DRIVES, GPS, PRIORS, STARTS

PROGRAM = "ciberrato-evaluate"
GROUPS = (
    "lab",
    "start",
    "prior",
    "parameters",
    "settings",
    "compass",
    "gps",
    "drive",
    "filter",
    "code",
    "resolution",
)
PUBLIC = "public ones are in the folder Labs of https://github.com/iris-ua/ciberRatoTools"


def make_parser() -> argparse.ArgumentParser:
    """Return the parser."""
    parser = ProgramParser(
        PROGRAM,
        description="Run the filter in many labs, from many starts, and say how soon and how surely it knows "
        "where it is. Runs are in lockstep, in this machine's processes or on a Dask cluster.",
    )
    add = parser.add_argument
    add(
        "--lab",
        action="extend",
        nargs="+",
        metavar="LAB",
        help="name or file; `maps`: all that ship, `judged`: the public ones by the rule, `all`: every lab "
        "in the folder of --labs; may be given again",
    )
    add(
        "--labs",
        type=Path,
        metavar="DIR",
        help="folder of other labs, in which names are looked up, too; alone the same as --lab all; default: "
        f"$CIBERRATO_LABS; {PUBLIC}",
    )
    add(
        "--start",
        nargs="+",
        choices=STARTS,
        default=["centres"],
        help="where robots start: in the lab's start grid, in centres of cells, anywhere; default: centres",
    )
    add(
        "--prior",
        nargs="+",
        choices=PRIORS,
        help="told: the filter is told that it starts in a cell's centre, where it does; default: anywhere",
    )
    add("--told", action="store_true", help="the same as --prior told")
    add("--parameters", nargs="+", default=["default"], metavar="FILE", help="names or files")
    add(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE,...",
        help="runs with each of these values of a parameter, like MotorsNoise=0,1.5,5; may be given again",
    )
    add(
        "--compass", nargs="+", choices=("on", "off"), default=["on"], help="with one or without; default: on"
    )
    add("--gps", nargs="+", choices=GPS, default=["announced"], help="announced: as the parameters say")
    add(
        "--filter",
        nargs="+",
        type=_filter,
        default=[BUILT_IN],
        metavar="FILTER",
        help=f"{BUILT_IN} (default), or filters of your own beside it: module:function, or the name of an "
        "entry point in ciberrato.filters; the drives ask the built-in one, so that all see the same runs",
    )
    add(
        "--drive",
        nargs="+",
        type=_drive,
        default=["explore"],
        metavar="DRIVE",
        help=f"{', '.join(DRIVES)}; or drives of your own: module:function[:TEXT], or the name of an entry "
        "point in ciberrato.drives; default: explore",
    )
    add("--seeds", type=int, default=10, metavar="N", help="runs of each kind; default: 10")
    add("--first-seed", type=int, default=0, metavar="N", help="seeds are counted up from it; default: 0")
    add("--cycles", type=int, default=800, metavar="N", help="of a run; default: 800")
    add("--settle", type=int, default=0, metavar="N", help="end a run N cycles after its first right claim")
    add("--resolution", type=float, metavar="UNITS", help="default: 0.1, coarser in large labs")
    add("--kidnap", type=int, default=0, metavar="CYCLE", help="put the robot elsewhere before that cycle")
    add(
        "--output",
        type=Path,
        default=Path("evaluation.jsonl"),
        metavar="FILE",
        help="outcomes, added to",
    )
    add("--report", action="store_true", help="run nothing, sum up what the output file holds")
    add("--replay", nargs="+", type=Path, metavar="DIR", help="run the filter over recorded sessions instead")
    add(
        "--published",
        action="store_true",
        help="hold the filter against the published method instead, from --seeds cells, without motor noise",
    )
    add("--by", nargs="+", choices=GROUPS, metavar="AXIS", help=f"groups of the table: {', '.join(GROUPS)}")
    add(
        "--compare",
        nargs=2,
        type=_drive,
        metavar="DRIVE",
        help="compare two drives by group, where the first is slow above all",
    )
    add(
        "--table",
        type=Path,
        metavar="FILE",
        help="write the outcomes there, a row a run: .csv or .parquet (extra `tables`)",
    )
    add("--figures", type=Path, metavar="DIR", help="draw figures there")
    add("--jobs", type=int, default=0, metavar="N", help="processes; default: one a core")
    add("--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs the tasks instead")
    add("--strict", action="store_true", help="refuse labs, grids and parameters with warnings")
    add("--quiet", action="store_true", help="no progress bar")
    return parser


def _drive(text: str) -> str:
    """Check a drive."""
    if text in DRIVES:  # goto goes to a place that is drawn
        from agent.drives.registry import GROUP
        from ciberrato.plugins import refuse_taken

        refuse_taken(GROUP, [text])
        return text
    try:
        name, _ = parse_drive(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if name in DRIVES:
        raise argparse.ArgumentTypeError(f"{text!r}: write {name}; the place is drawn at random")
    return text


def _filter(text: str) -> str:
    """Check that a filter can be loaded."""
    if text != BUILT_IN:
        from ciberrato.evaluation.judged import load_filter

        load_filter(text)
    return text
