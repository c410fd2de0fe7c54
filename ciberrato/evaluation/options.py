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
        description="Run the filter in many labs, from many starts, and report how soon and how reliably it "
        "localizes the robot. Runs are in lockstep, in processes of this machine or on a Dask cluster.",
    )
    add = parser.add_argument
    add(
        "--lab",
        action="extend",
        nargs="+",
        metavar="LAB",
        help="names or files of labs; `maps`: all that ship, `judged`: the public labs by the rule, `all`: "
        "every lab in the folder of --labs; may be repeated",
    )
    add(
        "--labs",
        type=Path,
        metavar="DIR",
        help="folder of more labs; names are looked up in it, too; without --lab, all of them; default: "
        f"$CIBERRATO_LABS; {PUBLIC}",
    )
    add(
        "--start",
        nargs="+",
        choices=STARTS,
        default=["centres"],
        help="start poses: those of the start grid, centres of cells, or any free ones; default: centres",
    )
    add(
        "--prior",
        nargs="+",
        choices=PRIORS,
        help="prior of the filter; told: centres of cells, where the robot starts in one; default: anywhere",
    )
    add("--told", action="store_true", help="same as --prior told")
    add("--parameters", nargs="+", default=["default"], metavar="FILE", help="parameters, names or files")
    add(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE,...",
        help="run with each of these values of a parameter, as in MotorsNoise=0,1.5,5; may be repeated",
    )
    add("--compass", nargs="+", choices=("on", "off"), default=["on"], help="compass on or off; default: on")
    add(
        "--gps",
        nargs="+",
        choices=GPS,
        default=["announced"],
        help="GPS; announced: as in the parameters (default)",
    )
    add(
        "--filter",
        nargs="+",
        type=_filter,
        default=[BUILT_IN],
        metavar="FILTER",
        help=f"filters: {BUILT_IN} (default), and your own: module:function, or the name of an entry point "
        "in ciberrato.filters; drives follow the built-in one, so that all filters see the same runs",
    )
    add(
        "--drive",
        nargs="+",
        type=_drive,
        default=["explore"],
        metavar="DRIVE",
        help=f"drives: {', '.join(DRIVES)}, or your own: module:function[:TEXT], or the name of an entry "
        "point in ciberrato.drives; default: explore",
    )
    add("--seeds", type=int, default=10, metavar="N", help="number of runs of each kind; default: 10")
    add(
        "--first-seed",
        type=int,
        default=0,
        metavar="N",
        help="seed of the first run; the others count up; default: 0",
    )
    add("--cycles", type=int, default=800, metavar="N", help="cycles of a run; default: 800")
    add(
        "--settle",
        type=int,
        default=0,
        metavar="N",
        help="end a run N cycles after its first right claim; default: 0, do not",
    )
    add(
        "--resolution",
        type=float,
        metavar="UNITS",
        help="resolution of the filter; default: 0.1",
    )
    add(
        "--kidnap",
        type=int,
        default=0,
        metavar="CYCLE",
        help="move the robot elsewhere before that cycle; default: 0, do not",
    )
    add(
        "--output",
        type=Path,
        default=Path("evaluation.jsonl"),
        metavar="FILE",
        help="file to which the outcomes are added; default: evaluation.jsonl",
    )
    add("--report", action="store_true", help="run nothing; summarize the output file")
    add("--replay", nargs="+", type=Path, metavar="DIR", help="run the filter over recorded sessions instead")
    add(
        "--published",
        action="store_true",
        help="compare the filter with the published method instead, from --seeds cells, without motor noise",
    )
    add("--by", nargs="+", choices=GROUPS, metavar="AXIS", help=f"group the table by: {', '.join(GROUPS)}")
    add(
        "--compare",
        nargs=2,
        type=_drive,
        metavar="DRIVE",
        help="compare two drives by group, above all where the first is slow",
    )
    add(
        "--calibration",
        action="store_true",
        help="show how often estimates of some probability were right, by group",
    )
    add(
        "--table",
        type=Path,
        metavar="FILE",
        help="write the outcomes, one row per run: .csv or .parquet (extra `tables`)",
    )
    add("--figures", type=Path, metavar="DIR", help="draw figures into a folder")
    add("--jobs", type=int, default=0, metavar="N", help="number of processes; default: one per core")
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask cluster that runs the tasks; default: this machine",
    )
    add("--strict", action="store_true", help="refuse labs, grids and parameters that have warnings")
    add("--quiet", action="store_true", help="print no progress bar")
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
